"""A robot on a floor whose every sensor is right, so that estimates can be compared with the truth."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from golem.capabilities.legs.hold import STANCES
from golem.robots.model.leg_kinematics import leg_poses, sole_centers
from golem.robots.model.mjcf import robot_spec
from golem.robots.model.spatial import rotation_rpy
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS, NUM_JOINTS, Array, Imu, LowState

TORSO, SHOULDER_PITCH = 12, [13, 20]

CROUCH = np.tile(STANCES["crouch"], 2)
SQUAT = np.tile([0.0, -0.2, 0.0, 0.4, -0.2, 0.0], 2)
"""What a squat adds to the joints, sole level."""


class World:
    """The robot on a floor or, with gravity and floor away, adrift; 500 Hz, joints driven by PD."""

    def __init__(self, floor: bool = True, yaw: float = 0.0, friction: float = 1.0) -> None:
        """Stand with heading `yaw` [rad]."""
        spec = robot_spec(hands=False)
        if floor:
            kind = mujoco.mjtGeom.mjGEOM_PLANE
            ground = spec.worldbody.add_geom(type=kind, size=[9, 9, 1], contype=1, conaffinity=1)
            ground.friction, ground.priority = [friction, 0.005, 0.0001], 1
        self.model = spec.compile()
        self.model.opt.timestep = 0.002
        self.model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        self.data = mujoco.MjData(self.model)
        self.q = np.array([self.model.joint(name).qposadr[0] for name in JOINT_NAMES])
        self.v = np.array([self.model.joint(name).dofadr[0] for name in JOINT_NAMES])
        self.target = np.zeros(NUM_JOINTS)
        self.target[LEGS] = CROUCH
        height = -sole_centers(*leg_poses(CROUCH))[:, 2].min() - 0.001
        self.place(self.target, np.array([0.4, -0.3, height]), rotation_rpy(0.0, 0.0, yaw))
        self.tau = np.zeros(NUM_JOINTS)
        self.feet = [self.model.body(f"{side}_ankle_roll_link").id for side in ("left", "right")]

    def place(self, q: Array, p: Array, R: Array) -> None:
        """Put joints `q` (27,) and base_link at `p` (3,), `R` (3, 3), at rest."""
        self.data.qpos[self.q] = q
        self.data.qpos[:3] = p
        mujoco.mju_mat2Quat(self.data.qpos[3:7], R.ravel())
        self.data.qvel[:] = 0.0
        mujoco.mj_forward(self.model, self.data)

    @property
    def T(self) -> Array:
        """(4, 4) pose of base_link in the world."""
        T = np.eye(4)
        mujoco.mju_quat2Mat(flat := np.zeros(9), self.data.qpos[3:7])
        T[:3, :3], T[:3, 3] = flat.reshape(3, 3), self.data.qpos[:3]
        return T

    @property
    def velocity(self) -> Array:
        """(3,) velocity of base_link in the world [m/s]."""
        return self.data.qvel[:3].copy()

    def forces(self) -> Array:
        """Return the (2,) vertical force of the floor on each foot [N]."""
        return self._contacts()[0]

    def pressures(self) -> Array:
        """Return the (2, 3) centre of pressure of each foot in the world [m]."""
        return self._contacts()[1]

    def _contacts(self) -> tuple[Array, Array]:
        force, moment, wrench = np.zeros(2), np.zeros((2, 3)), np.zeros(6)
        for i in range(self.data.ncon):
            contact = self.data.contact[i]
            bodies = self.model.geom_bodyid[[contact.geom1, contact.geom2]]
            for k, foot in enumerate(self.feet):
                if foot in bodies:
                    mujoco.mj_contactForce(self.model, self.data, i, wrench)
                    force[k] += wrench[0]
                    moment[k] += wrench[0] * contact.pos
        return force, moment / np.maximum(force, 1e-9)[:, None]

    def hoist(self, height: float) -> Array:
        """Return the force (3,) [N] on the pelvis that holds it at `height` [m] above the floor."""
        error = np.array([0.4, -0.3, height]) - self.data.qpos[:3]
        carry = 9.81 * float(self.model.body_subtreemass[1])
        return 2e4 * error - 1.5e3 * self.velocity + [0.0, 0.0, carry]

    def state(self) -> LowState:
        """Return what error-free sensors report of the present state."""
        d = self.data
        imu = Imu(*(d.sensor(f"imu_{name}").data.copy() for name in ("quat", "gyro", "acc")))
        return LowState(d.time, d.qpos[self.q].copy(), d.qvel[self.v].copy(), self.tau.copy(), imu)

    def advance(self, push: Array | None = None) -> LowState:
        """Let 2 ms pass, with a force (3,) on the pelvis [N]; return what the sensors then report.

        As in the twin, encoders are at the end of the step, IMU, torques and contacts at its beginning.
        """
        d = self.data
        gain = np.full(NUM_JOINTS, 400.0)
        gain[LEGS] = 800.0
        bias = d.qfrc_bias[self.v] * (np.arange(NUM_JOINTS) >= LEGS.stop)
        self.tau = gain * (self.target - d.qpos[self.q]) - 0.03 * gain * d.qvel[self.v] + bias
        d.ctrl[:NUM_JOINTS] = self.tau
        d.xfrc_applied[1, :3] = 0.0 if push is None else push
        mujoco.mj_step(self.model, d)
        return self.state()

    def exercise(self, t: float) -> None:
        """Set the targets of time `t` [s]: squats, weight from foot to foot, a waist that turns, arms that swing."""
        q = np.zeros(NUM_JOINTS)
        q[LEGS] = CROUCH + 0.5 * (1.0 - np.cos(3.0 * t)) * SQUAT
        q[[2, 5, 8, 11]] += 0.06 * np.sin(2.0 * t) * np.array([1.0, -1.0, 1.0, -1.0])
        q[TORSO] = 0.5 * np.sin(2.5 * t)
        q[SHOULDER_PITCH] = 0.6 * np.sin(4.0 * t) * np.array([1.0, -1.0])
        self.target = q


@pytest.fixture
def world() -> Callable[..., World]:
    """Builds a `World`."""
    return World
