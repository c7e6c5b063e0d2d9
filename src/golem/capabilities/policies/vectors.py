"""The state and the action of this robot as vectors with names and units, for data sets, environments and policies.

A palm is nine numbers in base_link: position [m], then the first two columns of its rotation, which have no jump
anywhere (Zhou et al. 2019, "On the Continuity of Rotation Representations in Neural Networks").
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from golem.errors import GolemError
from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.model.table import JOINT_NAMES
from golem.types import SIDES, UPPER, Array, BaseEstimate, HandCommand, HandState, LowCommand, LowState, Side, Twist

_JOINTS = [name.removesuffix("_joint") for name in JOINT_NAMES]
_PALM = {**dict.fromkeys("xyz", "m"), **dict.fromkeys(("xx", "xy", "xz", "yx", "yy", "yz"), "1")}
_PALMS = {f"{side}_palm.{part}": unit for side in SIDES for part, unit in _PALM.items()}
STATE: dict[str, str] = {
    **{f"{joint}.pos": "rad" for joint in _JOINTS},
    **{f"{joint}.vel": "rad/s" for joint in _JOINTS},
    **_PALMS,
    **{f"{side}_hand.gap": "m" for side in SIDES},
    **{f"{side}_hand.force_{finger}": "N" for side in SIDES for finger in "ab"},
    "base.height": "m",
    **{f"base.v{axis}": "m/s" for axis in "xyz"},
    **{f"base.up_{axis}": "1" for axis in "xyz"},
}
"""Name -> unit of what is measured; heights are above the soles, velocities and `up` (the vertical) in base_link."""
ACTION: dict[str, str] = {
    **_PALMS,
    **{f"{side}_hand.gap": "m" for side in SIDES},
    "torso.pos": "rad",
    "base.vx": "m/s",
    "base.vy": "m/s",
    "base.wz": "rad/s",
    "base.height": "m",
}
"""Name -> unit of what is commanded: palm targets in base_link, openings (0 closes), torso, twist of the base, its
height (0: the legs' own)."""
EFFORT: dict[str, str] = {f"{joint}.effort": "N m" for joint in _JOINTS}
COMMAND: dict[str, str] = {f"{joint}.target": "rad" for joint in _JOINTS}
"""Name -> unit of the joint targets that passed the safety gate."""
GRIPS = slice(18, 20)
TORSO, TWIST, HEIGHT = 20, slice(21, 24), 24
"""Where in an action what is."""
SHUT = 0.004
"""Opening that is asked for below which a hand closes [m] [own]."""


class ActionRefused(GolemError):
    """What a policy answered is no action of this robot."""


@dataclass(frozen=True, slots=True)
class Instant:
    """What is measured and commanded at one time; commands before the first are None.

    Attributes:
        state, base, hands: measured.
        command, grips, twist: commanded, as the safety gate let it through.
    """

    state: LowState
    base: BaseEstimate
    hands: Mapping[Side, HandState]
    command: LowCommand | None = None
    grips: Mapping[Side, HandCommand] = field(default_factory=dict[Side, HandCommand])
    twist: Twist = field(default_factory=Twist)


def instant(bus: Bus) -> Instant | None:
    """Return what is newest on `bus`; None before the motors and the base estimate have spoken."""
    state, base = bus.latest(topics.LOW_STATE), bus.latest(topics.BASE)
    if state is None or base is None:
        return None
    hands: dict[Side, HandState] = {s: hand for s in SIDES if (hand := bus.latest(topics.hand_state(s))) is not None}
    grips: dict[Side, HandCommand] = {s: got for s in SIDES if (got := bus.latest(topics.hand_command(s))) is not None}
    legs = bus.latest(topics.LEG_STATUS)
    command = bus.latest(topics.LOW_CMD)
    return Instant(state, base, hands, command, grips, Twist() if legs is None else legs.commanded)


class Vectors:
    """Makes vectors of moments."""

    def __init__(self) -> None:
        self._kinematics = Kinematics()

    def state(self, now: Instant) -> Array:
        """Return the state (85,), see `STATE`; a hand that has not reported is shut and feels nothing."""
        R = now.base.T_odom_base[:3, :3]
        hands = [now.hands.get(side) for side in SIDES]
        gaps = [0.0 if hand is None else hand.gap for hand in hands]
        forces = [np.zeros(2) if hand is None else hand.force for hand in hands]
        palms = self._palms(now.state.q)
        base = ([now.base.height], R.T @ now.base.velocity, R[2])
        return np.concatenate([now.state.q, now.state.dq, palms, gaps, *forces, *base])

    def action(self, now: Instant) -> Array:
        """Return the action (25,), see `ACTION`; what was not commanded yet is what is measured."""
        q = self.targets(now)
        gaps = [grip.gap if (grip := now.grips.get(s)) else h.gap if (h := now.hands.get(s)) else 0.0 for s in SIDES]
        twist, height = now.twist, now.twist.height
        height = 0.0 if height is None or not math.isfinite(height) else height
        return np.concatenate([self._palms(q), gaps, [q[UPPER.start], twist.vx, twist.vy, twist.wz, height]])

    def targets(self, now: Instant) -> Array:
        """Return the joint targets (27,) [rad]; where the gate does not move a motor, its position."""
        if now.command is None:
            return now.state.q
        return np.where(now.command.kp > 0.0, now.command.q, now.state.q)

    def _palms(self, q: Array) -> Array:
        self._kinematics.update(q)
        return np.concatenate([palm_numbers(self._kinematics.pose(f"{side}_gripper")) for side in SIDES])


def palm_numbers(T: Array) -> Array:
    """Return the nine numbers of a (4, 4) pose."""
    return np.concatenate([T[:3, 3], T[:3, 0], T[:3, 1]])


def palm_pose(numbers: Array) -> Array:
    """Return the (4, 4) pose of nine numbers, its rotation made one (Gram and Schmidt).

    Raises ActionRefused: they are not finite, or their two columns are no two directions.
    """
    x, y = numbers[3:6], numbers[6:9]
    if not np.isfinite(numbers).all():
        raise ActionRefused("A palm of the action is not finite.")
    size = float(np.linalg.norm(x))
    x = x / max(size, 1e-9)
    y = y - (y @ x) * x
    width = float(np.linalg.norm(y))
    if size < 0.1 or width < 0.1:
        raise ActionRefused("The rotation of a palm of the action has no two directions.")
    y, T = y / width, np.eye(4)
    T[:3, 0], T[:3, 1], T[:3, 2], T[:3, 3] = x, y, np.cross(x, y), numbers[:3]
    return T


def check_actions(value: object) -> Array:
    """Return a chunk of actions (n, 25), of one at least. Raises ActionRefused: another size, or not finite."""
    try:
        actions = np.atleast_2d(np.asarray(value, np.float64))
    except (TypeError, ValueError) as error:
        raise ActionRefused("The policy's actions are no array of numbers.") from error
    if actions.ndim != 2 or actions.shape[1] != len(ACTION) or not len(actions):
        raise ActionRefused(f"The policy's actions have shape {actions.shape}; this robot's are (n, {len(ACTION)}).")
    if not np.isfinite(actions).all():
        raise ActionRefused("The policy's actions contain NaN or infinity.")
    return actions
