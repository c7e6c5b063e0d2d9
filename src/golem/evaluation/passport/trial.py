"""A policy walks on a plain floor for a few seconds: whether it stays up, and whether it goes where it is told."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.legs.description import Description
from golem.capabilities.legs.hold import STANCES
from golem.capabilities.legs.locomotion import Locomotion, LocomotionConfig
from golem.capabilities.legs.network import Network
from golem.capabilities.legs.policy import BadAction, Policy
from golem.errors import ConfigError
from golem.hardware.safety.base import SafetyLimits
from golem.hardware.servo.gains import default_gains
from golem.interfaces.payloads import LegCommand
from golem.robots.model.mjcf import robot_spec
from golem.robots.model.spatial import quat_of
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS, NUM_JOINTS, SIDES, UPPER, Array, BaseEstimate, Imu, LowState, Twist

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


STAND, WALK = 1.0, 2.0
"""How long it stands first, and how long it walks along each axis [s]."""
TWISTS = (Twist(0.4), Twist(0.0, 0.25), Twist(0.0, 0.0, 0.4))
"""What it is told, in turn, as far as its envelope goes [m/s], [rad/s]."""
SETTLE = 0.8
"""Time after a new twist that does not count [s]."""
SOUND = 1.72
"""Score from which a policy is sound [own: sound policies reach 1.78 to 1.85]."""


@dataclass(frozen=True, slots=True)
class Trial:
    """What came of it.

    Attributes:
        lasted: share of the time until it fell; 1 if it did not.
        told: (n, 3) the twists it was told, standing first.
        went: (n, 3) mean velocity in the heading frame under each; NaN where it fell before.
        jerk: mean change of the leg targets from tick to tick [rad].
        tilt: root mean square of the tilt [rad].
        steps: share of the time at which the foot that the gait clock lifts is the higher one.
    """

    lasted: float
    told: Array
    went: Array
    jerk: float
    tilt: float
    steps: float

    @property
    def fell(self) -> float:
        """When it fell, or the end [s]."""
        return self.lasted * (STAND + WALK * (len(self.told) - 1))

    @property
    def worst(self) -> Twist | None:
        """The twist that it went furthest off; the first where it fell, None where it was told none."""
        if len(self.told) == 1:
            return None
        off = np.abs(self.went - self.told)[1:].max(axis=1)
        return Twist(*self.told[1 + (0 if self.lasted < 1.0 else int(off.argmax()))].tolist())

    @property
    def score(self) -> float:
        """How well it walks: up to 1 for not falling, up to 1 for going where it is told, less what shakes it."""
        if self.lasted < 1.0:
            return self.lasted
        off = np.abs(self.went - self.told) / np.array([0.4, 0.25, 0.4])
        shaken = min(self.jerk, 0.2) + min(self.tilt, 0.5) + 0.3 * (1.0 - self.steps)
        return 2.0 - float(np.minimum(off, 1.0).mean()) - shaken


def walk(floor: Floor, description: Description, network: Network, only: Twist | None = None) -> Trial:
    """Let the policy of `network` stand and walk on `floor`, both from anew, at the twist `only` if given."""
    e = description.envelope
    asked = [e.clamp(twist) for twist in (TWISTS if only is None else (only,))]
    twists = [Twist(), *[t for t in asked if t != Twist()]]
    told = np.array([[t.vx, t.vy, t.wz] for t in twists])
    went: Array = np.full(told.shape, np.nan)
    ends = STAND + WALK * np.arange(len(twists))
    nothing = Trial(0.0, told, went, 0.0, 0.0, 0.0)
    try:
        legs = Policy.of(description, network)
    except ConfigError:
        return nothing
    if not 1.0 <= legs.rate <= 500.0:
        return nothing
    q0 = description.q0()
    floor.q[:] = q0
    floor.place()
    locomotion = Locomotion(legs, LocomotionConfig(trim=None))
    every = max(1, round(1.0 / legs.rate / STEP))
    locomotion.reset(floor.sense()[0])
    track: list[Array] = []
    tilts: list[float] = []
    jerk, right, seen = 0.0, 0, 0
    clocked = any(t.term.startswith("phase") for t in description.observation)
    last = q0[LEGS]
    count = round(ends[-1] / STEP)
    for k in range(count):
        if k % every == 0:
            track.append(floor.pace())
            tilts.append(floor.lean())
            if floor.fallen:
                return Trial(k / count, told, went, jerk / len(track), 1.0, _share(right, seen))
            segment = int(np.searchsorted(ends, k * STEP, side="right"))
            try:
                command = locomotion.step(*floor.sense(), twists[segment], every * STEP)
            except BadAction:
                return Trial(k / count, told, went, jerk, 1.0, 0.0)
            jerk += float(np.abs(command.q - last).mean())
            last = command.q
            if locomotion.gait.stepping:
                lifted = locomotion.motion.phase >= legs.gait.stance
                if clocked and lifted.any():
                    seen += 1
                    right += int(np.argmax(floor.soles()) == np.argmax(lifted))
        floor.advance(command)
    rows = np.array(track)
    for i, end in enumerate(ends):
        begin = 0.3 if i == 0 else ends[i - 1] + SETTLE
        went[i] = rows[round(begin / STEP / every) : round(end / STEP / every)].mean(axis=0)
    tilt = float(np.sqrt(np.mean(np.square(tilts))))
    return Trial(1.0, told, went, jerk / (count / every), tilt, _share(right, seen))


def _share(right: int, seen: int) -> float:
    """Return the share of steps that are right, of a policy that steps by the clock for a while."""
    return right / seen if seen > 50 else 1.0
