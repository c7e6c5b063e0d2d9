"""What a hand presses or pulls with, from the torques that its motors report."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.base import ARM_COLUMNS, GRIPPER_FRAME
from golem.robots.model import pinocchio_model
from golem.robots.model.table import DOF, JOINT_NAMES
from golem.types import UPPER, Array, LowState, Side

TORQUE = 0.5
"""Standard deviation of what a motor's torque is off by: friction, masses, encoder zeros [N m] [own]."""
WRENCH: Array = np.repeat([30.0, 0.6], 3)
"""Standard deviations of force and moment that a hand meets [N, N m] [own]: fingers touch things 2 cm from its grasp
frame. Without them an arm that can hardly resist some moment has the errors of its torques taken for a large one, and
for the force that goes with it."""


class HandForce:
    """Estimates the force at a grasp frame of an arm that moves slowly.

    What the motors do beyond carrying the arm is done at the hand: tau - g(q) = J(q)^T F, the most likely F for
    independent normal errors of `TORQUE` and a wrench of `WRENCH`. Errors of the masses, friction and what is held
    remain in it; the difference to a moment before has them cancelled.
    """

    def __init__(self) -> None:
        self._arm = UpperKinematics()

    def __call__(self, side: Side, q: Array, tau: Array) -> Array:
        """Return the (3,) force of a hand on its surroundings, in base_link [N], by (15,) `q` [rad] and `tau` [N m]."""
        return np.asarray(self._arm.placement(side).rotation @ self.wrench(side, q, tau)[:3], dtype=np.float64)

    def covariance(self, side: Side, q: Array) -> Array:
        """Return the (6, 6) covariance of `wrench`, in its frame, by the two standard deviations above."""
        self._arm.update(q)
        J = self._arm.jacobian(side)[:, ARM_COLUMNS[side]]
        return np.asarray(TORQUE**2 * np.linalg.inv(J @ J.T + np.diag((TORQUE / WRENCH) ** 2)), dtype=np.float64)

    def wrench(self, side: Side, q: Array, tau: Array) -> Array:
        """Return the (6,) force [N] and moment [N m] of a hand on what it touches, in its grasp frame."""
        arm, columns = self._arm, ARM_COLUMNS[side]
        rest = tau - pin.computeGeneralizedGravity(arm.model, arm.data, q)
        arm.update(q)
        return _likely(arm.jacobian(side)[:, columns], rest[columns])


def _likely(J: Array, rest: Array) -> Array:
    """Return the most likely (6,) wrench behind `rest` (7,), what an arm's motors do beyond its dynamics."""
    return np.asarray(np.linalg.solve(J @ J.T + np.diag((TORQUE / WRENCH) ** 2), J @ rest), dtype=np.float64)


MOMENTUM, QUICK, SLOW = 0.012, 0.006, 0.6
"""Time constants of the arm's momentum, of what is felt now, and of what was there before [s] [own]."""
HELD = 4.0
"""Time constant with which what stays becomes what was there before: a load, or stiffness after a start [s] [own]."""
TOUCH, LEFT = 3.5, 2.0
"""Change of the force from which on something touches a hand, and below which nothing does any more [N] [own]."""
MOTION, TURN = 12.0, 12.0
"""How much more it takes by the speed of the arm's fastest joint, whose friction turns round with it, and by the
torso's rate [N s/rad] [own: no event in 198 s of walking arms, without TURN 2]."""
FADE = 0.2
"""Time constant with which that fades: friction turns round when a joint is slow [s] [own]."""


class ContactSense:
    """Tells when something touches a hand: when its force changes by more than motion and noise explain.

    The force is that of the observer of generalised momentum (De Luca, Albu-Schaeffer, Haddadin, Hirzinger, IROS 2006,
    eq. 12), r = F(s) (tau - M(q) a - C(q, v) v - g(q)) with one low pass F(s) for all that is measured: of a
    low-passed speed the rate is known without differentiating. The arm hangs on the torso, whose IMU says how that is
    accelerated and turned, gravity included. A blow is felt before a motor gives way. Dry friction that a push does
    not overcome hides it: a joint that sticks tells its motor nothing. Where it is `touching`, `change` (6,) is the
    wrench of the hand on the world since before the touch, in its grasp frame [N, N m].
    """

    def __init__(self, side: Side) -> None:
        self._columns = np.arange(UPPER.start, UPPER.stop)[ARM_COLUMNS[side]]
        full = pinocchio_model.build(hands=True, free_base=True)
        arm = {JOINT_NAMES[i] for i in self._columns}
        locked = [full.getJointId(name) for name in JOINT_NAMES if name not in arm]
        self._model = pin.buildReducedModel(full, locked, pin.neutral(full))
        self._model.armature = np.r_[np.zeros(6), np.full(7, DOF.armature)]
        self._model.gravity.linear = np.zeros(3)  # the accelerometer's is there
        self._data, self._q = self._model.createData(), pin.neutral(self._model)
        self._frame = self._model.getFrameId(GRIPPER_FRAME[side])
        pin.framesForwardKinematics(self._model, self._data, self._q)
        self._imu = self._data.oMf[self._model.getFrameId("imu_link")].translation.copy()
        self._smooth: Array | None = None
        self._quick, self._slow, self._t, self._margin = np.zeros(6), np.zeros(6), 0.0, 0.0
        self.touching, self.change = False, np.zeros(6)

    def step(self, state: LowState) -> bool:
        """Feel what motors and IMU report; return whether `touching` changed."""
        dt, self._t = state.t - self._t, state.t
        tau, dq = state.tau[self._columns], state.dq[self._columns]
        now = np.concatenate([state.imu.gyro, dq, tau, state.imu.acc])
        begins = self._smooth is None or not 0.0 < dt < SLOW
        before = now if self._smooth is None or begins else self._smooth
        rate = (now - before) / max(MOMENTUM, dt)
        self._smooth = before + dt * rate
        wrench = self._wrench(state.q[self._columns], self._smooth, rate)
        if begins:
            self._quick = self._slow = wrench
            return False
        self._quick = self._quick + min(1.0, dt / QUICK) * (wrench - self._quick)
        self.change = self._quick - self._slow
        force, touched = float(np.linalg.norm(self.change[:3])), self.touching
        moving = MOTION * np.abs(self._smooth[3:10]).max() + TURN * np.linalg.norm(self._smooth[:3])
        self._margin = max(float(moving), self._margin * (1.0 - min(1.0, dt / FADE)))
        self.touching = force > (LEFT if touched else TOUCH) + self._margin
        self._slow = self._slow + min(1.0, dt / (HELD if self.touching else SLOW)) * (self._quick - self._slow)
        return self.touching != touched

    def _wrench(self, q: Array, smooth: Array, rate: Array) -> Array:
        """Return the (6,) wrench of the hand by (20,) what is measured and its rate: gyro, dq, tau, acc."""
        turning, dq, turned = smooth[:3], smooth[3:10], rate[:3]
        self._q[7:] = q
        lever = np.cross(turned, self._imu) + np.cross(turning, np.cross(turning, self._imu))
        speed = np.concatenate([np.zeros(3), smooth[:10]])
        faster = np.concatenate([smooth[17:] - lever, rate[:10]])
        moving = pin.rnea(self._model, self._data, self._q, speed, faster)[6:]
        pin.computeJointJacobians(self._model, self._data, self._q)
        pin.updateFramePlacement(self._model, self._data, self._frame)
        J = pin.getFrameJacobian(self._model, self._data, self._frame, pin.ReferenceFrame.LOCAL)[:, 6:]
        return _likely(J, smooth[10:17] - DOF.damping * dq - moving)
