"""The MAGPIE hand: geometry, masses, servos, and the closed forms of its parallelogram fingers.

Each finger hangs on two equal, parallel arms (45.00 mm, pivots 22.36 mm apart): an exact parallelogram, so that the
finger translates on an arc and never rotates. Angle `theta` of a crank is 0 when open and grows while closing.

Frames: the hand's frame is the mount frame (z approach, y closing, x normal to the plane of motion); finger `a` is on
its +y side, `b` on -y. Numbers for finger `a`; `b` is its mirror image in the xz plane.
Sources: pivots, pads and mount from correlllab/h1_mujoco magpie (MIT); mass and force from the GOLEM paper; servo from
the ROBOTIS AX-12A manual; force at full load from the lab's driver, magpie_control.
"""

from __future__ import annotations

from typing import Literal, TypeVar

import numpy as np

from golem.robots.model.spatial import Inertial, combined, transform
from golem.types import SIDES, Array, Side

Finger = Literal["a", "b"]
FINGERS: tuple[Finger, Finger] = ("a", "b")
"""The two fingers: a on +y, b on -y."""

T_WRIST_HAND: Array = transform((0.079, 0.0, -0.003125), np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]], float))
"""(4, 4) hand frame in `{side}_wrist_yaw_link`, the same for both sides: approach along the wrist's x."""
T_HAND_GRIPPER: Array = transform((-0.004, 0.0, 0.193))
"""(4, 4) grasp frame `{side}_gripper` in the hand frame: between the fingertips of the closed hand."""
T_HAND_CAMERA: Array = transform((0.0, 0.0, 0.045), np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]], float))
"""(4, 4) optical frame of the palm camera in the hand frame: looks along approach, image right = -y, image down = +x
(upright when the forearm points forward)."""

CRANK_PIVOT: Array = np.array([0.00175, 0.038, 0.069])
"""(3,) crank hinge of finger a in the hand frame [m]; hinge axis x."""
FINGER_PIVOT: Array = np.array([-0.0085, 0.039824, 0.020953])
"""(3,) finger hinge of finger a in the frame of the open crank [m]."""
ARM: float = float(np.hypot(FINGER_PIVOT[1], FINGER_PIVOT[2]))
"""Length of crank and rocker [m]: 0.0450."""
ANGLE_OPEN: float = float(np.arctan2(FINGER_PIVOT[2], FINGER_PIVOT[1]))
"""Angle of the open crank above the closing axis [rad]: 0.4843."""
PAD_CENTER: Array = np.array([0.003, -0.02227, 0.0413])
"""(3,) centre of the pad of finger a in the finger frame [m]."""
PAD_HALF_SIZE: Array = np.array([0.008, 0.0015, 0.040])
"""(3,) half extents of the pad [m]; its inner face is the -y side of finger a."""
PAD_FRICTION = 0.6
"""Sliding friction of the rubber pads, as in the lab's model of the hand."""
_PAD_FACE = float(-PAD_CENTER[1] + PAD_HALF_SIZE[1])

MASS = 0.414
"""Mass of one hand with adapter and palm camera [kg] (paper)."""
BASE = Inertial.of(0.197752, (-0.0019, 0, 0.0443), (3.64e-4, 0, 2.0e-6, 9.40e-5, 0, 2.82e-4))
"""Housing, in the hand frame. The three inertials split `MASS` in the proportion of the lab's link masses (housing
0.2041, crank + rocker 0.0252, finger 0.0864 kg at density 1000); inertias: its meshes' volumes, scaled."""
CRANK = Inertial.of(0.024416, (-0.0033, 0.0142, 0.0075), (7.20e-6, 0, 0, 2.03e-6, -2.41e-6, 5.34e-6))
"""Crank of finger a in its own frame, with the rocker, which turns in parallel, welded to it."""
FINGER = Inertial.of(0.083708, (0.003, -0.0109, 0.029), (5.94e-5, 0, 0, 5.04e-5, 1.36e-5, 1.32e-5))
"""Finger a in the frame of its hinge, axes of the hand frame."""

MAX_FORCE = 16.1
"""Most force of one finger [N]: present load 1023 in the lab's force law, 32 N for the hand."""
MIN_FORCE = 0.15
"""Least force of one finger that can be commanded [N] (magpie_control)."""
MAX_TORQUE: float = MAX_FORCE * ARM
"""Most crank torque [N m]: 0.7245, `MAX_FORCE` where the lever is longest; the AX-12A's stall torque is 1.5 N m."""
MAX_SPEED = 1.15
"""Crank speed [rad/s] at the driver's default setting, 100 of 1023, 11 rpm; the AX-12A runs 59 rpm without load."""
SERVO_DAMPING = 0.02
"""Viscous friction at the crank [N m s/rad]; chosen, small against MAX_TORQUE / MAX_SPEED = 0.63."""
SERVO_ARMATURE = 0.001
"""Reflected rotor inertia at the crank [kg m^2]; chosen: no published value."""

