"""What a leg policy sees: named terms, scaled and in the order its description lists them, for one robot or many."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.legs.base import LocomotionCommand
from golem.errors import ConfigError, unknown_name
from golem.kernels import njit
from golem.native import address, new_record, view
from golem.options import vector
from golem.robots.model.imu_mount import TORSO, turn_to_base
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS, NUM_JOINTS, SIDES, UPPER, Array, BaseEstimate, LowState

_AXES = ("x", "y", "z")

TERMS: dict[str, tuple[str, ...]] = {
    "base_velocity": _AXES,
    "base_rate": _AXES,
    "gravity": _AXES,
    "twist": ("vx", "vy", "wz"),
    "joint_position": JOINT_NAMES,
    "joint_velocity": JOINT_NAMES,
    "last_action": JOINT_NAMES[LEGS],
    "phase_sin": SIDES,
    "phase_cos": SIDES,
}
"""Components of each term, in the order of its values.

joint_position is relative to the policy's default posture. phase_sin and phase_cos are of 2 pi times the gait phase,
and 0 while the gait clock rests.
"""
SIGNALS = sum(map(len, TERMS.values()))
"""Components of all terms together."""
GROUPS: dict[str, tuple[str, ...]] = {"legs": JOINT_NAMES[LEGS], "upper": JOINT_NAMES[UPPER]}
"""Words that stand for several joints in `Term.of`."""


@dataclass(frozen=True, slots=True)
class Signals:
    """What the terms are made from; the leading axes are those of the robots, none for one.

    Attributes:
        q, dq: (..., 27) joint positions [rad] and velocities [rad/s].
        gyro: (..., 3) angular rate of base_link in base_link [rad/s].
        gravity: (..., 3) unit vector along gravity in base_link, (0, 0, -1) when upright.
        velocity: (..., 3) linear velocity of base_link in base_link [m/s].
        twist: (..., 3) commanded vx, vy [m/s] and wz [rad/s].
        action: (..., 12) the policy's last action.
        phase: (..., 2) gait phase of the left and the right leg, 0 to 1.
        stepping: (...) whether the gait clock runs.
    """

    q: Array
    dq: Array
    gyro: Array
    gravity: Array
    velocity: Array
    twist: Array
    action: Array
    phase: Array
    stepping: Array


@dataclass(frozen=True, slots=True)
class Term:
    """One term of an observation.

    Attributes:
        term: its name in `TERMS`.
        scale: factor of its values, one for all or one for each.
        of: which components, by the names in `TERMS` or of a group in `GROUPS`; empty is all.
    """

    term: str
    scale: float | tuple[float, ...] = 1.0
    of: tuple[str, ...] = ()


MEASURED = np.dtype(
    [
        *(("gyro", "f8", (3,)), ("base", "f8", (4, 4)), ("velocity", "f8", (3,)), ("twist", "f8", (3,))),
        *(("q", "f8", (NUM_JOINTS,)), ("dq", "f8", (NUM_JOINTS,)), ("action", "f8", (LEGS.stop,))),
        *(("phase", "f8", (2,)), ("stepping", "f8")),
    ]
)
"""What `ObservationLayout.look` is given."""
_measured_at = view(MEASURED)


@njit(cache=True, nogil=True)
def _look(measured: int, columns: NDArray[np.int64], offset: Array, scale: Array, out: Array) -> None:
    """Write the observation of the `MEASURED` at an address into `out` (size,)."""
    m = _measured_at(measured)
    values, R = np.empty(SIGNALS), m.base
    turn_to_base(m.gyro, m.q[TORSO], m.dq[TORSO], values[3:6])
    for a in range(3):
        values[a] = m.velocity[0] * R[0, a] + m.velocity[1] * R[1, a] + m.velocity[2] * R[2, a]
        values[6 + a] = -R[2, a]
        values[9 + a] = m.twist[a]
    at = 12
    for i in range(len(m.q)):
        values[at + i], values[at + len(m.q) + i] = m.q[i], m.dq[i]
    at += 2 * len(m.q)
    for i in range(len(m.action)):
        values[at + i] = m.action[i]
    at += len(m.action)
    for k in range(2):
        angle = 2.0 * np.pi * m.phase[k]
        values[at + k], values[at + 2 + k] = math.sin(angle) * m.stepping, math.cos(angle) * m.stepping
    for i in range(len(out)):
        out[i] = (values[columns[i]] - offset[i]) * scale[i]


class ObservationLayout:
    """The order, offsets and scales of an observation.

    Attributes:
        size: number of values.
        components: (size,) what each value is: term and component.
    """

    def __init__(self, terms: Sequence[Term], posture: Array) -> None:
        """Look the terms up.

        Args:
            terms: in the order of the observation.
            posture: (27,) default posture, which joint_position is relative to [rad].

        Raises:
            ConfigError: there is no term, an unknown term or component, or a scale of the wrong length.
        """
        if not terms:
            raise ConfigError(f"An observation needs at least one term of: {', '.join(TERMS)}.")
        chosen = [(t, name) for t in terms for name in _components(t)]
        column = {key: i for i, key in enumerate((term, name) for term in TERMS for name in TERMS[term])}
        self.components = tuple((t.term, name) for t, name in chosen)
        self.size = len(chosen)
        self._columns = np.array([column[key] for key in self.components])
        default = {("joint_position", name): q for name, q in zip(JOINT_NAMES, posture, strict=True)}
        self._offset = np.array([default.get(key, 0.0) for key in self.components])
        self._scale = np.concatenate([vector(f"scale of {t.term}", t.scale, len(_components(t))) for t in terms])
        memory = new_record(MEASURED)
        self._measured, self._address = memory[0], address(memory)
        self._memory = memory

    def observe(self, signals: Signals) -> Array:
        """Return the (..., size) observation."""
        s = signals
        angle = 2.0 * np.pi * s.phase
        runs = s.stepping[..., None]
        # In the order of TERMS.
        values = np.concatenate(
            [
                *(s.velocity, s.gyro, s.gravity, s.twist, s.q, s.dq, s.action),
                *(np.sin(angle) * runs, np.cos(angle) * runs),
            ],
            axis=-1,
        )
        return (values.take(self._columns, axis=-1) - self._offset) * self._scale

    def look(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, action: Array) -> Array:
        """Return the (size,) observation of one robot: all about the base as estimated, its rate by the torso IMU.

        Args:
            state: joints and IMU.
            base: estimated pose and velocity of base_link.
            motion: what the base layer asks for.
            action: (12,) the policy's last action.
        """
        m, twist = self._measured, motion.twist
        m["q"], m["dq"], m["gyro"], m["action"] = state.q, state.dq, state.imu.gyro, action
        m["base"], m["velocity"] = base.T_odom_base, base.velocity
        m["twist"], m["phase"], m["stepping"] = (twist.vx, twist.vy, twist.wz), motion.phase, motion.stepping
        out = np.empty(self.size)
        _look(self._address, self._columns, self._offset, self._scale, out)
        return out


def _components(term: Term) -> tuple[str, ...]:
    """Return the components that `term` asks for.

    Raises:
        ConfigError: the term or a component does not exist.
    """
    if term.term not in TERMS:
        raise unknown_name("observation term", term.term, TERMS)
    names = TERMS[term.term]
    if not term.of:
        return names
    groups = {group: members for group, members in GROUPS.items() if set(members) <= set(names)}
    out: list[str] = []
    for word in term.of:
        if word not in names and word not in groups:
            raise unknown_name(f"component of {term.term}", word, (*groups, *names))
        out.extend(groups.get(word, (word,)))
    return tuple(out)
