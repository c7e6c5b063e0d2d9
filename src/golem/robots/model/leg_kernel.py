"""Compiled kinematics and dynamics of both legs with base_link held, and the weight of the whole tree.

Recursions over chains of hinges that turn about x, y or z of their own frames (Featherstone, Rigid Body Dynamics
Algorithms, 2008, chapters 5 and 6). Written for one robot at 500 Hz, for many at once see `leg_kinematics`; axes of
base_link throughout.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from golem.kernels import njit
from golem.native import Record, Records, new_record
from golem.robots.model.leg_kinematics import SOLE_CENTER
from golem.robots.model.table import DOF, JOINT_NAMES, JOINTS, LINKS
from golem.types import LEGS, NUM_JOINTS, Array

_NOTHING = np.zeros(3)


@cache
def leg_tree() -> Records:
    """Return the tree of the twelve leg joints; shared, not to be changed."""
    # Imported here: the safety gate, which has no use for it, is there sooner without.
    import pinocchio as pin

    from golem.robots.model import pinocchio_model

    whole = pinocchio_model.build(hands=False)
    locked = [whole.getJointId(name) for name in JOINT_NAMES[LEGS.stop :]]
    return tree_of(pin.buildReducedModel(whole, locked, np.zeros(NUM_JOINTS)))


class LegDynamics:
    """Kinematics and dynamics of both legs with base_link held; axes of base_link throughout, left leg first.

    Valid after `update`, until the next:

    Attributes:
        soles: (2, 3) centres of the soles [m].
        rotations: (2, 3, 3) rotation of the ankle_roll links.
        jacobians: (2, 6, 6) of the sole centres: linear rows, then angular rows, against the leg's own six joints.
        twists: (2, 6) linear [m/s] and angular [rad/s] velocity of the soles relative to base_link.
        momentum: (2, 6) generalised momentum of each leg, M(q) dq with the motors' armature [N m s].
    """

    def __init__(self) -> None:
        self._tree, out = leg_tree()[0], new_record(LEG_MOTION)
        self._motion = out[0]
        self.soles: Array = out["soles"][0]
        self.rotations: Array = out["rotations"][0]
        self.jacobians: Array = out["jacobians"][0]
        self.twists: Array = out["twists"][0]
        self.momentum: Array = out["momentum"][0]

    def update(self, q: Array, dq: Array) -> None:
        """Set the leg joints `q`, `dq` (12,) [rad], [rad/s]."""
        leg_motion(self._tree, np.ascontiguousarray(q), np.ascontiguousarray(dq), _NOTHING, self._motion)

    def gravity(self, q: Array, field: Array) -> Array:
        """Return the (2, 6) torque that carries the legs' weight in the gravitational `field` (3,) [N m], [m/s^2]."""
        motion = new_record(LEG_MOTION)[0]
        leg_motion(self._tree, np.ascontiguousarray(q), np.zeros(LEGS.stop), field, motion)
        return motion["gravity"]


if TYPE_CHECKING:
    import pinocchio as pin

LEG = 6
"""Joints of one leg."""


def tree_dtype(joints: int) -> np.dtype[Any]:
    """Return the dtype of a tree of `joints` hinges.

    Fields: `parent`, -1 at the base; `axis`, 0 to 2; `R`, `p`: the frame of a hinge at rest in its parent's; `mass`,
    `com`, `inertia` of its link, in its frame.
    """
    return np.dtype(
        [
            ("parent", "i8", (joints,)),
            ("axis", "i8", (joints,)),
            ("R", "f8", (joints, 3, 3)),
            ("p", "f8", (joints, 3)),
            ("mass", "f8", (joints,)),
            ("com", "f8", (joints, 3)),
            ("inertia", "f8", (joints, 3, 3)),
        ]
    )


def tree_of(model: pin.Model) -> Records:
    """Return the tree of a Pinocchio `model` with a fixed base."""
    tree = new_record(tree_dtype(model.nv))
    for i in range(model.nv):
        joint, place, link = model.joints[i + 1], model.jointPlacements[i + 1], model.inertias[i + 1]
        tree["parent"][0, i] = model.parents[i + 1] - 1
        tree["axis"][0, i] = "XYZ".index(joint.shortname()[-1])
        tree["R"][0, i], tree["p"][0, i] = place.rotation, place.translation
        tree["mass"][0, i], tree["com"][0, i], tree["inertia"][0, i] = link.mass, link.lever, link.inertia
    return tree


LEG_MOTION = np.dtype(
    [
        ("soles", "f8", (2, 3)),
        ("rotations", "f8", (2, 3, 3)),
        ("jacobians", "f8", (2, LEG, LEG)),
        *((name, "f8", (2, LEG)) for name in ("twists", "momentum", "gravity")),
    ]
)
"""What `leg_motion` fills in; see `LegDynamics`, and `gravity`: torque that carries the legs' weight [N m]."""


