"""The rungs by name, and what a command line for one can be refused for before anything heavy is imported."""

from __future__ import annotations

from collections.abc import Sequence

from golem import registry
from golem.errors import ConfigError, check_known, unknown_name
from golem.package_data import load_data

PROFILES = ("ideal", "bench", "field")
"""Realism profiles of the twin."""

_DATA = load_data(__package__, "rungs.yaml")
RUNGS: dict[str, str] = _DATA["rungs"]
"""Rung name -> `module:Class`."""
COMPARED: dict[str, tuple[str, ...]] = {slot: tuple(rungs) for slot, rungs in _DATA["compared"].items()}
"""Slot -> rungs whose methods are all modules of it."""
_NUMBERS = {"-n": int, "--n": int, "-j": int, "--j": int, "--seed": int, "--limit": float}


def refuse_early(words: Sequence[str]) -> None:
    """Refuse words of `golem ladder`. Raises ConfigError: a rung, method, profile or number that cannot be."""
    given: dict[str, list[str]] = {}
    option = ""
    for word in words:
        name, equals, value = word.partition("=")
        if word.startswith("--") or word in _NUMBERS or (equals and name in _NUMBERS):
            option, rest = name, [value] if equals else []
            given.setdefault(option, []).extend(rest)
        elif option:
            given[option].append(word)
    for option, kind in _NUMBERS.items():
        for value in given.get(option, ())[:1]:
            try:
                kind(value)
            except ValueError:
                what = "a whole number" if kind is int else "a number"
                raise ConfigError(f"{option} is {what}, not '{value}'.") from None
    rung = (given.get("--rung") or ["tether"])[-1]
    check_known("rung", RUNGS, rung)
    check_known("profile", PROFILES, *given.get("--profile", ())[:1])
    slot = next((slot for slot, rungs in COMPARED.items() if rung in rungs), None)
    for method in given.get("--method", ()) if slot else ():
        if ":" not in method and not method.endswith(".py") and method not in registry.names(slot or ""):
            raise unknown_name("method", method, registry.names(slot or ""))
