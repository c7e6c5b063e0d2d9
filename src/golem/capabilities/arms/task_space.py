"""What differential IK controllers share: weights, limits, checks, and the integration of the command state."""

from __future__ import annotations

import functools
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.base import ARM_COLUMNS, NUM_UPPER, check_dt, check_joints, check_pose
from golem.capabilities.arms.postures import posture
from golem.errors import ConfigError
from golem.interfaces.payloads import ArmCommand
from golem.robots.model.table import JOINT_NAMES
from golem.types import SIDES, UPPER, Array, Side

if TYPE_CHECKING:
    from golem.capabilities.collision.collision_model import CollisionModel, NearPairs


@dataclass(frozen=True, slots=True)
class TaskSpaceConfig:
    """Weights, gains and limits of a differential IK controller.

    Attributes:
        rate: ticks per second [Hz].
        latency: declared time to compute a tick [s]; a tick of `diff_ik` takes about 0.1 ms.
        palm_gain: alpha of the palm tasks, the share of the error one tick removes, in (0, 1].
        position_weight: weight of a palm's position error [1/m^2].
        rotation_weight: weight of a palm's rotation error [1/rad^2]; 0.1 makes 1 mm as dear as 3 mrad.
        posture: name of the posture the redundant joints return to.
        posture_weight: weight of the arms' posture task [1/rad^2].
        torso_weight: weight of the torso's posture task [1/rad^2]: the torso carries the head camera and the
            other arm, so it shall move only where an arm alone does not reach.
        posture_rate: how fast posture and torso return where the palms leave them free [1/s].
        damping: lambda, everywhere.
        error_damping: added to lambda per unit of weighted palm error that the previous tick left over. A
            target that cannot be reached leaves an error e, and a Gauss-Newton step along a direction the hand can
            hardly move in overshoots unless lambda exceeds e times half the arm's curvature, about 0.15 here;
            while targets are tracked nothing is left over and nothing is damped.
        arm_speed: velocity limit of the arm joints [rad/s]. The paper's code uses 1.0; a hand that moves at
            0.25 m/s needs up to 1.4 at the far end of the work area (x = 0.54 m), 0.8 within x <= 0.46 m.
        torso_speed: velocity limit of the torso [rad/s], the paper's code's.
        torso_range: the torso's own position limit, both ways [rad].
        singular_value: smallest singular value of an arm's Jacobian below which its steps are damped, as `comfort` has
            it: 0.12 is a well-placed arm.
        singular_damping: added to lambda where that value is zero.
        limit_margin: distance kept from the range that the safety gate allows [rad].
        collision_rows: nearest pairs of links that may not come nearer than `clearance`; 0 looks at none.
        clearance: distance between the conservative spheres of two links that is kept [m]; links that are nearer do
            not come nearer still.
        collision_gain: share of the distance above `clearance` that one tick may use up, in (0, 1].
        palm_speed: a target further away is approached at this speed [m/s].
        palm_turn: a target turned further away is approached at this rate [rad/s].
    """

    rate: float = 100.0
    latency: float = 0.0005
    palm_gain: float = 1.0
    position_weight: float = 1.0
    rotation_weight: float = 0.1
    posture: str = "ready"
    posture_weight: float = 1e-4
    torso_weight: float = 1e-3
    posture_rate: float = 1.0
    damping: float = 1e-6
    error_damping: float = 0.15
    arm_speed: float = 1.5
    torso_speed: float = 0.3
    torso_range: float = 0.5
    singular_value: float = 0.03
    singular_damping: float = 1e-3
    limit_margin: float = 0.002
    collision_rows: int = 6
    clearance: float = 0.002
    collision_gain: float = 0.2
    palm_speed: float = 1.0
    palm_turn: float = 2.0

    def __post_init__(self) -> None:
        """Refuse values that have no meaning.

        Raises:
            ConfigError: a value is out of range; the message names it.
        """
        positive = (
            "rate", "position_weight", "rotation_weight", "damping", "arm_speed", "torso_speed", "torso_range",
            "palm_speed", "palm_turn",
        )  # fmt: skip
        for name in positive:
            if not getattr(self, name) > 0.0:
                raise ConfigError(
                    f"The arm controller's option {name} must be positive, not {getattr(self, name)}."
                )
        for name in (
            "latency",
            "posture_weight",
            "torso_weight",
            "posture_rate",
            "error_damping",
            "singular_value",
            "singular_damping",
            "limit_margin",
            "collision_rows",
            "clearance",
        ):
            if not getattr(self, name) >= 0.0:
                raise ConfigError(f"The arm controller's option {name} must not be negative.")
        for name in ("palm_gain", "collision_gain"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise ConfigError(
                    f"The arm controller's option {name} must lie in (0, 1], not {getattr(self, name)}."
                )


@dataclass(frozen=True, slots=True)
class Reach:
    """One palm task of one tick; a goal out of a tick's reach is replaced by the point on the way that is not.

    Attributes:
        side: which hand.
        to_frame: the grasp frame as seen from its goal.
        residual: (6,) twist that leads from the grasp frame to its goal within one unit of time, in the axes of
            the grasp frame, linear [m] above angular [rad].
    """

    side: Side
    to_frame: pin.SE3
    residual: Array


@dataclass(frozen=True, slots=True)
class ArmReport:
    """How well the arms stand.

    Attributes:
        margin: (2,) distance of the left and right arm's joints from the range that the gate allows [rad].
        manipulability: (2,) smallest singular value of each arm's Jacobian [m and rad mixed].
        clearance: distance of the nearest two links [m], infinite where none is near or none is looked at.
    """

    margin: Array
    manipulability: Array
    clearance: float


class TaskSpaceController(ABC):
    """Integrates the joint steps that a subclass solves for; see `UpperBody` for the contract.

    Attributes:
        rate, latency: see `UpperBody`.
        config: the options.
        kinematics: the model, always updated at the command state.
        lower, upper: (15,) position limits it keeps, margin and torso range included [rad]; a waist that starts outside
            that range comes back to it; so does an arm once it has a target.
        speed: (15,) velocity limits it keeps [rad/s].
        rest: (15,) the posture the redundant joints return to [rad].
        q: (15,) the command state [rad].
    """

    def __init__(self, config: TaskSpaceConfig | None = None) -> None:
        """Build the model.

        Raises:
            ConfigError: the posture is unknown.
        """
        self.config = c = config or TaskSpaceConfig()
        self.rate, self.latency = c.rate, c.latency
        self.kinematics = UpperKinematics()
        self.lower: Array = self.kinematics.lower + c.limit_margin
        self.upper: Array = self.kinematics.upper - c.limit_margin
        self._widest = self.kinematics.stops
        self.lower[0] = max(self.lower[0], -c.torso_range)
        self.upper[0] = min(self.upper[0], c.torso_range)
        self.speed: Array = np.full(NUM_UPPER, c.arm_speed)
        self.speed[0] = c.torso_speed
        self.rest: Array = np.clip(posture(c.posture), self.lower, self.upper)
        self.soft: Array = np.full(NUM_UPPER, c.posture_weight)
        self.soft[0] = c.torso_weight
        self._left_over, self._singular, self._ticks = 0.0, 0.0, 0
        self._near: NearPairs | None = None
        # Here, not at the first tick: the kernel may have to be compiled.
        self._spheres = _spheres() if c.collision_rows else None
        self._move(self.rest)

    @abstractmethod
    def solve(
        self, reaches: Sequence[Reach], lower: Array, upper: Array, damping: float, dt: float
    ) -> Array | None:
        """Return the joint step (15,) that serves `reaches` best [rad], or None if the solver finds none.

        Args:
            reaches: one or two palm tasks.
            lower: (15,) smallest step that position and velocity limits allow [rad].
            upper: (15,) largest step that they allow [rad].
            damping: lambda of this tick.
            dt: length of the tick [s].
        """

    def report(self) -> ArmReport:
        """Return how well the arms stand at the command state."""
        k = self.kinematics
        room = np.minimum(self.q - k.lower, k.upper - self.q)
        return ArmReport(
            np.array([room[ARM_COLUMNS[side]].min() for side in SIDES]),
            np.array([k.singular_value(side) for side in SIDES]),
            float(self._near.distance[0]) if self._near is not None and len(self._near.distance) else np.inf,
        )

    def collision_bounds(self) -> tuple[Array, Array]:
        """Return rows (k, 15) and bounds (k,): a step dq keeps clear of collisions where rows @ dq >= bounds."""
        c, near = self.config, self._near
        if near is None:
            return _NO_ROWS, _NO_BOUNDS
        return near.gradient, -c.collision_gain * np.maximum(near.distance - c.clearance, 0.0)

    def reset(self, q: Array) -> None:
        """Start from the joints `q` (27,) [rad]; see `UpperBody.reset`."""
        self._left_over, self._singular, self._ticks = 0.0, 0.0, 0
        # Not into the range of the waist: a robot that was turned further while it was limp would swing back at once.
        self._move(np.clip(check_joints("The posture to start from", q)[UPPER], *self._widest))

    def step(
        self, targets_left: Array | None, targets_right: Array | None, q_measured: Array, dt: float
    ) -> ArmCommand:
        """Solve once and integrate; see `UpperBody.step`."""
        c = self.config
        check_joints("q_measured", q_measured)
        check_dt(dt)
        goals = (
            None
            if targets_left is None
            else pin.SE3(check_pose("The target of the left hand", targets_left)),
            None
            if targets_right is None
            else pin.SE3(check_pose("The target of the right hand", targets_right)),
        )
        room = self.speed * dt
        reaches: list[Reach] = []
        damping, limited = c.damping + c.error_damping * self._left_over, False
        for side, goal in zip(SIDES, goals, strict=True):
            if goal is None:
                room[ARM_COLUMNS[side]] = 0.0
                continue
            to_frame = goal.actInv(self.kinematics.placement(side))
            residual = -pin.log6(to_frame).vector
            distance, angle = _norm(residual[:3]), _norm(residual[3:])
            reach, turn = c.palm_speed * dt, c.palm_turn * dt
            share = min(reach / max(distance, reach), turn / max(angle, turn))
            if share < 1.0:
                limited = True
                residual = share * residual
                to_frame = pin.exp6(-residual)
            reaches.append(Reach(side, to_frame, residual))
        if self._ticks % SINGULAR_TICKS == 0:
            self._singular = sum(self._singular_damping(reach.side) for reach in reaches)
        self._ticks += 1
        damping += self._singular
        if reaches:
            # A joint that starts outside its range comes back at its speed, and the others make up for it.
            minimum, maximum = np.minimum, np.maximum  # np.clip takes three times as long
            lower = minimum(maximum(self.lower - self.q, -room), room)
            upper = minimum(maximum(self.upper - self.q, -room), room)
            step = self.solve(reaches, lower, upper, damping, dt)
            if step is None:
                limited, step = True, np.zeros(NUM_UPPER)
            else:
                held = (step <= lower + 1e-9) | (step >= upper - 1e-9)
                limited |= bool((held & (room > 0.0)).any())
            q = self.q + minimum(maximum(step, lower), upper)
            self._move(minimum(maximum(q, minimum(self.lower, self.q)), maximum(self.upper, self.q)))
        position, rotation = self._errors(goals)
        self._left_over = float(
            np.sqrt(c.position_weight * (position @ position) + c.rotation_weight * (rotation @ rotation))
        )
        return ArmCommand(self.q.copy(), position, rotation, limited)

    def _singular_damping(self, side: Side) -> float:
        c = self.config
        if c.singular_value == 0.0:
            return 0.0
        lost = 1.0 - self.kinematics.singular_value(side) / c.singular_value
        return c.singular_damping * max(0.0, lost) ** 2

    def _move(self, q: Array) -> None:
        self.q: Array = q.copy()
        self.kinematics.update(self.q)
        if self._spheres is not None:
            self._near = self._spheres.nearest(self.q, self.config.collision_rows, NEAR)

    def _errors(self, goals: tuple[pin.SE3 | None, pin.SE3 | None]) -> tuple[Array, Array]:
        position, rotation = np.zeros(2), np.zeros(2)
        for i, (side, goal) in enumerate(zip(SIDES, goals, strict=True)):
            if goal is not None:
                here = self.kinematics.placement(side)
                position[i] = _norm(goal.translation - here.translation)
                rotation[i] = _norm(pin.log3(here.rotation.T @ goal.rotation))
        return position, rotation


SINGULAR_TICKS = 5
"""Every how many ticks the distance from singularities is looked at: it takes a fifth of a tick, and changes slowly."""
NEAR = 0.10
"""Pairs of links farther apart than this need no row [m]: no step of a tick closes it."""
_NO_ROWS = np.zeros((0, NUM_UPPER))
_NO_BOUNDS = np.zeros(0)


def _norm(v: Array) -> float:
    return float(np.sqrt(v @ v))


@functools.cache
def _spheres() -> CollisionModel:
    # Numba takes a second to import, and arms without collision rows do without it.
    from golem.capabilities.collision.collision_model import CollisionModel
    from golem.capabilities.collision.sphere_robot import shipped_spheres

    return CollisionModel(shipped_spheres(), JOINT_NAMES[UPPER])
