"""The whole robot on a floor, stepped at 2 ms, with an emulated base estimate: what legs are tried on."""

from __future__ import annotations

import mujoco
import numpy as np

from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.legs.hold import STANCES
from golem.hardware.safety.base import SafetyLimits
from golem.hardware.servo.gains import default_gains
from golem.interfaces.payloads import LegCommand
from golem.robots.model.mjcf import robot_spec
from golem.robots.model.spatial import quat_of
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS, NUM_JOINTS, SIDES, UPPER, Array, BaseEstimate, Imu, LowState

STEP = 0.002


class Floor:
    """27 joints and hands; the arms are held by the servo's gains, the legs by what the controller says."""

    def __init__(self, seed: int = 0, stance: str = "crouch", velocity_noise: float = 0.02) -> None:
        """Stand in `stance`; the estimated velocity wanders with `velocity_noise` [m/s] rms."""
        spec = robot_spec(hands=True)
        feet = {f"{side}_ankle_roll_link" for side in SIDES}
        for geom in list(spec.geoms):
            if geom.parent.name not in feet or geom.type != mujoco.mjtGeom.mjGEOM_SPHERE:
                spec.delete(geom)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], contype=1, conaffinity=1)
        spec.option.timestep = STEP
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._pelvis, self._torso = (self.model.body(name).id for name in ("pelvis", "torso_link"))
        self._feet = [self.model.body(f"{side}_ankle_roll_link").id for side in SIDES]
        self._qpos = np.array([self.model.joint(name).qposadr[0] for name in JOINT_NAMES])
        self._qvel = np.array([self.model.joint(name).dofadr[0] for name in JOINT_NAMES])
        self._torque = SafetyLimits.from_profile().torque_command
        self._random, self._wander, self._noise = np.random.default_rng(seed), np.zeros(3), velocity_noise
        gains = default_gains()
        self._kp, self._kd = gains.kp, gains.kd
        self.q = np.zeros(NUM_JOINTS)
        self.q[LEGS] = np.tile(STANCES[stance], 2)
        self.q[UPPER] = POSTURES["home"]
        self.place()

    def place(self) -> None:
        """Start over: upright at the joints `q`, the soles on the floor."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self._qpos] = self.q
        mujoco.mj_kinematics(self.model, self.data)
        soles = self.data.geom_xpos[self.model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE, 2]
        self.data.qpos[2] -= soles.min() - 0.01
        mujoco.mj_forward(self.model, self.data)

    @property
    def fallen(self) -> bool:
        """Whether the pelvis has sunk or tilted too far to come back."""
        return self.data.qpos[2] < 0.6 or self.data.xmat[self._pelvis, 8] < 0.7

    def pace(self) -> Array:
        """Return (3,) velocity of the pelvis in its heading frame: vx, vy [m/s], wz [rad/s]."""
        R, v = self.data.xmat[self._pelvis], self.data.qvel
        length = float(np.hypot(R[0], R[3])) or 1.0
        c, s = R[0] / length, R[3] / length
        return np.array([c * v[0] + s * v[1], c * v[1] - s * v[0], R[6:9] @ v[3:6]])

    def lean(self) -> float:
        """Return the tilt of the pelvis [rad]."""
        return float(np.arccos(np.clip(self.data.xmat[self._pelvis, 8], -1.0, 1.0)))

    def soles(self) -> Array:
        """Return (2,) height of the ankle_roll links [m]."""
        return self.data.xpos[self._feet, 2]

    def sense(self) -> tuple[LowState, BaseEstimate]:
        """Return what the robot reports and what an estimator makes of it."""
        data = self.data
        q, dq = data.qpos[self._qpos].copy(), data.qvel[self._qvel].copy()
        R_base, R_torso = (data.xmat[body].reshape(3, 3) for body in (self._pelvis, self._torso))
        rate = R_torso.T @ R_base @ data.qvel[3:6] + np.array([0.0, 0.0, dq[UPPER.start]])
        imu = Imu(quat_of(R_torso), rate + self._random.normal(0.0, 0.01, 3), np.zeros(3))
        # A first-order wander of 0.05 s at 50 samples per second.
        self._wander = 0.67 * self._wander + self._random.normal(0.0, 0.74 * self._noise, 3)
        T = np.eye(4)
        T[:3, :3] = R_base
        T[:3, 3] = data.qpos[:3]
        base = BaseEstimate(data.time, T, data.qvel[:3] + self._wander, float(data.qpos[2]), np.ones(2))
        return LowState(data.time, q, dq, data.ctrl[:NUM_JOINTS].copy(), imu), base

    def advance(self, command: LegCommand, force: Array | None = None) -> None:
        """Let one physics step pass under the leg `command` and a `force` (3,) on the pelvis [N]."""
        data = self.data
        q, dq = data.qpos[self._qpos], data.qvel[self._qvel]
        kp, kd, goal = self._kp.copy(), self._kd.copy(), self.q.copy()
        kp[LEGS], kd[LEGS], goal[LEGS] = command.kp, command.kd, command.q
        tau = kp * (goal - q) - kd * dq
        tau[UPPER] += data.qfrc_bias[self._qvel[UPPER]]
        if command.tau is not None:
            tau[LEGS] += command.tau
        data.ctrl[:NUM_JOINTS] = np.clip(tau, -self._torque, self._torque)
        data.xfrc_applied[self._pelvis, :3] = 0.0 if force is None else force
        mujoco.mj_step(self.model, data)
