"""The vendor's services on the robot's own computer: status codes, JSON payloads, numbers of the loco service."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass

from golem.errors import unknown_name
from golem.types import Array


@dataclass(frozen=True, slots=True)
class ArmSdkCommand:
    """What a program of the vendor's wants of the 14 motors of both arms.

    Attributes:
        weight: how much of it is asked for, 0 to 1; the rest is the stack's own.
        motors: (5, 14) q [rad], dq [rad/s], tau [N m], kp, kd.
    """

    weight: float
    motors: Array


OK = 0
SEND_FAILED = 3102
TIMEOUT = 3104
NOT_IMPLEMENTED = 3203
BAD_PARAMETER = 3204
GET_VERSION = 1
"""The api_id with which every service answers its version."""
MEANING = {
    SEND_FAILED: "nobody on the domain offers the service",
    TIMEOUT: "no answer in time",
    NOT_IMPLEMENTED: "the service has no such function",
    BAD_PARAMETER: "the parameter is wrong",
}
"""What status codes of any service mean; numbers from unitree_sdk2_python, unitree_sdk2py/rpc/internal.py."""


@dataclass(frozen=True, slots=True)
class LocoApi:
    """The numbers of one robot's loco service.

    Attributes:
        service: name of the service.
        version: of its functions.
        get_fsm_id, set_fsm_id, set_velocity: api_ids.
        zero_torque, damp, stand_up, start: ids of the states of its state machine.
        not_available: code of a call that the present state does not allow.
        invalid_fsm_id: code of a state that does not exist or cannot be reached.
    """

    service: str
    version: str
    get_fsm_id: int
    set_fsm_id: int
    set_velocity: int
    zero_torque: int
    damp: int
    stand_up: int
    start: int
    not_available: int
    invalid_fsm_id: int

    def function(self, api_id: int) -> str:
        """Return the name of a function, for messages."""
        names = {
            GET_VERSION: "get_version",
            self.get_fsm_id: "get_fsm_id",
            self.set_fsm_id: "set_fsm_id",
            self.set_velocity: "set_velocity",
        }
        return names.get(api_id, f"function {api_id}")

    def meaning(self, code: int) -> str:
        """Return what a status code means, for messages."""
        own = {
            self.not_available: "the state of the robot does not allow it",
            self.invalid_fsm_id: "no such state, or none that can be reached now",
        }
        return {**MEANING, **own}.get(code, "unknown code")


LOCO_APIS = {
    # unitree_sdk2 include/unitree/robot/h1/loco/{h1_loco_api,h1_loco_client,h1_loco_error}.hpp
    "h1": LocoApi("loco", "2.0.0.0", 8001, 8101, 8105, 0, 1, 2, 204, 8301, 8302),
    # unitree_sdk2 include/unitree/robot/g1/loco/{g1_loco_api,g1_loco_client}.hpp; error codes as for h2
    "g1": LocoApi("sport", "1.0.0.0", 7001, 7101, 7105, 0, 1, 4, 500, 7301, 7302),
    # unitree_sdk2_python unitree_sdk2py/h2/loco/{h2_loco_api,h2_loco_client}.py
    "h2": LocoApi("sport", "1.0.0.0", 7001, 7101, 7105, 0, 1, 4, 601, 7301, 7302),
}
"""Loco services by robot. The SDK has no client for the H1-2; which of them its firmware answers is unverified."""
LOCO_API = "h1"
"""The one that is assumed."""


def loco_api(robot: object) -> LocoApi:
    """Return the loco service of `robot`, a name in `LOCO_APIS`. Raises ConfigError: there is none of that name."""
    if not isinstance(robot, str) or robot not in LOCO_APIS:
        raise unknown_name("robot with a loco service", str(robot), LOCO_APIS)
    return LOCO_APIS[robot]


def encode(values: Mapping[str, object]) -> str:
    """Return a JSON payload. Raises ValueError: a number is NaN or infinite, which JSON cannot say."""
    return json.dumps(values, allow_nan=False)


def decode(payload: str) -> dict[str, object]:
    """Return the values of a JSON payload; an empty payload has none. Raises ValueError: it is no JSON object."""
    try:
        values = json.loads(payload or "{}", parse_constant=_refuse)
    except RecursionError as error:
        raise ValueError("a payload is a JSON object, not this deep") from error
    if not isinstance(values, dict):
        raise ValueError(f"a payload is a JSON object, not {payload!r:.60}")
    return values


def decode_int(payload: str) -> int:
    """Return the integer `data` of a payload. Raises ValueError: there is none."""
    value = decode(payload).get("data")
    if not isinstance(value, int) or isinstance(value, bool):
        raise ValueError(f"'data' is an integer, not {value!r:.60}")
    return value


def decode_velocity(payload: str) -> tuple[tuple[float, float, float], float]:
    """Return vx, vy [m/s], wz [rad/s] and their duration [s] from a payload.

    Raises ValueError: it has no such numbers, one is not finite, or the duration is negative.
    """
    values = decode(payload)
    velocity, duration = values.get("velocity"), values.get("duration")
    if not isinstance(velocity, list) or len(velocity) != 3 or not all(map(_is_finite, velocity)):
        raise ValueError(f"'velocity' is a list of three finite numbers, not {velocity!r:.60}")
    if not isinstance(duration, int | float) or not _is_finite(duration) or duration < 0.0:
        raise ValueError(f"'duration' is a time in seconds, not {duration!r:.60}")
    return (float(velocity[0]), float(velocity[1]), float(velocity[2])), float(duration)


def _is_finite(value: object) -> bool:
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # an integer that no float holds
        return False


def _refuse(constant: str) -> object:
    raise ValueError(f"{constant} is no JSON")
