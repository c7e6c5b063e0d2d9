"""The quadratic program of the stance controller: what both planted feet must push, and what the motors must give.

Equations of motion of base (b) and legs (l), torso and arms not accelerating, w the wrenches on the two soles:

    M_bb a_b + M_bl a_l + h_b = J_b^T w             six rows without a motor
    M_lb a_b + M_ll a_l + h_l = J_l^T w + tau       twelve rows with one

Each sole pushes at its four corners with non-negative multiples of the four edges of a friction pyramid inscribed in
the cone, w = G lambda. The rows without a motor give a_b, so that x = (lambda, a_l) remains, and

    min_x  sum_i | A_i x - b_i |^2 + epsilon |lambda|^2     s.t.   lambda >= 0,   |tau(x)| <= tau_max

whatever the tasks A_i: the equations of motion, friction and torque limits hold exactly, and nothing can be infeasible,
because limp legs without contact forces (lambda = 0, tau = 0) satisfy every constraint at some a_l. Hierarchies of such
programs are in Herzog et al., Autonomous Robots 40 (2016).
"""

from __future__ import annotations

from dataclasses import dataclass

import daqp
import numpy as np
import pinocchio as pin

from golem.robots.model import pinocchio_model
from golem.robots.model.leg_kinematics import SOLE_CENTER
from golem.robots.model.table import DOF, SOLE
from golem.types import GRAVITY, LEGS, SIDES, Array

NUM_LEGS = LEGS.stop - LEGS.start
"""Leg joints."""
_DOWN = np.array([0.0, 0.0, -GRAVITY])
"""[m/s^2]"""
_FREE = 6 + NUM_LEGS
_EDGES = 4
_CORNERS = 4
_RAYS = 2 * _CORNERS * _EDGES
_SIZE = _RAYS + NUM_LEGS
_OWN = (6 + np.arange(NUM_LEGS), _RAYS + np.arange(NUM_LEGS))
_HALF = np.array([(SOLE.x[1] - SOLE.x[0]) / 2.0, (SOLE.y[1] - SOLE.y[0]) / 2.0])


class StanceDynamics:
    """The robot at one measured state, in level axes with their origin at base_link.

    Base velocities and accelerations are those of base_link in its own axes, linear first; foot velocities and
    accelerations those of the sole's centre in the foot's axes.

    Attributes:
        mass: of the whole robot [kg].
        R: (3, 3) rotation of base_link.
        M: (18, 18) inertia of base and legs, rotors included.
        h: (18,) Coriolis, gravity and joint damping.
        com, com_velocity: (3,) [m], [m/s].
        soles: (2, 3) centres of the soles [m].
        soles_R: (2, 3, 3) their rotations.
        J: (12, 18) Jacobian of the left and the right sole, linear rows first.
        drift: (12,) their acceleration at zero joint and base acceleration.
        soles_velocity: (12,) their velocity.
    """

    def __init__(self, hands: bool = True) -> None:
        model = pinocchio_model.build(hands=hands, free_base=True)
        model.armature[6:] = DOF.armature
        center = pin.SE3(np.eye(3), SOLE_CENTER)
        self._frames: list[int] = []
        for side in SIDES:
            ankle = model.frames[model.getFrameId(f"{side}_ankle_roll_link")]
            sole = pin.Frame(f"{side}_sole", ankle.parentJoint, ankle.placement * center, pin.FrameType.OP_FRAME)
            self._frames.append(model.addFrame(sole, False))
        self._model, self._data = model, model.createData()
        self._q = pin.neutral(model)
        self._v = np.zeros(model.nv)
        self._zero = np.zeros(model.nv)
        self.mass = float(pin.computeTotalMass(model))
        self.R = np.eye(3)
        self.M = np.zeros((_FREE, _FREE))
        self.h = np.zeros(_FREE)
        self.com, self.com_velocity = np.zeros(3), np.zeros(3)
        self.soles, self.soles_R = np.zeros((2, 3)), np.zeros((2, 3, 3))
        self.J, self.drift = np.zeros((12, _FREE)), np.zeros(12)
        self.soles_velocity = np.zeros(12)

    def update(self, R: Array, velocity: Array, rate: Array, q: Array, dq: Array) -> None:
        """Evaluate everything.

        Args:
            R: (3, 3) rotation of base_link in level axes.
            velocity: (3,) velocity of base_link in those axes [m/s].
            rate: (3,) angular velocity of base_link in its own axes [rad/s].
            q: (27,) joint positions [rad].
            dq: (27,) joint velocities [rad/s].
        """
        model, data = self._model, self._data
        self._q[3:7] = pin.Quaternion(R).normalized().coeffs()
        self._q[7:] = q
        self._v[:3] = R.T @ velocity
        self._v[3:6] = rate
        self._v[6:] = dq
        pin.computeAllTerms(model, data, self._q, self._v)
        self.R = R
        self.M = data.M[:_FREE, :_FREE].copy()
        self.h = data.nle[:_FREE].copy()
        self.h[6:] += DOF.damping * dq[LEGS]
        self.com, self.com_velocity = data.com[0].copy(), data.vcom[0].copy()
        for i, frame in enumerate(self._frames):
            rows = slice(6 * i, 6 * i + 6)
            self.J[rows] = pin.getFrameJacobian(model, data, frame, pin.LOCAL)[:, :_FREE]
            self.soles_velocity[rows] = pin.getFrameVelocity(model, data, frame, pin.LOCAL).vector
        # After the Jacobians: this pass replaces the accelerations that computeAllTerms has left.
        pin.forwardKinematics(model, data, self._q, self._v, self._zero)
        for i, frame in enumerate(self._frames):
            place = pin.updateFramePlacement(model, data, frame)
            self.soles[i], self.soles_R[i] = place.translation, place.rotation
            rows = slice(6 * i, 6 * i + 6)
            self.drift[rows] = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL).vector