def table_tree(joints: int) -> Records:
    """Return the tree of the first `joints` of the table, no hands; Pinocchio takes long to load."""
    tree = new_record(tree_dtype(joints))
    children = [joint.child for joint in JOINTS]
    for i, joint in enumerate(JOINTS[:joints]):
        link, T = LINKS[joint.child], joint.T_parent_joint
        tree["parent"][0, i] = children.index(joint.parent) if joint.parent in children else -1
        tree["axis"][0, i] = int(np.argmax(joint.axis))
        tree["R"][0, i], tree["p"][0, i] = T[:3, :3], T[:3, 3]
        tree["mass"][0, i], tree["com"][0, i], tree["inertia"][0, i] = link.mass, link.com, link.inertia
    return tree


SOLE = tuple(SOLE_CENTER.tolist())
ARMATURE = DOF.armature


@njit(cache=True, nogil=True)
def turned(A: Array, axis: int, angle: float, out: Array) -> None:
    """Write the rotation `A` (3, 3), turned by `angle` [rad] about its own `axis`, into `out`."""
    c, s = math.cos(angle), math.sin(angle)
    j = (axis + 1) % 3
    k = (axis + 2) % 3
    for i in range(3):
        a, b = A[i, j], A[i, k]
        out[i, axis] = A[i, axis]
        out[i, j] = c * a + s * b
        out[i, k] = c * b - s * a


@njit(cache=True, nogil=True)
def leg_motion(tree: Record, q: Array, dq: Array, field: Array, out: Record) -> None:
    """Fill `out`, a `LEG_MOTION`, from the leg joints.

    Args:
        tree: of the twelve leg joints, left leg first.
        q: of all motors [rad]; the legs are the first twelve.
        dq: their velocities [rad/s].
        field: (3,) gravity in base_link [m/s^2].
        out: is filled.
    """
    p, axes, R, A = np.empty((LEG, 3)), np.empty((LEG, 3)), np.empty((LEG, 3, 3)), np.empty((3, 3))
    com, linear, angular = np.empty((LEG, 3)), np.empty((LEG, 3)), np.empty((LEG, 3))
    w, v, r, local = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for leg in range(2):
        for a in range(3):
            w[a] = v[a] = 0.0
        for i in range(LEG):
            j = LEG * leg + i
            for a in range(3):
                if i == 0:
                    r[a] = tree.p[j, a]
                    p[i, a] = r[a]
                    for b in range(3):
                        A[a, b] = tree.R[j, a, b]
                else:
                    r[a] = 0.0
                    for c in range(3):
                        r[a] += R[i - 1, a, c] * tree.p[j, c]
                    p[i, a] = p[i - 1, a] + r[a]
                    for b in range(3):
                        A[a, b] = 0.0
                        for c in range(3):
                            A[a, b] += R[i - 1, a, c] * tree.R[j, c, b]
            if i > 0:
                v[0] += w[1] * r[2] - w[2] * r[1]
                v[1] += w[2] * r[0] - w[0] * r[2]
                v[2] += w[0] * r[1] - w[1] * r[0]
            turned(A, tree.axis[j], q[j], R[i])
            for a in range(3):
                axes[i, a] = R[i, a, tree.axis[j]]
                w[a] += axes[i, a] * dq[j]
            mass = tree.mass[j]
            for a in range(3):
                r[a] = 0.0
                for c in range(3):
                    r[a] += R[i, a, c] * tree.com[j, c]
                com[i, a] = p[i, a] + r[a]
            linear[i, 0] = mass * (v[0] + w[1] * r[2] - w[2] * r[1])
            linear[i, 1] = mass * (v[1] + w[2] * r[0] - w[0] * r[2])
            linear[i, 2] = mass * (v[2] + w[0] * r[1] - w[1] * r[0])
            for a in range(3):
                local[a] = R[i, 0, a] * w[0] + R[i, 1, a] * w[1] + R[i, 2, a] * w[2]
            for a in range(3):
                r[a] = 0.0
                for c in range(3):
                    r[a] += tree.inertia[j, a, c] * local[c]
            for a in range(3):
                angular[i, a] = R[i, a, 0] * r[0] + R[i, a, 1] * r[1] + R[i, a, 2] * r[2]
        last = LEG - 1
        for a in range(3):
            sole = p[last, a]
            for c in range(3):
                sole += R[last, a, c] * SOLE[c]
                out.rotations[leg, a, c] = R[last, a, c]
            out.soles[leg, a] = sole
        for row in range(6):
            out.twists[leg, row] = 0.0
        _backward(tree, leg, dq, field, p, axes, com, linear, angular, out)


