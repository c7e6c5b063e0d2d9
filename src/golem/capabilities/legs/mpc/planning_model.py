"""The planning model: what the sampling MPC believes the legs will do.

It is the robot's model with two legs, spheres for soles, a level floor and the motor's PD loop. Everything above the
hips is one rigid body whose inertia is that of the measured posture of waist, arms and (empty) hands: it moves with
the pelvis, which halves the cost of a step against a model with all 27 joints.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.rollout import Rollout

from golem.capabilities.legs.balance_errors import heading_frame
from golem.hardware.safety.base import SafetyLimits
from golem.robots.model.imu_mount import sensed_base_rate
from golem.robots.model.leg_kinematics import SOLE_CENTER, leg_poses
from golem.robots.model.mjcf import robot_spec
from golem.robots.model.spatial import quat_of
from golem.robots.model.table import BASE_LINK, JOINT_NAMES, SOLE
from golem.types import GRAVITY, LEGS, NUM_JOINTS, SIDES, UPPER, Array, BaseEstimate, LowState

NUM_LEGS = LEGS.stop - LEGS.start
"""Joints of both legs."""
_HIP_PITCH, _ANKLE_PITCH = [1, 7], [4, 10]
_BALANCE_STEPS = 4
"""Newton steps to the balanced stance; each leaves about a tenth of the error."""
_UPPER_BODY = "upper_body"
_TORSO = "torso_link"
_CORNERS: Array = np.array([[x, y, SOLE.z] for x in SOLE.x for y in SOLE.y])
_SENSORS = (
    ("com", mujoco.mjtSensor.mjSENS_SUBTREECOM, mujoco.mjtObj.mjOBJ_BODY, BASE_LINK),
    ("com_velocity", mujoco.mjtSensor.mjSENS_SUBTREELINVEL, mujoco.mjtObj.mjOBJ_BODY, BASE_LINK),
    ("x_axis", mujoco.mjtSensor.mjSENS_FRAMEXAXIS, mujoco.mjtObj.mjOBJ_XBODY, BASE_LINK),
    ("y_axis", mujoco.mjtSensor.mjSENS_FRAMEYAXIS, mujoco.mjtObj.mjOBJ_XBODY, BASE_LINK),
    ("z_axis", mujoco.mjtSensor.mjSENS_FRAMEZAXIS, mujoco.mjtObj.mjOBJ_XBODY, BASE_LINK),
    *((f"{s}_sole", mujoco.mjtSensor.mjSENS_FRAMEPOS, mujoco.mjtObj.mjOBJ_SITE, f"{s}_sole") for s in SIDES),
    *((n, mujoco.mjtSensor.mjSENS_ACTUATORFRC, mujoco.mjtObj.mjOBJ_ACTUATOR, n) for n in JOINT_NAMES[LEGS]),
)
"""Name, kind and object of the planning model's sensors, in the order of `Trajectories`; three numbers each, then one
per motor."""


@dataclass(frozen=True, slots=True)
class Stance:
    """The robot standing still, its CoM above the middle of its feet, with its upper body as it is.

    Attributes:
        posture: (12,) leg joints: the reference posture, its hips and ankles turned until the CoM is there [rad].
        com_height: height of the CoM above the soles [m].
        feet: (2,) centre of the left sole relative to the right one, x ahead, y left [m].
        tau: (12,) leg torques that carry the robot there, half its weight under each foot [N m].
    """

    posture: Array
    com_height: float
    feet: Array
    tau: Array


@dataclass(frozen=True, slots=True)
class Trajectories:
    """What n rollouts of m steps did, in a level frame with the heading the robot has at their start.

    Attributes:
        com, com_velocity: (n, m, 3) centre of mass [m], [m/s].
        R: (n, m, 3, 3) orientation of base_link.
        rate: (n, m, 3) angular rate of base_link, in base_link [rad/s].
        soles: (n, m, 2, 3) centres of the left and right sole [m].
        torque: (n, m, 12) motor torques [N m].
        q: (n, m, 12) leg joints [rad].
    """

    com: Array
    com_velocity: Array
    R: Array
    rate: Array
    soles: Array
    torque: Array
    q: Array


class PlanningModel:
    """Rolls the legs out from a measured state.

    Attributes:
        timestep: step of the rollouts [s].
        torque: (12,) bound of the motor torques [N m]: the safety gate's.
        lower, upper: (12,) range of the joint targets [rad]: the safety gate's.
        posture: (12,) the reference posture of the next `measure` [rad].
        stance: the reference stance with the upper body of the last `measure`.
    """

    def __init__(self, posture: Array, kp: Array, kd: Array, timestep: float, threads: int) -> None:
        """Build the model of motors with stiffness `kp` and damping `kd`, (12,) each [N m/rad, N m s/rad].

        The reference is `posture` (12,) [rad]; rollouts take steps of `timestep` [s] on `threads`, 0 is the caller's.
        """
        limits = SafetyLimits.from_profile()
        self.timestep = timestep
        self.torque: Array = limits.torque_command[LEGS]
        self.lower: Array = limits.lower[LEGS]
        self.upper: Array = limits.upper[LEGS]
        self.posture = posture
        self._upper = _UpperBody()
        spec = _legs_spec(kp, kd, self.torque, timestep)
        mass, com, inertia = self._upper.inertial(np.zeros(NUM_JOINTS))
        xx, yy, zz = np.diag(inertia)
        full = [xx, yy, zz, inertia[0, 1], inertia[0, 2], inertia[1, 2]]
        base = spec.body(BASE_LINK)
        base.add_body(name=_UPPER_BODY, mass=mass, ipos=com, fullinertia=full, explicitinertial=True)
        self._model = spec.compile()
        self._body = self._model.body(_UPPER_BODY).id
        self._data = mujoco.MjData(self._model)
        self._workers = [mujoco.MjData(self._model) for _ in range(max(threads, 1))]
        self._threads = threads
        self._pools: dict[int, Rollout] = {}
        self._qpos = np.array([self._model.joint(n).qposadr[0] for n in JOINT_NAMES[LEGS]])
        self._qvel = np.array([self._model.joint(n).dofadr[0] for n in JOINT_NAMES[LEGS]])
        self._state = np.zeros(1 + self._model.nq + self._model.nv)
        self.stance = Stance(posture, 1.0, np.zeros(2), np.zeros(NUM_LEGS))

    def measure(self, state: LowState, base: BaseEstimate) -> None:
        """Take over the measured `state` and the estimated `base` as the start of the next rollouts.

        The robot is put with the lowest corner of its soles on the floor: where a foot carries the robot that is the
        height that the estimator reports, and on one floor with the feet whatever it reports.
        """
        self._weld(state.q)
        qpos, qvel = self._state[1 : 1 + self._model.nq], self._state[1 + self._model.nq :]
        R_odom = base.T_odom_base[:3, :3]
        heading = np.eye(3)
        heading[:2, :2] = heading_frame(R_odom)
        R = heading.T @ R_odom
        p, R_foot = leg_poses(state.q[LEGS])
        corners = p[:, None] + np.einsum("fij,cj->fci", R_foot, _CORNERS)
        qpos[:3] = 0.0, 0.0, -(corners @ R[2]).min()
        qpos[3:7] = quat_of(R)
        qpos[self._qpos] = state.q[LEGS]
        qvel[:3] = heading.T @ base.velocity
        qvel[3:6] = sensed_base_rate(state)
        qvel[self._qvel] = state.dq[LEGS]

    def rollout(self, targets: Array) -> Trajectories:
        """Return what happens from the measured state under the joint targets (n, m, 12) [rad]."""
        n, m = targets.shape[:2]
        state: Array = np.empty((n, m, self._state.size))
        sensors: Array = np.empty((n, m, self._model.nsensordata))
        self._pool().rollout(self._model, self._workers, self._state, targets, state=state, sensordata=sensors)
        vectors = sensors[..., : 3 * 7].reshape(n, m, 7, 3)
        rates = 1 + self._model.nq
        return Trajectories(
            com=vectors[..., 0, :],
            com_velocity=vectors[..., 1, :],
            R=np.moveaxis(vectors[..., 2:5, :], -2, -1),
            rate=state[..., rates + 3 : rates + 6],
            soles=vectors[..., 5:7, :],
            torque=sensors[..., 3 * 7 :],
            q=state[..., 1 + self._qpos],
        )

    def _pool(self) -> Rollout:
        """Return the worker threads of this process.

        Those of the process that it was forked from did not come along; they are kept, since to drop them is to wait
        for their end.
        """
        process = os.getpid()
        if process not in self._pools:
            self._pools[process] = Rollout(nthread=self._threads)
        return self._pools[process]

    def _weld(self, q: Array) -> None:
        """Give the rigid upper body the inertia of the joints `q` (27,) [rad] and find the stance that goes with it."""
        model, body = self._model, self._body
        _, com, inertia = self._upper.inertial(q)
        moments, axes = np.linalg.eigh(inertia)
        axes *= np.sign(np.linalg.det(axes))
        model.body_ipos[body] = com
        model.body_iquat[body] = quat_of(axes)
        model.body_inertia[body] = moments
        self.stance = self._balance()
        model.actuator_biasprm[:, 0] = self.stance.tau

    def _balance(self) -> Stance:
        model, data = self._model, self._data
        mujoco.mj_resetData(model, data)
        posture = self.posture.copy()
        for _ in range(_BALANCE_STEPS):
            data.qpos[self._qpos] = posture
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            soles = np.array([data.site(f"{side}_sole").xpos for side in SIDES])
            com = data.subtree_com[1].copy()
            lean = (com[0] - soles[:, 0].mean()) / (com[2] - soles[:, 2].mean())
            posture[_HIP_PITCH] -= lean
            posture[_ANKLE_PITCH] += lean
        mujoco.mj_forward(model, data)
        weight = np.array([0.0, 0.0, GRAVITY * model.body_subtreemass[1]])
        tau = data.qfrc_bias.copy()
        jacobian = np.zeros((3, model.nv))
        for side, sole in zip(SIDES, soles, strict=True):
            foot = model.body(f"{side}_ankle_roll_link").id
            mujoco.mj_jac(model, data, jacobian, None, np.array([com[0], sole[1], sole[2]]), foot)
            tau -= 0.5 * weight @ jacobian
        height, feet = float(com[2] - soles[:, 2].mean()), soles[0, :2] - soles[1, :2]
        return Stance(posture=data.qpos[self._qpos].copy(), com_height=height, feet=feet, tau=tau[self._qvel])


class _UpperBody:
    """Mass properties of everything above the hips, welded in its measured posture."""

    def __init__(self) -> None:
        spec = robot_spec(hands=True)
        for geom in list(spec.geoms):
            spec.delete(geom)
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._qpos = np.array([self._model.joint(n).qposadr[0] for n in JOINT_NAMES[UPPER]])
        torso = self._model.body(_TORSO).id
        parent = self._model.body_parentid
        self._bodies = [torso]
        for body in range(torso + 1, self._model.nbody):
            if parent[body] in self._bodies:
                self._bodies.append(body)
        self._data.qpos[:7] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0

    def inertial(self, q: Array) -> tuple[float, Array, Array]:
        """Return mass [kg], CoM (3,) [m] and inertia (3, 3) about it [kg m^2] in base_link at the joints `q` (27,)."""
        data = self._data
        data.qpos[self._qpos] = q[UPPER]
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        # cinert: xx, yy, zz, xy, xz, yz about the robot's CoM; mass times offset from it; mass.
        xx, yy, zz, xy, xz, yz, mx, my, mz, mass = data.cinert[self._bodies].sum(axis=0)
        r = np.array([mx, my, mz]) / mass
        about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return float(mass), data.subtree_com[1] + r, about - mass * (r @ r * np.eye(3) - np.outer(r, r))


def _legs_spec(kp: Array, kd: Array, torque: Array, timestep: float) -> mujoco.MjSpec:
    spec = robot_spec(hands=False)
    spec.delete(spec.body(_TORSO))
    feet = {f"{side}_ankle_roll_link" for side in SIDES}
    for geom in list(spec.geoms):
        if geom.type != mujoco.mjtGeom.mjGEOM_SPHERE or geom.parent.name not in feet:
            spec.delete(geom)
    spec.option.timestep = timestep
    # A rollout that diverges shall not go on from the model's first posture as if nothing had happened.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], contype=1, conaffinity=1)
    for side in SIDES:
        spec.body(f"{side}_ankle_roll_link").add_site(name=f"{side}_sole", pos=SOLE_CENTER)
    for i, name in enumerate(JOINT_NAMES[LEGS]):
        motor = spec.actuator(name)
        motor.set_to_position(kp=float(kp[i]), kv=float(kd[i]))
        motor.ctrllimited = mujoco.mjtLimited.mjLIMITED_FALSE
        motor.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        motor.forcerange = [-torque[i], torque[i]]
    for name, kind, objtype, objname in _SENSORS:
        spec.add_sensor(name=name, type=kind, objtype=objtype, objname=objname)
    return spec