@dataclass(frozen=True, slots=True)
class Tasks:
    """What the program shall come as close to as it can; accelerations.

    Attributes:
        com: (3,) of the centre of mass in level axes [m/s^2].
        turn: (3,) angular, of base_link in its own axes [rad/s^2].
        feet: (12,) of the soles in their own axes [m/s^2, rad/s^2].
        legs: (12,) of the leg joints [rad/s^2].
    """

    com: Array
    turn: Array
    feet: Array
    legs: Array


@dataclass(frozen=True, slots=True)
class QpWeights:
    """How much each task counts: weights of the squared errors.

    Attributes:
        com, turn, feet, legs: of `Tasks`.
        force: of the squared length of each edge's share of the contact forces [1/N^2].
    """

    com: float = 1.0
    turn: float = 0.002
    feet: float = 100.0
    legs: float = 1e-3
    force: float = 1e-6


@dataclass(frozen=True, slots=True)
class Solution:
    """What came out.

    Attributes:
        acceleration: (18,) of base and legs.
        forces: (2, 4, 3) at the corners of the left and the right sole, in level axes [N].
        torque: (12,) of the leg motors [N m].
    """

    acceleration: Array
    forces: Array
    torque: Array


class StanceProgram:
    """Assembles and solves the program. A sole pushes at `corners` (4, 3), from its centre, in the foot's axes [m]."""

    def __init__(self, torque: Array, friction: float, margin: float, weights: QpWeights) -> None:
        """Lay the constant parts out, for motors that give up to `torque` (12,) [N m] and soles with `friction`.

        The corners stay by `margin` from the edges of the sole [m].
        """
        x, y = _HALF - margin
        self.corners: Array = np.array([[x, y, 0.0], [x, -y, 0.0], [-x, y, 0.0], [-x, -y, 0.0]])
        edges = np.array([[friction, 0, 1], [-friction, 0, 1], [0, friction, 1], [0, -friction, 1]])
        edges /= np.linalg.norm(edges, axis=1, keepdims=True)
        self._force = np.tile(edges.T, _CORNERS)
        foot = np.concatenate([self._force, np.cross(np.repeat(self.corners, _EDGES, axis=0), self._force.T).T])
        self._G = np.zeros((12, _RAYS))
        self._G[:6, : _RAYS // 2] = self._G[6:, _RAYS // 2 :] = foot
        self._weights = weights
        self._torque = torque
        self._lower = np.full(_SIZE + NUM_LEGS, -np.inf)
        self._lower[:_RAYS] = 0.0
        self._upper = np.full(_SIZE + NUM_LEGS, np.inf)
        self._A = np.zeros((30, _SIZE))
        self._root = np.sqrt([weights.feet, weights.turn, weights.com, weights.legs])
        self._A[18:, _RAYS:] = self._root[3] * np.eye(NUM_LEGS)
        self._b = np.zeros(30)
        self._diagonal = np.diag_indices(_RAYS)
        self._sense = np.zeros(_SIZE + NUM_LEGS, dtype=np.int32)

    def solve(self, dynamics: StanceDynamics, tasks: Tasks) -> Solution | None:
        """Return the best compromise between `tasks`, or None where the solver fails."""
        w, A, b = self._weights, self._A, self._b
        M, h, J = dynamics.M, dynamics.h, dynamics.J
        pushed = J.T @ self._G
        inverse = np.linalg.inv(M[:6, :6])
        # a = T x + t
        T = np.zeros((_FREE, _SIZE))
        T[:6, :_RAYS] = inverse @ pushed[:6]
        T[:6, _RAYS:] = -inverse @ M[:6, 6:]
        T[_OWN] = 1.0
        t = np.zeros(_FREE)
        t[:6] = -inverse @ h[:6]
        # tau = K x + k
        K = M[6:] @ T
        K[:, :_RAYS] -= pushed[6:]
        k = M[6:] @ t + h[6:]
        root = self._root
        A[:12] = root[0] * (J @ T)
        b[:12] = root[0] * (tasks.feet - dynamics.drift - J @ t)
        A[12:15] = root[1] * T[3:6]
        b[12:15] = root[1] * (tasks.turn - t[3:6])
        half = _RAYS // 2
        for i in range(2):
            A[15:18, i * half : i * half + half] = root[2] / dynamics.mass * (dynamics.soles_R[i] @ self._force)
        b[15:18] = root[2] * (tasks.com - _DOWN)
        b[18:] = root[3] * tasks.legs
        H = A.T @ A
        H[self._diagonal] += w.force
        self._lower[_SIZE:] = -self._torque - k
        self._upper[_SIZE:] = self._torque - k
        x, _, flag, _ = daqp.solve(H, -(b @ A), K, self._upper, self._lower, self._sense)
        if flag <= 0:
            return None
        rays = x[:_RAYS].reshape(2, _CORNERS, _EDGES)
        forces = np.einsum("fij,jk,fck->fci", dynamics.soles_R, self._force[:, :_EDGES], rays)
        return Solution(T @ x + t, forces, K @ x + k)