@njit(cache=True, nogil=True)
def _backward(
    tree: Record,
    leg: int,
    dq: Array,
    field: Array,
    p: Array,
    axes: Array,
    com: Array,
    linear: Array,
    angular: Array,
    out: Record,
) -> None:
    """Go from the foot to the hip: momentum and weight of all that a joint carries, felt about its axis."""
    f0 = f1 = f2 = h0 = h1 = h2 = mass = m0 = m1 = m2 = 0.0
    for i in range(LEG - 1, -1, -1):
        j = LEG * leg + i
        a0, a1, a2 = axes[i, 0], axes[i, 1], axes[i, 2]
        x, y, z = p[i, 0], p[i, 1], p[i, 2]
        c0, c1, c2 = com[i, 0], com[i, 1], com[i, 2]
        l0, l1, l2 = linear[i, 0], linear[i, 1], linear[i, 2]
        f0, f1, f2 = f0 + l0, f1 + l1, f2 + l2
        h0 += angular[i, 0] + c1 * l2 - c2 * l1
        h1 += angular[i, 1] + c2 * l0 - c0 * l2
        h2 += angular[i, 2] + c0 * l1 - c1 * l0
        out.momentum[leg, i] = (
            a0 * (h0 - (y * f2 - z * f1)) + a1 * (h1 - (z * f0 - x * f2)) + a2 * (h2 - (x * f1 - y * f0))
        ) + ARMATURE * dq[j]
        m = tree.mass[j]
        mass, m0, m1, m2 = mass + m, m0 + m * c0, m1 + m * c1, m2 + m * c2
        u, v, w = m0 - mass * x, m1 - mass * y, m2 - mass * z
        out.gravity[leg, i] = -(
            a0 * (v * field[2] - w * field[1]) + a1 * (w * field[0] - u * field[2]) + a2 * (u * field[1] - v * field[0])
        )
        u, v, w = out.soles[leg, 0] - x, out.soles[leg, 1] - y, out.soles[leg, 2] - z
        out.jacobians[leg, 0, i] = a1 * w - a2 * v
        out.jacobians[leg, 1, i] = a2 * u - a0 * w
        out.jacobians[leg, 2, i] = a0 * v - a1 * u
        out.jacobians[leg, 3, i] = a0
        out.jacobians[leg, 4, i] = a1
        out.jacobians[leg, 5, i] = a2
        for row in range(6):
            out.twists[leg, row] += out.jacobians[leg, row, i] * dq[j]


@njit(cache=True, nogil=True)
def tree_frames(tree: Record, q: Array, R: Array, p: Array) -> None:
    """Write rotation and position of n hinges in the base at `q` (n,) [rad] into `R` (n, 3, 3) and `p` (n, 3) [m]."""
    A = np.empty((3, 3))
    for i in range(len(tree.mass)):
        k = tree.parent[i]
        for a in range(3):
            if k < 0:
                p[i, a] = tree.p[i, a]
                for b in range(3):
                    A[a, b] = tree.R[i, a, b]
            else:
                p[i, a] = p[k, a]
                for c in range(3):
                    p[i, a] += R[k, a, c] * tree.p[i, c]
                for b in range(3):
                    A[a, b] = 0.0
                    for c in range(3):
                        A[a, b] += R[k, a, c] * tree.R[i, c, b]
        turned(A, tree.axis[i], q[i], R[i])


@njit(cache=True, nogil=True)
def tree_gravity(tree: Record, q: Array, field: Array, out: Array) -> None:
    """Write the torque that holds every joint against gravity into `out` (n,) [N m].

    Args:
        tree: of n hinges, parents before children.
        q: (n,) [rad].
        field: (3,) gravity in the base [m/s^2].
        out: is filled.
    """
    n = len(tree.mass)
    R, p, axes = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3))
    mass, moment = np.empty(n), np.empty((n, 3))
    tree_frames(tree, q, R, p)
    for i in range(n):
        mass[i] = tree.mass[i]
        for a in range(3):
            axes[i, a] = R[i, a, tree.axis[i]]
            at = p[i, a]
            for c in range(3):
                at += R[i, a, c] * tree.com[i, c]
            moment[i, a] = mass[i] * at
    for i in range(n - 1, -1, -1):
        x, y, z = (moment[i, 0] - mass[i] * p[i, 0], moment[i, 1] - mass[i] * p[i, 1], moment[i, 2] - mass[i] * p[i, 2])
        out[i] = -(
            axes[i, 0] * (y * field[2] - z * field[1])
            + axes[i, 1] * (z * field[0] - x * field[2])
            + axes[i, 2] * (x * field[1] - y * field[0])
        )
        k = tree.parent[i]
        if k >= 0:
            mass[k] += mass[i]
            for a in range(3):
                moment[k, a] += moment[i, a]