_T = TypeVar("_T", float, Array)


def pad_offset(theta: _T) -> _T:
    """Return the distance of a pad's inner face from the centre plane [m]."""
    return CRANK_PIVOT[1] + ARM * np.cos(ANGLE_OPEN + theta) - _PAD_FACE


def crank_from_gap(gap: _T) -> _T:
    """Return the crank angle [rad] for an opening [m], clipped to what the hand can do (0 to `MAX_GAP`)."""
    clipped = np.minimum(np.maximum(gap, 0.0), MAX_GAP)  # np.clip takes five times as long
    cosine = (clipped / 2.0 + _PAD_FACE - CRANK_PIVOT[1]) / ARM
    return np.maximum(np.arccos(cosine) - ANGLE_OPEN, 0.0)  # the arc cosine may round to just below


MAX_GAP: float = float(2.0 * pad_offset(0.0))
"""Widest opening [m]: 0.1081."""
CLOSED: float = float(np.arccos((_PAD_FACE - CRANK_PIVOT[1]) / ARM) - ANGLE_OPEN)
"""Crank angle at which the pads meet [rad]: 1.408."""
MID: float = float(crank_from_gap(MAX_GAP / 2.0))
"""Crank angle at half the widest opening [rad], where the hand is held when it is a lump."""


def hand_name(side: Side) -> str:
    """Return the name of the body and frame of a hand."""
    return f"{side}_hand"


def finger_names(side: Side, finger: Finger) -> tuple[str, str, str]:
    """Return the names of crank (body, hinge, motor), finger (body, hinge) and pad (geom)."""
    stem = f"{side}_{finger}"
    return f"{stem}_crank", f"{stem}_finger", f"{stem}_pad"


def mirror(finger: Finger, point: Array) -> Array:
    """Return a (3,) point given for finger a as it is on `finger`."""
    return point * (1.0, 1.0 if finger == "a" else -1.0, 1.0)


def payload(mass: float) -> Inertial:
    """Return what is held, in the hand frame: a ball of 4 cm and of `mass` [kg] where the fingers meet."""
    return Inertial(mass, T_HAND_GRIPPER[:3, 3], 0.4 * mass * 0.04**2 * np.eye(3))


def lump(theta: float = MID) -> Inertial:
    """Return the mass properties of the whole hand in the hand frame with both cranks held at `theta` [rad]."""
    c, s = np.cos(theta), np.sin(theta)
    R = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    crank = CRANK.moved(transform(CRANK_PIVOT, R))
    finger = FINGER.moved(transform(CRANK_PIVOT + R @ FINGER_PIVOT))
    return combined([BASE, crank, finger, crank.mirrored(), finger.mirrored()])


TAG_SIZE = 0.040
"""Side of a tag's black square [m]."""
CELLS = 8
"""Cells of a tag across, its black border among them."""
PLATE = 0.050
"""Side of a plate [m]: the tag, and one white cell around it."""
DISTANCE = 0.050
"""Distance of a plate from the approach axis [m]."""
HEIGHT = -0.040
"""Place of the tags' centres along it, in the hand frame [m]: over the wrist, where no finger hides them."""


def cuff_tags(side: Side) -> dict[int, Array]:
    """Return the (4, 4) pose of each tag of a hand's cuff in the hand frame, by its number.

    The cuff serves the calibration of cameras and encoders. Four plates stand around the approach axis, each with one
    tag of the family 36h11; the left hand has the tags 0 to 3, the right one 4 to 7.

    A tag's frame is that of AprilTag: x right, y down, z into the plate, for who looks at it.
    """
    first = 4 * SIDES.index(side)
    tags: dict[int, Array] = {}
    for k, angle in enumerate(np.deg2rad((0.0, 90.0, 180.0, 270.0))):
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        down = np.array([0.0, 0.0, 1.0])
        R = np.column_stack([np.cross(down, -out), down, -out])
        tags[first + k] = transform((*(DISTANCE * out[:2]), HEIGHT), R)
    return tags


def tag_corners() -> Array:
    """Return the (4, 3) corners of a tag in its frame [m]: upper left, upper right, lower right, lower left."""
    h = TAG_SIZE / 2.0
    return np.array([[-h, -h, 0.0], [h, -h, 0.0], [h, h, 0.0], [-h, h, 0.0]])
