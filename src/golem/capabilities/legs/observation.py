"""What a leg policy sees: named terms, scaled and in the order its description lists them, for one robot or many."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.legs.base import LocomotionCommand
from golem.errors import ConfigError, unknown_name
from golem.kernels import njit
from golem.native import address, new_record, view
from golem.options import require, vector
from golem.robots.model.imu_mount import TORSO, turn_to_base
from golem.robots.model.spatial import quat_of
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
    "last_action": JOINT_NAMES,
    "phase_sin": SIDES,
    "phase_cos": SIDES,
    "phase": ("left_sin", "left_cos", "right_sin", "right_cos"),
    "joint_angle": JOINT_NAMES,
    "orientation": ("w", "x", "y", "z"),
    "one": ("value",),
}
"""Components of each term, in the order of its values.

joint_position is relative to the policy's default posture, joint_angle is not. phase_sin, phase_cos and phase are of
2 pi times the gait phase, and 0 while the gait clock rests. orientation is the quaternion of base_link in the level
frame; one is always 1, so that its scale is what a policy shall see of a command that does not exist here. last_action
is of the leg motors unless its components are named.
"""
_LEG_NAMES = JOINT_NAMES[LEGS]
_BATCHED = {term: TERMS[term] for term in ("base_velocity", "base_rate", "gravity", "twist", "joint_position")} | {
    "joint_velocity": JOINT_NAMES,
    "last_action": _LEG_NAMES,
    "phase_sin": SIDES,
    "phase_cos": SIDES,
}
_KEYS = [(term, name) for term in _BATCHED for name in _BATCHED[term]]
_KEYS += [("orientation", name) for name in TERMS["orientation"]] + [("one", "value")]
_KEYS += [("last_action", name) for name in JOINT_NAMES[UPPER]]
SIGNALS = len(_KEYS)
"""What terms are made from, in this order; some terms show the same."""
_COLUMNS = {key: i for i, key in enumerate(_KEYS)}
_COLUMNS |= {("joint_angle", name): _COLUMNS["joint_position", name] for name in JOINT_NAMES}
_COLUMNS |= {("phase", f"{side}_{f}"): _COLUMNS[f"phase_{f}", side] for side in SIDES for f in ("sin", "cos")}
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
        clip: lowest and highest value, before the scale; none is limited where it is absent.
        history: how many ticks of it are shown, the present one included.
    """

    term: str
    scale: float | tuple[float, ...] = 1.0
    of: tuple[str, ...] = ()
    clip: tuple[float, float] | None = None
    history: int = 1


MEASURED = np.dtype(
    [
        *(("gyro", "f8", (3,)), ("base", "f8", (4, 4)), ("velocity", "f8", (3,)), ("twist", "f8", (3,))),
        *(("q", "f8", (NUM_JOINTS,)), ("dq", "f8", (NUM_JOINTS,)), ("action", "f8", (NUM_JOINTS,))),
        *(("phase", "f8", (2,)), ("stepping", "f8"), ("quat", "f8", (4,))),
    ]
)
"""What `ObservationLayout.look` is given."""
_measured_at = view(MEASURED)
_LEG_COUNT = len(_LEG_NAMES)
HistoryOrder = Literal["term", "frame"]
"""How past ticks are laid out: all ticks of a term, then those of the next; or all terms of a tick, then the next."""


@njit(cache=True, nogil=True)
def _look(
    measured: int, columns: NDArray[np.int64], offset: Array, low: Array, high: Array, scale: Array, out: Array
) -> None:
    """Write the observation of the `MEASURED` at an address into `out`, as long as `columns`; of the present tick."""
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
    for i in range(_LEG_COUNT):
        values[at + i] = m.action[i]
    at += _LEG_COUNT
    for k in range(2):
        angle = 2.0 * np.pi * m.phase[k]
        values[at + k], values[at + 2 + k] = math.sin(angle) * m.stepping, math.cos(angle) * m.stepping
    at += 4
    for i in range(4):
        values[at + i] = m.quat[i]
    values[at + 4] = 1.0
    at += 5
    for i in range(_LEG_COUNT, len(m.action)):
        values[at + i - _LEG_COUNT] = m.action[i]
    for i in range(len(out)):
        value = values[columns[i]] - offset[i]
        # So that what is no number stays none.
        value = low[i] if value < low[i] else high[i] if value > high[i] else value
        out[i] = value * scale[i]


