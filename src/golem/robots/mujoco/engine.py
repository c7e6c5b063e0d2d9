"""The MuJoCo twin: one robot in one world, with the errors of a realism profile."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import get_args

import mujoco
import numpy as np
from numpy.typing import NDArray

from golem.errors import unknown_name
from golem.interfaces.lidar import LidarImu, LidarScan
from golem.native import CompiledStage, address, new_record, own
from golem.robots.model import magpie_model
from golem.robots.model.imu_mount import torso_motion
from golem.robots.model.leg_kinematics import leg_poses, sole_centers
from golem.robots.model.table import BASE_LINK, load_limits
from golem.robots.mujoco import twin_stages
from golem.robots.mujoco.auto_exposure import AutoExposure
from golem.robots.mujoco.camera import CameraRig
from golem.robots.mujoco.config import WORKSHOPS, MujocoConfig, Support
from golem.robots.mujoco.external_forces import Hoist, Pushes
from golem.robots.mujoco.hand_servos import HandServos
from golem.robots.mujoco.lidar_sensor import LidarMoment, LidarSensor
from golem.robots.mujoco.motors import Motors, torque_limits
from golem.robots.mujoco.scene import COARSE_STEP, FINE_STEP, Scene, build_scene, nominal_layout
from golem.robots.mujoco.truth import Truth
from golem.robots.sensors.cameras import CAMERAS
from golem.robots.sensors.depth import StereoDepth
from golem.robots.sensors.imu import ImuModel
from golem.robots.sensors.mid360 import IMU_PERIOD
from golem.robots.sensors.profiles import load_profile, sample_episode
from golem.robots.sensors.streams import stream
from golem.robots.worlds.hall import mirror_geoms
from golem.types import LEGS, SIDES, UPPER, Array, HandCommand, HandState, Imu, LowCommand, Side

START_GAP = 0.060
"""Opening of the hands at the start of an episode [m]."""
STILL = np.zeros(2)
"""Sway of a hoist that stands still [m]."""

MOMENTS = 64
"""Ticks that the LiDAR remembers while nobody reads it."""
_MOMENT = mujoco.mjtState.mjSTATE_INTEGRATION
"""What of the state a snapshot holds: all of it."""


class MujocoRobot:
    """The twin; see `golem.robots.base.Robot`.

    `scene`, `data` and `truth` are the truth: for `golem.evaluation` and viewers of the simulation only, as are
    `push` and `true_joint_offset`.
    Modules of a stack never hold a robot.
    """

    def __init__(self, profile: str, seed: int, posture: Array, config: MujocoConfig | None = None) -> None:
        """Build the world of one episode. Raises ConfigError: the profile or an option does not exist.

        Args:
            seed: draws screws, terrain, calibration errors, noise and sway.
            posture: (27,) true joint positions to start from [rad]; arms that hang start as they hang.
        """
        self.config = config or MujocoConfig()
        self.profile = load_profile(profile)
        self.cameras = CAMERAS
        hoist, standing = self.config.hoist, standing_height(posture)
        layout = nominal_layout(self.config, standing)
        if self.config.support == "ground":
            hoist = replace(hoist, height=standing)
        self.scene: Scene = build_scene(self.config, layout, self.profile, seed)
        model = self.scene.model
        self.data = mujoco.MjData(model)
        self._model = model
        conditions = self.scene.conditions
        self.profile = self.profile.under(conditions)
        self._errors = sample_episode(self.profile, stream(seed, "episode"))
        # The cameras are where the model has them; it is the calibration that is wrong.
        self.calibration: dict[str, Array] = {
            name: np.asarray(np.linalg.inv(T), dtype=np.float64) for name, T in self._errors.T_nominal_actual.items()
        }
        self._depth = {n: StereoDepth(i, self.profile.depth, stream(seed, f"depth/{n}")) for n, i in CAMERAS.items()}
        self._exposure = {
            name: AutoExposure(conditions.light, stream(seed, f"exposure/{name}"), self.profile.colour_noise)
            for name in CAMERAS
        }
        self._mirrors = mirror_geoms(model, conditions) if self.config.world in WORKSHOPS else None
        self._memory = memory = new_record(twin_stages.TWIN)
        noise = stream(seed, "imu")
        self._imu_model = ImuModel(self.profile.imu, self._errors.imu, noise, memory["imu"])
        self._hoist = Hoist(model, hoist, memory["hoist"])
        self._pushes = Pushes(model, memory["pushes"])
        self._motors = Motors(
            model,
            torque_limits(model, load_limits(self.config.torque_profile).torque),
            self._errors.joint_offset,
            self.profile.actuator_delay + self.config.latency,
            memory["motors"],
            self.profile.motors,
            stream(seed, "motors"),
            self.profile.backlash,
        )
        self._motors.resist(model, self._errors.friction)
        self._rig: CameraRig | None = None
        self._watched: NDArray[np.int64] | None = None
        self._seed = seed
        self._lidar: LidarSensor | None = None

        self._hands = {side: HandServos(model, side, memory[side]) for side in SIDES}
        sensor = model.sensor("imu_acc")
        self._acc = slice(int(sensor.adr[0]), int(sensor.adr[0] + sensor.dim[0]))

        mujoco.mj_resetData(model, self.data)
        self._base, self._torso = model.joint("base"), model.joint("torso_joint")
        base = self._base.qposadr[0]
        self.data.qpos[base : base + 3] = (0.0, 0.0, hoist.height)
        self._motors.place(self.data, posture if self.config.arms == "home" else _hanging(posture))
        for hand in self._hands.values():
            hand.reset(self.data, START_GAP)
        self.scene.move_people(self.data)
        mujoco.mj_forward(model, self.data)
        self.truth = Truth(model, self.data)
        self._put_world()

    def _put_world(self) -> None:
        """Write into the memory of the stages what the world is like, and where it is."""
        memory, model, names = self._memory, self._model, self.scene.names.screws
        twin_stages.put_simulation(memory, model, self.data)
        memory["base_q"], memory["base_v"] = self._base.qposadr[0], self._base.dofadr[0]
        memory["acc"], memory["near"] = self._acc.start, self.config.near
        memory["fingers"] = [model.body(f"{s}_{f}_finger").id for s in SIDES for f in magpie_model.FINGERS]
        first = np.array([model.joint(name).dofadr[0] for name in names], dtype=np.int64)
        # Kept: the stages know their address only.
        self._screws = np.array([model.body(name).id for name in names], dtype=np.int64)
        self._screw_v: NDArray[np.int64] = (first[:, None] + np.arange(6)).ravel()
        memory["screws"] = len(self._screws)
        memory["screw_bodies"], memory["screw_speeds"] = address(self._screws), address(self._screw_v)
        sway, seal = self._errors.hoist_sway, self.scene.seal
        if self.config.support == "hoist":
            memory["sway"], memory["sway_amplitude"] = (sway.omega, sway.phase), sway.amplitude
        if seal is not None:
            memory["sealed"], memory["seal_q"], memory["seal_v"] = 1, seal.qpos, seal.dof
            memory["seal_torque"] = seal.torque

    def native(self, joint_offset: Array | None) -> tuple[CompiledStage, CompiledStage] | None:
        """Return the compiled stages that sense and act; see `HasStages`. None where the world needs Python."""
        if not self._compiled:
            return None
        self._memory["joint_offset"] = 0.0 if joint_offset is None else joint_offset
        return CompiledStage(twin_stages.sense_code(), self._memory), CompiledStage(
            twin_stages.act_code(), self._memory
        )

    @property
    def _compiled(self) -> bool:
        """Whether nothing in this world needs Python while time passes."""
        return not self.scene.people and own(self, MujocoRobot, "advance", "joints", "imu", "hand", "_step")

    def watch_contacts(self, kinds: NDArray[np.int64]) -> bool:
        """Have compiled ticks end where a contact is to be looked at: for judges.

        Args:
            kinds: by geom; a contact counts if the sum of its two is 1 or 2. Kept, and read at every tick.

        Returns:
            Whether they do; where not, or where ticks are not compiled, who wants to see every contact looks at every
            tick.
        """
        if self._watched is not None or not self._compiled:
            return False
        self._watched = kinds
        return twin_stages.put_watch(self._memory, self.data, kinds)

    def take_hand_command(self, side: Side, command: HandCommand) -> None:
        """Take the command of one hand; see `HasStages`."""
        self._hands[side].take(command)

    @classmethod
    def on_feet(cls, options: Mapping[str, object]) -> bool:
        """Return whether the option `support` has the robot stand; see `Standing`. Raises ConfigError: it is none."""
        support = options.get("support", "hoist")
        if support not in get_args(Support):
            raise unknown_name("support of a robot", str(support), get_args(Support))
        return support == "ground"

    @property
    def living(self) -> bool:
        """Whether the sensors have noise; see `HasLivingSensors`."""
        return self.profile.lives

    @property
    def true_joint_offset(self) -> Array:
        """(27,) reported minus true joint positions [rad]: for judges, as is `truth`."""
        return self._errors.joint_offset.copy()

    @property
    def on_gantry(self) -> bool:
        """Whether the robot stands in a band that is to be let go; see `HasGantry`."""
        return self.config.support == "ground" and not self._hoist.released

    def release(self) -> None:
        """Let the band go within half a second; see `HasGantry`. A robot in the hoist stays there."""
        if self.config.support == "ground":
            self._hoist.release(self.data.time)

    def push(self, force: Array, body: str = BASE_LINK, point: Array | None = None) -> None:
        """Push a link from outside, for judges and viewers; the force lasts until it is changed.

        Args:
            force: (3,) in the world [N]; zero ends the push.
            point: (3,) where it acts, in the link's frame [m]; None is the link's centre of mass.

        Raises:
            ConfigError: there is no such link, or an array is no three finite numbers.
        """
        self._pushes.set(force, body, point)

    @property
    def pushed(self) -> tuple[str, Array] | None:
        """The link that is pushed, and the force (3,) on it in the world [N]; None while nobody pushes."""
        return self._pushes.acting

    def advance(self, command: LowCommand, hands: dict[Side, HandCommand], dt: float) -> None:
        self._memory["fine"] = fine = twin_stages.delicate(self._memory[0])
        step = FINE_STEP if fine else COARSE_STEP
        self._model.opt.timestep = step
        for side, hand in hands.items():
            self._hands[side].command(hand, dt)
        self._motors.give(command, self.data.time)
        sway = self._errors.hoist_sway.offset(self.data.time) if self.config.support == "hoist" else STILL
        for _ in range(round(dt / step)):
            self._motors.drive(self.data)
            for hand in self._hands.values():
                hand.drive(self.data)
            self._pushes.clear(self.data)
            self._hoist.apply(self.data, sway)
            self._pushes.apply(self.data)
            self.scene.move_people(self.data)
            if self.scene.seal is not None:
                self.scene.seal.apply(self.data)
            self._step()
        self._memory["time"] = self.data.time

    def _step(self) -> None:
        """Advance the physics by one step under the torques and wrenches of `data`."""
        mujoco.mj_step(self._model, self.data)

    def joints(self) -> tuple[Array, Array, Array]:
        return self._motors.measure(self.data)

    def imu(self) -> Imu:
        # MuJoCo's sensors describe the beginning of the last step. Orientation and rate must be of the encoders'
        # instant: 2 ms apart they make planted feet seem to move by a centimetre per second.
        data, torso, q, v = self.data, self._torso, self._base.qposadr[0], self._base.dofadr[0]
        turn, rate = float(data.qpos[torso.qposadr[0]]), float(data.qvel[torso.dofadr[0]])
        quat, gyro = torso_motion(data.qpos[q + 3 : q + 7], data.qvel[v + 3 : v + 6], turn, rate)
        return self._imu_model.measure(quat, gyro, self.data.sensordata[self._acc])

    def hand(self, side: Side, t: float) -> HandState:
        return self._hands[side].read(self.data, t)

    def capture(self, camera: str) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        if self._rig is None:
            lenses = self._errors.intrinsics
            self._rig = CameraRig(self._model, [c.with_lens(*lenses[k].tolist()) for k, c in self.cameras.items()])
        # A physics step ends with the joints one step ahead of the frames; the exposure shall show where they are.
        mujoco.mj_kinematics(self._model, self.data)
        mujoco.mj_camlight(self._model, self.data)
        rgb, depth = self._rig.render(self.data, camera)
        specular = None
        if self._mirrors is not None and self.profile.depth.specular_loss > 0.0:
            specular = self._mirrors[self._rig.segment(self.data, camera)]
        return self._exposure[camera].expose(rgb), self._depth[camera].measure(depth, specular)

    lidar_period = IMU_PERIOD

    def lidar(self, t: float) -> tuple[list[LidarImu], LidarScan | None]:
        """Return what the LiDAR said since the last call; see `HasLidar`. The first call switches it on."""
        if self._lidar is None:
            self._lidar = LidarSensor(self.scene, self.profile.name, self._seed)
            self._moments: Array = np.zeros((MOMENTS, 1 + self._model.nq + self._model.nv))
            self._seen = 0
            memory = self._memory
            memory["moments"], memory["moment_rows"] = address(self._moments), MOMENTS
            memory["positions"], memory["velocities"] = self._model.nq, self._model.nv
        self._lidar_moment(t)
        return self._lidar.read_imu(), self._lidar.read_scan(t)

    def _lidar_moment(self, t: float) -> None:
        """Let the LiDAR take what the stages have kept for it, and the moment `t` [s] where that is none of them."""
        count, nq = int(self._memory["moment_count"][0]), self._model.nq
        if count == 0 or self._moments[(count - 1) % MOMENTS, 0] < t - 1e-9:
            self.keep_moment(t)
            count += 1
        assert self._lidar is not None
        for k in range(max(self._seen, count - MOMENTS), count):
            row = self._moments[k % MOMENTS].copy()
            self._lidar.observe(LidarMoment(float(row[0]), row[1 : 1 + nq], row[1 + nq :]))
        self._seen = count

    def keep_moment(self, t: float) -> None:
        """Keep the present moment for the LiDAR; see `HasStages`."""
        twin_stages.keep_moment_of(address(self._memory), t)

    def save_state(self) -> bytes:
        """Return the present moment; see `Restorable`."""
        state = np.empty(mujoco.mj_stateSize(self._model, _MOMENT))
        mujoco.mj_getState(self._model, self.data, state, _MOMENT)
        return state.tobytes()

    def restore_state(self, save_state: bytes) -> None:
        """Be in the moment of `snapshot`; see `Restorable`."""
        mujoco.mj_setState(self._model, self.data, np.frombuffer(save_state), _MOMENT)
        self._memory["time"] = self.data.time

    def close(self) -> None:
        """Release the rendering context and the LiDAR."""
        if self._rig is not None:
            self._rig.close()
            self._rig = None
        if self._lidar is not None:
            self._lidar.close()
            self._lidar = None


def _hanging(posture: Array) -> Array:
    """Return `posture` (27,) with torso and arms as they hang [rad]: where damped motors let them sag to in 5 s."""
    left = np.array([0.06, 0.03, 0.30, 1.56, 2.10, -0.26, -0.69])
    out = posture.copy()
    out[UPPER] = [0.0, *left, *(left * (1.0, -1.0, -1.0, 1.0, -1.0, 1.0, -1.0))]
    return out


def standing_height(posture: Array) -> float:
    """Return the height of base_link [m], upright, with the lower sole on the floor; `posture` is (27,) [rad]."""
    return -float(sole_centers(*leg_poses(posture[LEGS]))[:, 2].min())
