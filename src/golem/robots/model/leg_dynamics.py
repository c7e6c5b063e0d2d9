"""The legs of one robot as seen from base_link: where the soles are, how they move, what the joints weigh there.

Compiled, for the 500 Hz loop of one robot; for many robots at once see `leg_kinematics`.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from golem.native import Records, new_record
from golem.robots.model.leg_kernel import LEG, LEG_MOTION, leg_motion, tree_of
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS, NUM_JOINTS, Array

__all__ = ["LEG", "LegDynamics", "leg_tree"]
_NOTHING = np.zeros(3)


@cache
def leg_tree() -> Records:
    """Return the tree of the twelve leg joints, see `leg_kernel`; shared, not to be changed."""
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
