"""Differential inverse kinematics as one small quadratic program per tick (Pinocchio for J, DAQP for the program).

The paper's Eq. (qp), written for the step dq = q_dot dt:

    min_dq  sum_i w_i | J_i(q) dq - alpha_i r_i(q) |^2 + lambda |dq|^2   s.t.   dq_min <= dq <= dq_max

with four tasks: the 6-D poses of the two grasp frames, the posture of the arms, the torso. The box is the
intersection of the velocity limits with what is left to the position limits, so neither can be violated.
"""

from __future__ import annotations

from dataclasses import dataclass

import daqp
import numpy as np
import pinocchio as pin

from golem.capabilities.arms.base import (
    ARM_COLUMNS,
    NUM_UPPER,
    ArmCommand,
    check_dt,
    check_joints,
    check_pose,
)
from golem.capabilities.arms.kinematics import UpperKinematics
from golem.capabilities.arms.postures import posture
from golem.errors import ConfigError
from golem.types import SIDES, UPPER, Array


@dataclass(frozen=True, slots=True)
class DiffIKConfig:
    """Weights, gains and limits of `DiffIK`.

    Attributes:
        rate: ticks per second [Hz].
        latency: declared time to compute a tick [s]; measured 0.1 ms, 0.5 ms at the 99th percentile.
        palm_gain: alpha of the palm tasks, the share of the error one tick removes, in (0, 1].
        position_weight: weight of a palm's position error [1/m^2].
        rotation_weight: weight of a palm's rotation error [1/rad^2]; 0.1 makes 1 mm as dear as 3 mrad.
        posture: name of the posture the redundant joints return to.
        posture_weight: weight of the arms' posture task [1/rad^2].
        torso_weight: weight of the torso's posture task [1/rad^2]: the torso carries the head camera and the other
            arm, so it shall move only where an arm alone does not reach.
        posture_rate: how fast posture and torso return where the palms leave them free [1/s].
        damping: lambda, everywhere.
        error_damping: added to lambda per unit of weighted squared palm error (Levenberg-Marquardt): near a
            singularity or with an unreachable target the steps become small instead of wild.
        arm_speed: velocity limit of the arm joints [rad/s]. The paper's code uses 1.0; a hand that follows a target
            at 0.25 m/s needs up to 1.4 at the far end of the work area (x = 0.54 m), 0.8 within x <= 0.46 m.
        torso_speed: velocity limit of the torso [rad/s], the paper's code's.
        torso_range: the torso's own position limit, both ways [rad].
        limit_margin: distance kept from the position limits [rad].
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
    error_damping: float = 1e-3
    arm_speed: float = 1.5
    torso_speed: float = 0.3
    torso_range: float = 0.5
    limit_margin: float = 0.02
    palm_speed: float = 1.0
    palm_turn: float = 2.0

    def check(self) -> None:
        """Raise ConfigError for a value that is out of range, naming it."""
        for name in (
            "rate",
            "damping",
            "arm_speed",
            "torso_speed",
            "palm_speed",
            "palm_turn",
            "rotation_weight",
        ):
            if not getattr(self, name) > 0.0:
                raise ConfigError(f"The option {name} of the arm controller must be positive.")
        if not 0.0 < self.palm_gain <= 1.0:
            raise ConfigError("The option palm_gain of the arm controller must lie in (0, 1].")


class DiffIK:
    """Weighted-task differential IK for torso and both arms; see `UpperBody` for the contract.

    Attributes:
        rate, latency: see `UpperBody`.
        lower, upper: (15,) position limits it keeps, margin and torso range included [rad].
        speed: (15,) velocity limits it keeps [rad/s].
    """

    def __init__(self, config: DiffIKConfig | None = None) -> None:
        """Build the model.

        Raises:
            ConfigError: an option is out of range, or the posture is unknown.
        """
        c = config or DiffIKConfig()
        c.check()
        self.config = c
        self.rate, self.latency = c.rate, c.latency
        self.kinematics = UpperKinematics()
        self.lower, self.upper, self.speed = joint_box(self.kinematics, c)
        self._posture = np.clip(posture(c.posture), self.lower, self.upper)
        self._root = np.repeat(np.sqrt([c.position_weight, c.rotation_weight]), 3)
        self._soft = np.full(NUM_UPPER, c.posture_weight)
        self._soft[0] = c.torso_weight
        self._no_rows = np.zeros((0, NUM_UPPER))
        self._sense = np.zeros(NUM_UPPER, dtype=np.int32)
        self._q = self._posture.copy()
        self.kinematics.update(self._q)

    def reset(self, q: Array) -> None:
        """Start from the joints `q` (27,) [rad]; see `UpperBody.reset`."""
        self._q = np.clip(check_joints("The posture to start from", q)[UPPER], self.lower, self.upper)
        self.kinematics.update(self._q)

    def step(
        self, targets_left: Array | None, targets_right: Array | None, q_measured: Array, dt: float
    ) -> ArmCommand:
        """Solve the program once and integrate; see `UpperBody.step`."""
        c = self.config
        check_joints("q_measured", q_measured)
        check_dt(dt)
        goals = targets(targets_left, targets_right)
        room = self.speed * dt
        rows: list[Array] = []
        wanted: list[Array] = []
        damping, limited = c.damping, False
        for side, goal in zip(SIDES, goals, strict=True):
            if goal is None:
                room[ARM_COLUMNS[side]] = 0.0
                continue
            to_goal = goal.actInv(self.kinematics.placement(side))
            residual = -pin.log6(to_goal).vector
            jacobian = pin.Jlog6(to_goal) @ self.kinematics.jacobian(side)
            weighted = self._root * residual
            damping += c.error_damping * float(weighted @ weighted)
            share = guard(residual, c.palm_speed * dt, c.palm_turn * dt)
            limited |= share < 1.0
            rows.append(self._root[:, None] * jacobian)
            wanted.append(c.palm_gain * share * weighted)
        if rows:
            pull = self._soft * min(1.0, c.posture_rate * dt) * (self._posture - self._q)
            A = np.concatenate(rows)
            H = A.T @ A
            H[np.diag_indices(NUM_UPPER)] += self._soft + damping
            lower = np.maximum(self.lower - self._q, -room)
            upper = np.minimum(self.upper - self._q, room)
            step, _, flag, _ = daqp.solve(
                H, -(np.concatenate(wanted) @ A + pull), self._no_rows, upper, lower, self._sense
            )
            if flag < 1:
                step, limited = np.zeros(NUM_UPPER), True
            held = (step <= lower + 1e-9) | (step >= upper - 1e-9)
            limited |= bool((held & (room > 0.0)).any())
            self._q = np.clip(self._q + step, self.lower, self.upper)
            self.kinematics.update(self._q)
        position, rotation = errors(self.kinematics, goals)
        return ArmCommand(self._q.copy(), position, rotation, limited)


def joint_box(kinematics: UpperKinematics, config: DiffIKConfig) -> tuple[Array, Array, Array]:
    """Return the (15,) lower and upper position limits [rad] and velocity limits [rad/s] of `config`."""
    lower = kinematics.lower + config.limit_margin
    upper = kinematics.upper - config.limit_margin
    lower[0] = max(lower[0], -config.torso_range)
    upper[0] = min(upper[0], config.torso_range)
    speed = np.full(NUM_UPPER, config.arm_speed)
    speed[0] = config.torso_speed
    return lower, upper, speed


def targets(left: Array | None, right: Array | None) -> tuple[pin.SE3 | None, pin.SE3 | None]:
    """Return the two palm targets as SE(3) elements.

    Raises:
        TargetError: one of them is not a finite rigid transform.
    """
    return (
        None if left is None else pin.SE3(check_pose("The target of the left hand", left)),
        None if right is None else pin.SE3(check_pose("The target of the right hand", right)),
    )


def guard(residual: Array, reach: float, turn: float) -> float:
    """Return the share of a (6,) pose `residual` one tick may ask for: at most `reach` [m] and `turn` [rad]."""
    distance = float(np.sqrt(residual[:3] @ residual[:3]))
    angle = float(np.sqrt(residual[3:] @ residual[3:]))
    return min(1.0, reach / max(distance, reach), turn / max(angle, turn))


def errors(kinematics: UpperKinematics, goals: tuple[pin.SE3 | None, pin.SE3 | None]) -> tuple[Array, Array]:
    """Return the (2,) distances [m] and (2,) angles [rad] of the grasp frames from `goals`; 0 without a goal."""
    position, rotation = np.zeros(2), np.zeros(2)
    for i, (side, goal) in enumerate(zip(SIDES, goals, strict=True)):
        if goal is not None:
            here = kinematics.placement(side)
            gap = goal.translation - here.translation
            position[i] = np.sqrt(gap @ gap)
            turn = pin.log3(here.rotation.T @ goal.rotation)
            rotation[i] = np.sqrt(turn @ turn)
    return position, rotation
