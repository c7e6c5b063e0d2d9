"""Torques of the hanging robot as a function of what is to be identified, linearised.

The torso is the root: the IMU on it measures how the root moves, so that no model of the hoist is needed. For given
motion, inverse dynamics is linear in masses, payloads, armature and friction (Atkeson, An, Hollerbach 1986); zeros of
the encoders, bias and lag of the IMU enter by its derivatives (Carpentier, Mansard 2018).
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from golem.robots.model import magpie_model
from golem.robots.model.imu_mount import TORSO
from golem.robots.model.spatial import Inertial, combined
from golem.robots.model.table import DOF, FRAMES, JOINT_NAMES, JOINTS, LINKS
from golem.types import LEGS, NUM_JOINTS, SIDES, Array

ROOT = "torso_link"
_HINGES = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)
WRISTS, HAND = [f"{side}_wrist_yaw_link" for side in SIDES], magpie_model.lump().moved(magpie_model.T_WRIST_HAND)
"""Names of the links that carry hands, and the mass of those in them, fingers half open."""
IMU_AT: Array = FRAMES["imu_link"].T_parent_frame[:3, 3]
"""(3,) where the IMU is in the torso [m]."""

NAMES = (
    *(f"mass of {name}" for name in LINKS),
    *(f"payload of the {side} hand" for side in SIDES),
    *(f"{kind} of {name}" for kind in ("armature", "damping", "friction", "zero") for name in JOINT_NAMES),
    *(f"accelerometer bias {axis}" for axis in "xyz"),
    *(f"lag of the {sensor}" for sensor in ("gyro", "accelerometer")),
)
"""What is identified: masses as shares by which they differ from the model's [1], payloads [kg], armature [kg m^2],
damping [N m s/rad], dry friction [N m], zeros [rad], bias [m/s^2], lags behind the encoders [s]."""
MASS, PAYLOAD, BIAS, LAG = slice(0, 28), slice(28, 30), slice(138, 141), slice(141, 143)
ARMATURE, DAMPING, FRICTION, ZERO = (slice(30 + k * NUM_JOINTS, 30 + (k + 1) * NUM_JOINTS) for k in range(4))
NOMINAL: Array = np.repeat([0.0, DOF.armature, DOF.damping, DOF.frictionloss, 0.0], [30, 27, 27, 27, 32])
"""(143,) what the model says."""
PRIOR: Array = np.repeat(
    [0.1, 1.5, 0.1, 1.0, 1.5, 0.015, 0.05, 0.05, 0.003], [28, 2, 27, 27, 27, LEGS.stop, 15, 3, 2]
)  # fmt: skip
"""(143,) standard deviation of what a robot may differ by [assumption]; legs are zeroed with the vendor's jig."""
MASSES: Array = np.array([*(inertial.mass for inertial in LINKS.values()), 1.0, 1.0])
"""(30,) derivatives of the robot's mass by masses and payloads [kg]."""
BARE = float(MASSES[MASS].sum()) + 2.0 * magpie_model.lump().mass
"""The model's mass, empty hands included [kg]."""


def payload(mass: float) -> Inertial:
    """Return what is held, of `mass` [kg], in the wrist's link."""
    return magpie_model.payload(mass).moved(magpie_model.T_WRIST_HAND)


def links(x: Array, loaded: bool = False) -> dict[str, Inertial]:
    """Return the links of other density that `x` (143,) says; `loaded` with hands, half open, and payloads."""
    scale = np.maximum(1.0 + x[MASS], 0.05)
    found = {n: Inertial(f * i.mass, i.com, f * i.inertia) for (n, i), f in zip(LINKS.items(), scale, strict=True)}
    for name, mass in zip(WRISTS, np.maximum(x[PAYLOAD], 0.0), strict=True) if loaded else ():
        found[name] = combined([found[name], HAND, payload(float(mass))])
    return found


