"""The rungs by name, and what a command line for one can be refused for before anything heavy is imported."""

from __future__ import annotations

from collections.abc import Sequence

from golem import registry
from golem.errors import ConfigError, unknown_name

PROFILES = ("ideal", "bench", "field")
"""Realism profiles of the twin."""

RUNGS: dict[str, str] = {
    "tether": "golem.evaluation.rungs.pick_screw:TetherRung",
    "stand": "golem.evaluation.rungs.pick_screw:StandRung",
    "tether-calibrated": "golem.evaluation.rungs.calibrated_robot:CalibratedTether",
    "calibration": "golem.evaluation.rungs.calibrated_robot:CalibrationRung",
    "fridge-tether": "golem.evaluation.rungs.open_fridge:FridgeTether",
    "fridge-stand": "golem.evaluation.rungs.open_fridge:FridgeStand",
    "counter-tether": "golem.evaluation.rungs.counter:CounterTether",
    "counter-stand": "golem.evaluation.rungs.counter:CounterStand",
    "fetch": "golem.evaluation.rungs.fetch_errand:FetchRung",
    "push": "golem.evaluation.rungs.push:PushRung",
    "push-ramp": "golem.evaluation.rungs.push_ramp:PushRampRung",
    "push-limit": "golem.evaluation.rungs.push_limit:PushLimit",
    "gate-limits": "golem.evaluation.rungs.gate_limits:GateLimits",
    "faults": "golem.evaluation.rungs.faults:FaultsRung",
    "stand-quiet": "golem.evaluation.rungs.stand_minute:StandQuiet",
    "stand-arms": "golem.evaluation.rungs.stand_minute:StandArms",
    "walk-twist": "golem.evaluation.rungs.walk_twist:WalkTwist",
    "walk-stop": "golem.evaluation.rungs.walk_stop:WalkStop",
    "walk-endurance": "golem.evaluation.rungs.walk_endurance:WalkEndurance",
    "walk-rough": "golem.evaluation.rungs.walk_rough:WalkRough",
    "tour": "golem.evaluation.rungs.tour:Tour",
    "navigate-line": "golem.evaluation.rungs.navigate_line:NavigateLine",
    "navigate": "golem.evaluation.rungs.navigate_hall:NavigateRung",
    "var-stand": "golem.evaluation.rungs.var_stand:VarStandRung",
    "pack": "golem.evaluation.rungs.whole_pack:WholePackRung",
    "base-estimation": "golem.evaluation.rungs.base_estimation:BaseEstimation",
    "odometry": "golem.evaluation.rungs.odometry:OdometryRung",
    "memory": "golem.evaluation.rungs.spatial_memory:MemoryRung",
    "mpc-rate": "golem.evaluation.rungs.mpc_rate:MpcRate",
}
"""Rung name -> `module:Class`; the module is imported when the rung is used."""

COMPARED: dict[str, tuple[str, ...]] = {
    "grasp_method": (
        *("tether", "stand", "tether-calibrated", "fridge-tether", "fridge-stand"),
        *("counter-tether", "counter-stand", "var-stand", "pack"),
    ),
    "lower_body": (
        *("push", "push-ramp", "push-limit", "gate-limits", "stand-quiet", "stand-arms"),
        *("walk-twist", "walk-stop", "walk-endurance", "walk-rough", "tour", "navigate-line"),
    ),
    "memory": ("memory", "fetch"),
    "navigator": ("navigate",),
}
"""Slot -> rungs whose methods are all modules of it."""
_NUMBERS = {"-n": int, "--n": int, "-j": int, "--j": int, "--seed": int, "--limit": float}


def refuse_early(words: Sequence[str]) -> None:
    """Refuse words of `golem ladder` whose rung, methods, profile or numbers cannot be.

    Raises:
        ConfigError: about the first that cannot.
    """
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
    if rung not in RUNGS:
        raise unknown_name("rung", rung, RUNGS)
    for value in given.get("--profile", ())[:1]:
        if value not in PROFILES:
            raise unknown_name("profile", value, PROFILES)
    slot = next((slot for slot, rungs in COMPARED.items() if rung in rungs), None)
    for method in given.get("--method", ()) if slot else ():
        if ":" not in method and not method.endswith(".py") and method not in registry.names(slot or ""):
            raise unknown_name("method", method, registry.names(slot or ""))
