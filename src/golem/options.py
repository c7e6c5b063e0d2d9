"""Turns option values from a stack file into what a constructor's type hints ask for, or says why it cannot."""

from __future__ import annotations

import dataclasses
import inspect
import typing
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, cast

from golem.errors import ConfigError, unknown_name

_SCALARS: dict[Any, tuple[tuple[type, ...], str]] = {
    bool: ((bool,), "true or false"),
    int: ((int,), "an integer"),
    float: ((int, float), "a number"),
    str: ((str,), "a word"),
    Path: ((str, Path), "a path"),
}
"""What a value must be for a type hint, and how to say it."""
_NAMED = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)


def fill(what: str, config: type[Any], options: Mapping[str, object]) -> Any:
    """Return an instance of the dataclass `config` with `options`; dataclasses inside it are given as mappings.

    Args:
        what: what the options are to the user, e.g. `"option of upper_body: diff_ik"`.
        config: the dataclass.
        options: values by field name.

    Raises:
        ConfigError: an option does not exist, has the wrong type, or has no default and is missing.
    """
    return config(**convert_all(what, config, options))


def convert_all(
    what: str, function: type[Any], options: Mapping[str, object], supplied: Collection[str] = ()
) -> dict[str, Any]:
    """Return `options` as keyword arguments of the class `function`, converted to its type hints.

    Args:
        what: what the options are to the user.
        function: the class to be called.
        options: values by parameter name.
        supplied: parameters that the caller passes itself.

    Raises:
        ConfigError: as in `fill`.
    """
    parameters = inspect.signature(function).parameters
    valid = {k: p for k, p in parameters.items() if k not in supplied and p.kind in _NAMED}
    takes_any = any(p.kind is inspect.Parameter.VAR_KEYWORD for p in parameters.values())
    for key in options:
        if key not in valid and not takes_any:
            raise unknown_name(what, key, valid)
    for key, parameter in valid.items():
        if parameter.default is parameter.empty and key not in options:
            raise ConfigError(f"The {what} '{key}' has no default and must be given.")
    hints = typing.get_type_hints(function if dataclasses.is_dataclass(function) else function.__init__)
    return {key: _convert(f"{what} '{key}'", hints.get(key), value) for key, value in options.items()}


def dataclass_in(hint: Any) -> type[Any] | None:
    """Return the dataclass that a type hint is, or has among its alternatives."""
    for candidate in (hint, *typing.get_args(hint)):
        if inspect.isclass(candidate) and dataclasses.is_dataclass(candidate):
            return candidate
    return None


def _convert(what: str, hint: Any, value: Any) -> Any:
    """Return `value` as the type hint asks for it; a hint that is not understood here accepts anything."""
    config = dataclass_in(hint)
    if config is not None and isinstance(value, Mapping):
        return fill(f"key of {what}", config, cast(Mapping[str, object], value))
    if config is not None and hint is config and not isinstance(value, config):
        names = ", ".join(f.name for f in dataclasses.fields(config))
        raise ConfigError(f"The {what} is a mapping with keys from {names}; not {value!r}.")
    if hint in _SCALARS:
        kinds, wanted = _SCALARS[hint]
        if not isinstance(value, kinds) or (isinstance(value, bool) and hint is not bool):
            raise ConfigError(f"The {what} is {wanted}, not {value!r}.")
        return hint(value)
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin is typing.Literal and value not in inner:
        raise unknown_name(f"value of {what}", str(value), map(str, inner))
    if origin in (tuple, list):
        return _sequence(what, origin, inner, value)
    return value


def _sequence(what: str, kind: type[Any], inner: tuple[Any, ...], value: Any) -> Any:
    """Return the list `value` as a tuple or list whose members have the types `inner`."""
    if not isinstance(value, list | tuple):
        raise ConfigError(f"The {what} is a list, not {value!r}.")
    members = cast(list[Any], list(cast(Any, value)))
    hints = (*inner[:1],) * len(members) if kind is list or inner[-1] is ... else inner
    if len(members) != len(hints):
        raise ConfigError(f"The {what} has {len(hints)} values, not {len(members)}.")
    return kind([_convert(what, hint, member) for hint, member in zip(hints, members, strict=True)])