class ObservationLayout:
    """The order, offsets and scales of an observation; `components` are the terms of one tick's values."""

    def __init__(
        self, terms: Sequence[Term], posture: Array, order: HistoryOrder = "term", newest_first: bool = False
    ) -> None:
        """Look the terms up.

        Args:
            terms: in the order of the observation.
            posture: (27,) default posture, which joint_position is relative to [rad].
            order: how past ticks are laid out.
            newest_first: whether the present tick comes first, or last.

        Raises:
            ConfigError: there is no term, an unknown term or component, a scale of the wrong length, or a history that
                cannot be meant.
        """
        if not terms:
            raise ConfigError(f"An observation needs at least one term of: {', '.join(TERMS)}.")
        for t in terms:
            low, high = t.clip or (-inf, inf)
            require(
                f"term {t.term}'s ",
                ("history", t.history, 1 <= t.history <= 1000, "a number of ticks from 1 to 1000"),
                ("clip", low, low < high, "a lower and a higher number"),
            )
        lengths = [t.history for t in terms]
        if order == "frame" and len(set(lengths)) > 1:
            raise ConfigError("A history by frames has the same length for all terms; choose 'history: term'.")
        chosen = [(t, name) for t in terms for name in _components(t)]
        self.components = tuple((t.term, name) for t, name in chosen)
        self._columns = np.array([_COLUMNS[key] for key in self.components])
        default = {("joint_position", name): q for name, q in zip(JOINT_NAMES, posture, strict=True)}
        self._offset = np.array([default.get(key, 0.0) for key in self.components])
        bounds = np.array([t.clip or (-inf, inf) for t, _ in chosen])
        self._low, self._high = bounds[:, 0].copy(), bounds[:, 1].copy()
        self._scale = np.concatenate([vector(f"scale of {t.term}", t.scale, len(_components(t))) for t in terms])
        self._ticks: Array = np.zeros((max(lengths), len(chosen)))
        self._shown = _history(terms, order, newest_first) if max(lengths) > 1 else None
        self.size = len(chosen) if self._shown is None else len(self._shown)
        self._turned = any(term == "orientation" for term, _ in self.components)
        self._fresh = True
        memory = new_record(MEASURED)
        self._measured, self._address = memory[0], address(memory)
        self._memory = memory

    def reset(self) -> None:
        """Forget past ticks: at the next one, all are like that."""
        self._fresh = True

    def observe(self, signals: Signals) -> Array:
        """Return the (..., size) observation of the present tick, of terms without clips that `Signals` has."""
        s = signals
        angle = 2.0 * np.pi * s.phase
        runs = s.stepping[..., None]
        # In the order of TERMS.
        turns = (np.sin(angle) * runs, np.cos(angle) * runs)
        values = np.concatenate([s.velocity, s.gyro, s.gravity, s.twist, s.q, s.dq, s.action, *turns], axis=-1)
        return (values.take(self._columns, axis=-1) - self._offset) * self._scale

    def look(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, action: Array) -> Array:
        """Return the (size,) observation of one robot: all about the base as estimated, its rate by the torso IMU.

        The policy's last `action` is (12,) or (27,), by motor.
        """
        m, twist = self._measured, motion.twist
        m["q"], m["dq"], m["gyro"] = state.q, state.dq, state.imu.gyro
        m["action"][: len(action)] = action
        m["base"], m["velocity"] = base.T_odom_base, base.velocity
        m["twist"], m["phase"], m["stepping"] = (twist.vx, twist.vy, twist.wz), motion.phase, motion.stepping
        if self._turned:
            m["quat"] = quat_of(base.T_odom_base[:3, :3])
        out = np.empty(len(self.components))
        _look(self._address, self._columns, self._offset, self._low, self._high, self._scale, out)
        if self._shown is None:
            return out
        self._ticks[:-1] = out if self._fresh else self._ticks[1:]
        self._ticks[-1], self._fresh = out, False
        return self._ticks.take(self._shown)


def _history(terms: Sequence[Term], order: HistoryOrder, newest_first: bool) -> NDArray[np.intp]:
    """Return where each value of the observation is among those of all ticks, the oldest first."""
    longest, width = max(t.history for t in terms), sum(len(_components(t)) for t in terms)
    places = np.arange(longest * width).reshape(longest, width)
    if newest_first:
        places = places[::-1]
    if order == "frame":
        return places.ravel()
    blocks = np.split(places, np.cumsum([len(_components(t)) for t in terms])[:-1], axis=1)
    cut = [b[: t.history] if newest_first else b[-t.history :] for b, t in zip(blocks, terms, strict=True)]
    return np.concatenate([block.ravel() for block in cut])


def _components(term: Term) -> tuple[str, ...]:
    """Return the components that `term` asks for. Raises ConfigError: the term or a component does not exist."""
    if term.term not in TERMS:
        raise unknown_name("observation term", term.term, TERMS)
    names = TERMS[term.term]
    if not term.of:
        return _LEG_NAMES if term.term == "last_action" else names
    groups = {group: members for group, members in GROUPS.items() if set(members) <= set(names)}
    out: list[str] = []
    for word in term.of:
        if word not in names and word not in groups:
            raise unknown_name(f"component of {term.term}", word, (*groups, *names))
        out.extend(groups.get(word, (word,)))
    return tuple(out)
