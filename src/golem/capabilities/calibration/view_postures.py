"""Postures of an arm in which the head camera sees the tags on its hand, and which tell the most of its mount."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from golem.capabilities.arms.postures import posture
from golem.capabilities.calibration.kinematic_fit import information
from golem.robots.model.kinematics import Kinematics
from golem.robots.model.magpie_model import hand_name
from golem.robots.model.tag_cuff import cuff_tags
from golem.robots.sensors.cameras import HEAD, project
from golem.types import NUM_JOINTS, UPPER, Array, Side

SPREAD = np.array([0.9, 0.75, 1.05, 0.9, 1.35, 0.6, 0.75])
"""How far each joint of the arm goes from where it is ready [rad]."""
MARGIN = 60.0
"""How far inside the image the tag's middle has to be [px]: the camera sits elsewhere than the model says."""
RANGE = (0.30, 0.75)
"""Distances of the tag from the camera [m]."""
STEEPEST = 0.55
"""Least cosine between the tag's normal and the ray."""
LOWEST = 0.10
"""Least height of the fingertips above base_link [m]: the pack's lid is at about 0."""
ARM = {"left": slice(1, 8), "right": slice(8, 15)}
"""Columns of each arm in a posture of the upper body."""
CANDIDATES = 250
"""Postures among which the most telling ones are chosen."""
DRAWS = 4000
"""Postures that are drawn to find them, at most."""
NEAR = 0.07
"""What is nearer than this to the camera, or to the tag, does not hide it [m]."""
CLEARANCE = 0.02
"""Distance of the ray to a tag's middle from what would hide it [m]: half a tag, where it is near."""


def view_postures(
    side: Side, count: int, free: Callable[[Array], bool], spheres: Callable[[Array], Array], seed: int = 0
) -> list[Array]:
    """Return up to `count` postures (15,) of torso and arms; the other arm is at home.

    Args:
        side: which hand is seen.
        count: how many.
        free: says of a posture whether it may be gone to.
        spheres: returns the (m, 4) spheres of the robot in a posture, centres in base_link and radii [m].
        seed: of the draws.
    """
    rng = np.random.default_rng(seed)
    kinematics = Kinematics()
    ready = posture(f"ready_{side}")
    found: list[tuple[Array, list[int]]] = []
    for _ in range(DRAWS):
        if len(found) >= CANDIDATES:
            break
        q = ready.copy()
        q[ARM[side]] += SPREAD * rng.uniform(-1.0, 1.0, 7)
        tags = visible_tags(q, side, kinematics, spheres)
        if tags and free(q):
            found.append((q, tags))
    return _telling(found, count, side) if found else []


def visible_tags(
    q: Array, side: Side, kinematics: Kinematics, spheres: Callable[[Array], Array]
) -> list[int]:
    """Return the tags of a hand that the head camera should see in a posture (15,); see `view_postures`."""
    joints = np.zeros(NUM_JOINTS)
    joints[UPPER] = q
    kinematics.update(joints)
    if kinematics.pose(f"{side}_gripper")[2, 3] < LOWEST:
        return []
    T_base_optical = kinematics.pose("head_camera_optical")
    T = np.linalg.solve(T_base_optical, kinematics.pose(hand_name(side)))
    seen: list[int] = []
    for number, T_hand_tag in cuff_tags(side).items():
        tag = T @ T_hand_tag
        p = tag[:3, 3]
        distance = float(np.linalg.norm(p))
        if p[2] <= 0.0 or not RANGE[0] <= distance <= RANGE[1]:
            continue
        u, v = project(HEAD, p)
        inside = MARGIN <= u <= HEAD.width - MARGIN and MARGIN <= v <= HEAD.height - MARGIN
        if inside and tag[:3, 2] @ p / distance >= STEEPEST:
            at = (T_base_optical @ tag)[:3, 3]
            if not _hidden(T_base_optical[:3, 3], at, spheres(q)):
                seen.append(number)
    return seen


def _hidden(eye: Array, tag: Array, spheres: Array) -> bool:
    """Return whether a sphere stands between `eye` and `tag`, (3,) each; what is right at either does not count."""
    ray = tag - eye
    length = float(np.linalg.norm(ray))
    ray /= length
    along = (spheres[:, :3] - eye) @ ray
    beside = np.linalg.norm(spheres[:, :3] - eye - along[:, None] * ray, axis=1)
    between = (along > NEAR) & (along < length - NEAR)
    return bool((between & (beside < spheres[:, 3] + CLEARANCE)).any())


def _telling(found: list[tuple[Array, list[int]]], count: int, side: Side) -> list[Array]:
    """Return the postures that tell the most together: each next one adds most to the determinant of information."""
    joints = np.zeros(NUM_JOINTS)
    told: list[Array] = []
    for q, tags in found:
        joints[UPPER] = q
        told.append(information(side, joints, tags))
    views = np.array(told)
    total = np.eye(views.shape[1])
    chosen: list[int] = []
    for _ in range(min(count, len(found))):
        gain = np.linalg.slogdet(total + views)[1]
        gain[chosen] = -np.inf
        chosen.append(int(np.argmax(gain)))
        total = total + views[chosen[-1]]
    return [found[i][0] for i in chosen]
