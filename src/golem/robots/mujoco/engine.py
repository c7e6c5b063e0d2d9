"""The MuJoCo twin: one robot in one world, with the errors of a realism profile."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import mujoco
import numpy as np
from numpy.typing import NDArray

from golem.robots.model import magpie
from golem.robots.model.limits import load_limits
from golem.robots.mujoco.camera import CameraRig
from golem.robots.mujoco.hand_servos import HandServos
from golem.robots.mujoco.hoist import Hoist, HoistConfig
from golem.robots.mujoco.scene import COARSE_STEP, FINE_STEP, Scene, build_scene
from golem.robots.sensors.cameras import CAMERAS
from golem.robots.sensors.depth import StereoDepth
from golem.robots.sensors.imu import ImuModel
from golem.robots.sensors.profiles import load_profile, sample_episode
from golem.robots.sensors.streams import stream
from golem.robots.worlds.layout import PackLayout
from golem.types import NUM_JOINTS, SIDES, Array, HandCommand, HandState, Imu, LowCommand, Side

START_GAP = 0.060
"""Opening of the hands at the start of an episode [m]."""
MOVING = 0.02
"""Speed of a screw above which it counts as moving [m/s, rad/s]."""


@dataclass(frozen=True)
class MujocoConfig:
    """Options of the twin.

    Attributes:
        layout: where the pack stands.
        hoist: how the robot is held.
        reach_y: near-edge fasteners with |y| up to this are loosened [m].
        torque_profile: torque limits of the simulated motors (see `robots.model.limits`).
        near: distance of a finger from a screw below which physics runs at the fine step [m].
    """

    layout: PackLayout = field(default_factory=PackLayout)
    hoist: HoistConfig = field(default_factory=HoistConfig)
    reach_y: float = 0.15
    torque_profile: str = "urdf"
    near: float = 0.12


class MujocoRobot:
    """The twin; see `golem.robots.base.Robot`.

    `scene` and `data` are the truth: for `golem.evaluation` and viewers of the simulation only. Modules of a stack
    never hold a robot.
    """

    def __init__(self, profile: str, seed: int, posture: Array, config: MujocoConfig | None = None) -> None:
        """Build the world of one episode.

        Args:
            profile: realism profile.
            seed: draws screws, calibration errors, noise and sway.
            posture: (27,) true joint positions to start from [rad].
            config: options.
        """
        self.config = config or MujocoConfig()
        self.profile = load_profile(profile)
        self.cameras = CAMERAS
        self.scene: Scene = build_scene(self.config.layout, self.profile, seed, self.config.reach_y)
        model = self.scene.model
        self.data = mujoco.MjData(model)
        self._model = model
        self._errors = sample_episode(self.profile, stream(seed, "episode"))
        # The cameras are where the model has them; it is the calibration that is wrong.
        self.calibration: dict[str, Array] = {
            name: np.asarray(np.linalg.inv(T), dtype=np.float64)
            for name, T in self._errors.T_nominal_actual.items()
        }
        self._depth = {
            name: StereoDepth(info, self.profile.depth, stream(seed, f"depth/{name}"))
            for name, info in CAMERAS.items()
        }
        self._imu_model = ImuModel(self.profile.imu, self._errors.imu, stream(seed, "imu"))
        self._torque_limit = load_limits(self.config.torque_profile).torque
        self._hoist = Hoist(model, self.config.hoist)
        self._delay = deque(maxlen=1 + round(self.profile.actuator_delay / COARSE_STEP))
        self._rig: CameraRig | None = None

        names = [model.actuator(i).name for i in range(model.nu)]
        self._q = np.array([model.joint(name).qposadr[0] for name in names[:NUM_JOINTS]])
        self._v = np.array([model.joint(name).dofadr[0] for name in names[:NUM_JOINTS]])
        self._hands = {side: HandServos(model, side) for side in SIDES}
        self._fingers = np.array([model.body(f"{s}_{f}_finger").id for s in SIDES for f in magpie.FINGERS])
        self._screws = np.array([model.body(name).id for name in self.scene.names.screws], dtype=int)
        first = np.array([model.joint(name).dofadr[0] for name in self.scene.names.screws], dtype=int)
        self._screw_v = (first[:, None] + np.arange(6)).ravel()
        self._sensors = [_sensor(model, n) for n in ("imu_quat", "imu_gyro", "imu_acc")]
        self._tau = np.zeros(NUM_JOINTS)

        mujoco.mj_resetData(model, self.data)
        base = model.joint("base").qposadr[0]
        self.data.qpos[base : base + 3] = (0.0, 0.0, self.config.hoist.height)
        self.data.qpos[self._q] = posture
        for hand in self._hands.values():
            hand.reset(self.data, START_GAP)
        mujoco.mj_forward(model, self.data)

    def advance(self, command: LowCommand, hands: dict[Side, HandCommand], dt: float) -> None:
        """Let time pass; see `Robot`."""
        self._delay.append(command)
        latched = self._delay[0]
        step = FINE_STEP if self._delicate() else COARSE_STEP
        self._model.opt.timestep = step
        for side, hand in hands.items():
            self._hands[side].command(hand, dt)
        # What the motors add to -kp q - kd dq; q is the true position, the encoders' error is in the target.
        held = latched.kp * (latched.q - self._errors.joint_offset) + latched.kd * latched.dq + latched.tau
        sway = self._errors.hoist_sway.offset(self.data.time)
        for _ in range(round(dt / step)):
            self._motors(latched, held)
            for hand in self._hands.values():
                hand.drive(self.data)
            self._hoist.apply(self.data, sway)
            mujoco.mj_step(self._model, self.data)

    def joints(self) -> tuple[Array, Array, Array]:
        """Return q, dq, tau as the encoders and drives report them; see `Robot`."""
        q = self.data.qpos.take(self._q) + self._errors.joint_offset
        return q, self.data.qvel.take(self._v), self._tau.copy()

    def imu(self) -> Imu:
        """Return the present IMU sample; see `Robot`."""
        quat, gyro, acc = (self.data.sensordata[where] for where in self._sensors)
        return self._imu_model.measure(quat, gyro, acc)

    def hand(self, side: Side, t: float) -> HandState:
        """Return what one hand reports; see `Robot`."""
        return self._hands[side].read(self.data, t)

    def capture(self, camera: str) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Expose one camera now; see `Robot`."""
        if self._rig is None:
            self._rig = CameraRig(self._model, self.cameras.values())
        # A physics step ends with the joints one step ahead of the frames; the exposure shall show where they are.
        mujoco.mj_kinematics(self._model, self.data)
        mujoco.mj_camlight(self._model, self.data)
        rgb, depth = self._rig.render(self.data, camera)
        return rgb, self._depth[camera].measure(depth)

    def close(self) -> None:
        """Release the rendering context."""
        if self._rig is not None:
            self._rig.close()
            self._rig = None

    def _motors(self, command: LowCommand, held: Array) -> None:
        """Run the PD loop of the 27 motor drives for one physics step."""
        tau = held - command.kp * self.data.qpos.take(self._q) - command.kd * self.data.qvel.take(self._v)
        self._tau = np.minimum(np.maximum(tau, -self._torque_limit), self._torque_limit)
        self.data.ctrl[:NUM_JOINTS] = self._tau

    def _delicate(self) -> bool:
        """Return whether a screw moves, or a finger is so close that it may touch one."""
        if not len(self._screws):
            return False
        speeds = self.data.qvel.take(self._screw_v)
        if max(speeds.max(), -speeds.min()) > MOVING:
            return True
        gaps = self.data.xpos[self._fingers, None] - self.data.xpos[None, self._screws]
        return bool((gaps * gaps).sum(axis=2).min() < self.config.near**2)


def _sensor(model: mujoco.MjModel, name: str) -> slice:
    sensor = model.sensor(name)
    return slice(int(sensor.adr[0]), int(sensor.adr[0] + sensor.dim[0]))
