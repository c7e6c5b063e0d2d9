"""What differential IK controllers share: weights, limits, checks, and the integration of the command state."""

from __future__ import annotations

import functools
from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass

import numpy as np

from golem.capabilities.arms import task_kernel
from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.base import NUM_UPPER, check_dt, check_joints, check_pose
from golem.capabilities.arms.ik_kernel import rigid
from golem.capabilities.arms.postures import posture
from golem.capabilities.collision.collision_model import CollisionModel
from golem.capabilities.collision.sphere_robot import shipped_spheres
from golem.errors import ConfigError
from golem.interfaces.payloads import ArmCommand
from golem.robots.model.table import JOINT_NAMES
from golem.types import SIDES, UPPER, Array


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
        for name in _POSITIVE:
            if not getattr(self, name) > 0.0:
                raise ConfigError(f"The arm controller's option {name} must be positive, not {getattr(self, name)}.")
        for name in ("palm_gain", "collision_gain"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise ConfigError(f"The arm controller's option {name} must lie in (0, 1], not {getattr(self, name)}.")
        for name, value in asdict(self).items():
            if name != "posture" and not value >= 0.0:
                raise ConfigError(f"The arm controller's option {name} must not be negative.")


_POSITIVE = (
    *("rate", "position_weight", "rotation_weight", "damping", "arm_speed", "torso_speed", "torso_range"),
    *("palm_speed", "palm_turn"),
)
"""Options that are more than 0; the others, all but the posture, are at least that."""


class TaskSpaceController(ABC):
    """Integrates the joint steps that a subclass solves for; see `UpperBody` and `HasWaist` for the contracts.

    Attributes:
        task: its memory, which a subclass reads; see `task_kernel.IkMemory`.
        lower, upper: (15,) position limits it keeps, margin and torso range included [rad]; a waist that starts outside
            that range comes back to it; so does an arm once it has a target.
        speed: (15,) velocity limits it keeps [rad/s].
        rest: (15,) the posture the redundant joints return to [rad].
        q: (15,) the command state [rad].
    """

    def __init__(self, config: TaskSpaceConfig | None = None) -> None:
        """Build the model. Raises ConfigError: the posture is unknown."""
        self.config = c = config or TaskSpaceConfig()
        self.rate, self.latency = c.rate, c.latency
        self._kinematics = k = UpperKinematics()
        self.lower: Array = k.lower + c.limit_margin
        self.upper: Array = k.upper - c.limit_margin
        self.lower[0] = max(self.lower[0], -c.torso_range)
        self.upper[0] = min(self.upper[0], c.torso_range)
        self.speed: Array = np.full(NUM_UPPER, c.arm_speed)
        self.speed[0] = c.torso_speed
        self.rest: Array = np.clip(posture(c.posture), self.lower, self.upper)
        self.soft: Array = np.full(NUM_UPPER, c.posture_weight)
        self.soft[0] = c.torso_weight
        self._ticks = 0
        options = np.zeros(task_kernel.OPTIONS)
        options[:] = (
            c.position_weight, c.rotation_weight, c.palm_gain, c.posture_rate, c.damping, c.error_damping,
            c.palm_speed, c.palm_turn, c.singular_value, c.clearance, c.collision_gain, NEAR,
        )  # fmt: skip
        n, m, arms = NUM_UPPER, c.collision_rows, [k.exponentials(side) for side in SIDES]
        axes, points, grip = (np.array(part) for part in zip(*arms, strict=True))
        spheres = _spheres() if m else None
        self.task = task_kernel.IkMemory(
            options, axes, points, grip,
            self.lower, self.upper, self.speed, self.rest, self.soft, np.zeros(n),
            np.zeros(2, np.int64), np.zeros((2, 4, 4)), np.zeros((2, 3, 3)), np.zeros((2, 3)), np.zeros((2, 8, 2, 3)),
            np.zeros((2, 6)), np.zeros((2, 6, 8)), np.zeros(n), np.zeros((n, n)), np.zeros(n),
            np.zeros(n + m), np.full(n + m, task_kernel.FAR), np.zeros((2, 2)), np.zeros(task_kernel.STATES),
            np.zeros(0, np.int32) if spheres is None else spheres.ints,
            np.zeros(0) if spheres is None else spheres.floats,
            np.zeros(0, np.int64) if spheres is None else spheres.sphere_body,
            np.zeros(m), np.zeros((m, n)), np.zeros((m, 2), np.int64),
        )  # fmt: skip
        self._diagonal = self.task.H.reshape(-1)[:: n + 1]
        self._move(self.rest)

    @abstractmethod
    def solve(self, dt: float) -> Array | None:
        """Return the joint step (15,) that serves the `wanted` palms of `task` best [rad]; None if none is found.

        The program of a tick of `dt` [s] stands in `task`: `residual`, `below`, `above`, `state[LAMBDA]`, H and f.
        """

    @property
    def kinematics(self) -> UpperKinematics:
        """The model, updated at the command state."""
        self._kinematics.update(self.q)
        return self._kinematics

    def reset(self, q: Array) -> None:
        self._ticks = 0
        self.task.state[[task_kernel.LEFT_OVER, task_kernel.SINGULAR]] = 0.0
        # Not into the range of the waist: a robot that was turned further while it was limp would swing back at once.
        self._move(np.clip(check_joints("The posture to start from", q)[UPPER], *self._kinematics.stops))

    def turn_waist(self, angle: float | None) -> None:
        wanted = posture(self.config.posture)[0] if angle is None else angle
        self.rest[0] = np.clip(wanted, self.lower[0], self.upper[0])

    def step(self, targets_left: Array | None, targets_right: Array | None, q_measured: Array, dt: float) -> ArmCommand:
        task = self.task
        check_joints("q_measured", q_measured)
        check_dt(dt)
        for i, target in enumerate((targets_left, targets_right)):
            task.wanted[i] = target is not None
            if target is not None:
                fits = np.shape(target) == (4, 4)
                if fits:
                    task.goal[i] = target
                if not fits or not rigid(task.goal[i]):
                    check_pose(f"The target of the {SIDES[i]} hand", target)
        look = self._ticks % SINGULAR_TICKS == 0
        self._ticks += 1
        near = task_kernel.begin(task, dt, look)
        if near:
            self._damp([i for i in range(2) if near & 1 + i])
        wanted = targets_left is not None or targets_right is not None
        step = self.solve(dt) if wanted else None
        task_kernel.finish(task, _NO_STEP if step is None else step)
        if wanted:
            self.q = task.q.copy()
        limited = bool(task.state[task_kernel.LIMITED])
        return ArmCommand(task.q.copy(), task.error[0].copy(), task.error[1].copy(), limited)

    def _damp(self, sides: list[int]) -> None:
        c, added = self.config, 0.0
        for i in sides:
            J = self.task.J[i, :, 1:]
            value = float(np.sqrt(max(np.linalg.eigvalsh(J @ J.T)[0], 0.0)))
            added += c.singular_damping * max(0.0, 1.0 - value / c.singular_value) ** 2
        self.task.state[task_kernel.SINGULAR] = added
        self.task.state[task_kernel.LAMBDA] += added
        self._diagonal += added

    def _move(self, q: Array) -> None:
        self.q: Array = q.copy()
        self.task.q[:] = q
        task_kernel.place(self.task)


SINGULAR_TICKS = 5
"""Every how many ticks the distance from singularities is looked at: it takes a fifth of a tick, and changes slowly."""
NEAR = 0.10
"""Pairs of links farther apart than this need no row [m]: no step of a tick closes it."""
_NO_STEP = np.zeros(0)


@functools.cache
def _spheres() -> CollisionModel:
    return CollisionModel(shipped_spheres(), JOINT_NAMES[UPPER])