class HangingTree:
    """Inverse dynamics of the robot hanging from wherever, its root the torso."""

    def __init__(self) -> None:
        """Build the model; the waist turns the pelvis against the torso, so its sign is the other one."""
        self._model = model = pin.Model()
        model.gravity.linear = np.zeros(3)  # the accelerometer measures what holds against it
        self._place = placed = {ROOT: model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")}
        for joint in sorted(JOINTS, key=lambda joint: joint.child != ROOT):  # the waist first: the legs hang from it
            parent, child = (joint.child, joint.parent) if joint.child == ROOT else (joint.parent, joint.child)
            hinge = _HINGES[int(np.argmax(joint.axis))]()
            placed[child] = model.addJoint(placed[parent], hinge, pin.SE3(joint.T_parent_joint), joint.name)
        self._data, ids = model.createData(), [model.getJointId(name) for name in JOINT_NAMES]
        self._q, self._v = (np.array([getattr(model.joints[i], k) for i in ids]) for k in ("idx_q", "idx_v"))
        self._sign = np.array([-1.0 if joint.child == ROOT else 1.0 for joint in JOINTS])
        # Rows of all inertial numbers, ten per body but the universe, by what they depend on; the last is the hands.
        self._numbers: Array = np.zeros((10 * (model.njoints - 1), 31))
        each = [*LINKS.items(), *((name, payload(1.0)) for name in WRISTS), *((name, HAND) for name in WRISTS)]
        for column, (name, inertial) in enumerate(each):
            numbers = pin.Inertia(inertial.mass, inertial.com, inertial.inertia).toDynamicParameters()
            self._numbers[10 * placed[name] - 10 : 10 * placed[name], min(column, 30)] += numbers

    def load(self, x: Array) -> None:
        """Take masses and payloads from the parameters `x` (143,)."""
        for name, inertial in links(x, loaded=True).items():
            self._model.inertias[self._place[name]] = pin.Inertia(inertial.mass, inertial.com, inertial.inertia)

    def linearise(self, x: Array, *moment: Array) -> tuple[Array, Array]:
        """Return torques of the rigid links at `x`, which was loaded, and their derivatives.

        Args:
            x: (143,) parameters.
            *moment: (27,) joints and their two derivatives; (3,) angular rate at the IMU and its two derivatives,
                specific force there and its derivative [rad, m, s].

        Returns:
            torque: (27,) without armature and friction [N m].
            common: (27, 62) derivatives by masses, payloads, zeros, bias and lags.
        """
        q, v, a = np.zeros(self._model.nq), np.zeros(self._model.nv), np.zeros(self._model.nv)
        place, speed, pull, gyro, turn, spin, acc, jerk = moment
        gyro, turn = gyro + x[LAG][0] * turn, turn + x[LAG][0] * spin
        acc = acc + x[LAG][1] * jerk - x[BIAS]
        q[6], q[self._q] = 1.0, self._sign * (place - x[ZERO])
        v[3:6], v[self._v] = gyro, self._sign * speed
        a[:3] = acc - np.cross(turn, IMU_AT) - np.cross(gyro, np.cross(gyro, IMU_AT))
        a[3:6], a[self._v] = turn, self._sign * pull
        # The hoist pulls at the pelvis: the waist is known by what is above it, which is what turns the root.
        at, sign = self._v.copy(), self._sign.copy()
        at[TORSO], sign[TORSO] = 5, 1.0
        rows = sign[:, None] * (pin.computeJointTorqueRegressor(self._model, self._data, q, v, a)[at] @ self._numbers)
        rows[TORSO, : list(LINKS).index(ROOT)] = 0.0
        turned, _, mass = pin.computeRNEADerivatives(self._model, self._data, q, v, a)
        zeros = -sign[:, None] * turned[np.ix_(at, self._v)] * self._sign
        bias = -sign[:, None] * mass[:3, at].T
        lags = np.column_stack([sign * (mass[:6, at].T @ [*-np.cross(spin, IMU_AT), *spin]), -bias @ jerk])
        zeros[TORSO, : TORSO + 1] = bias[TORSO] = lags[TORSO] = 0.0
        torque = rows[:, MASS] @ (1.0 + x[MASS]) + rows[:, PAYLOAD] @ x[PAYLOAD] + rows[:, 30]
        return torque, np.hstack([rows[:, :30], zeros, bias, lags])
