"""Postures of an arm in which the head camera sees the tags on its hand, and which tell the most of its mount."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.arms.postures import posture
from golem.capabilities.calibration.kinematic_fit import information
from golem.robots.model.magpie_model import T_HAND_GRIPPER, T_WRIST_HAND, cuff_tags
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.model.table import JOINTS, T_TORSO_HEAD_OPTICAL
from golem.robots.sensors.cameras import HEAD, project
from golem.types import NUM_JOINTS, UPPER, Array, CameraInfo, Side

SPREAD = np.array([1.8, 1.2, 2.0, 1.5, 2.6, 1.0, 1.0])
"""How far each joint of the arm goes from where it is ready [rad]."""
MARGIN = 60.0
"""How far inside the image the tag's middle has to be [px]: the camera sits elsewhere than the model says."""
RANGE = (0.25, 0.75)
"""Distances of the tag from the camera [m]."""
STEEPEST = 0.45
"""Least cosine between the tag's normal and the ray."""
LOWEST = 0.10
"""Least height of the fingertips above base_link [m]: the pack's lid is at about 0."""
ARM = {"left": slice(1, 8), "right": slice(8, 15)}
"""Columns of each arm in a posture of the upper body."""
CANDIDATES = 300
"""Postures among which the most telling ones are chosen."""
DRAWS = 60_000
"""Postures that are drawn to find them, at most."""
BATCH = 10_000
NEAR = 0.07
"""What is nearer than this to the camera, or to the tag, does not hide it [m]."""
CLEARANCE = 0.02
"""Distance of the ray to a tag's middle from what would hide it [m]: half a tag, where it is near."""


def view_postures(
    side: Side, count: int, free: Callable[[Array], bool], spheres: Callable[[Array], Array], seed: int = 0
) -> list[Array]:
    """Return up to `count` postures (15,) of torso and arms; the other arm is at home.

    Args:
        free: says of a posture whether it may be gone to.
        spheres: returns the (m, 4) spheres of the robot in a posture, centres in base_link and radii [m].
        seed: of the draws.
    """
    rng = np.random.default_rng(seed)
    T_base_torso = Kinematics().pose("torso_link")
    eye = (T_base_torso @ T_TORSO_HEAD_OPTICAL)[:3, 3]
    ready = posture(f"ready_{side}")
    found: list[tuple[Array, list[int]]] = []
    for _ in range(DRAWS // BATCH):
        Q = ready[ARM[side]] + SPREAD * rng.uniform(-1.0, 1.0, (BATCH, 7))
        hands = hand_poses(side, Q)
        tags = {n: np.linalg.inv(T_TORSO_HEAD_OPTICAL) @ hands @ T for n, T in cuff_tags(side).items()}
        seen = {n: visible(HEAD, poses, MARGIN, RANGE) for n, poses in tags.items()}
        high = (T_base_torso @ hands @ T_HAND_GRIPPER)[:, 2, 3] >= LOWEST
        for i in np.flatnonzero(high & np.any(list(seen.values()), axis=0)):
            q = ready.copy()
            q[ARM[side]] = Q[i]
            if not free(q):
                continue
            shown = [
                n
                for n, T in cuff_tags(side).items()
                if seen[n][i] and not hidden(eye, (T_base_torso @ hands[i] @ T)[:3, 3], spheres(q))
            ]
            if shown:
                found.append((q, shown))
        if len(found) >= CANDIDATES:
            break
    return telling(found, lambda q, tags: information(side, q, tags), count)


def hand_poses(side: Side, Q: Array) -> Array:
    """Return the (n, 4, 4) poses of a hand in the torso for the joints (n, 7) of its arm [rad]."""
    first = NUM_JOINTS - 14 if side == "left" else NUM_JOINTS - 7
    T = np.tile(np.eye(4), (len(Q), 1, 1))
    for joint, angle in zip(JOINTS[first : first + 7], Q.T, strict=True):
        # Axes are x, y or z: a turn about one of them, without Rodrigues' formula in full.
        a, b = ((1, 2), (2, 0), (0, 1))[int(np.argmax(joint.axis))]
        R = np.tile(np.eye(4), (len(Q), 1, 1))
        c, s = np.cos(angle), np.sin(angle)
        R[:, a, a], R[:, b, b], R[:, a, b], R[:, b, a] = c, c, -s, s
        T = T @ joint.T_parent_joint @ R
    return T @ T_WRIST_HAND


def visible(info: CameraInfo, tags: Array, margin: float, distances: tuple[float, float]) -> NDArray[np.bool_]:
    """Return (n,) whether a camera sees a tag at each of its poses if nothing hides it.

    Args:
        tags: (n, 4, 4) poses of the tag in the optical frame.
        margin: how far inside the image its middle has to be [px].
        distances: least and greatest [m].
    """
    p = tags[:, :3, 3]
    distance = np.linalg.norm(p, axis=1)
    u, v = project(info, np.maximum(p, (-np.inf, -np.inf, 1e-3))).T
    good = (p[:, 2] > 0.0) & (distance >= distances[0]) & (distance <= distances[1])
    good &= (u >= margin) & (u <= info.width - margin) & (v >= margin) & (v <= info.height - margin)
    return good & (np.einsum("ij,ij->i", tags[:, :3, 2], p) >= STEEPEST * distance)


def hidden(eye: Array, tag: Array, spheres: Array) -> bool:
    """Return whether a sphere stands between `eye` and `tag`, (3,) each; what is right at either does not count."""
    ray = tag - eye
    length = float(np.linalg.norm(ray))
    ray /= length
    along = (spheres[:, :3] - eye) @ ray
    beside = np.linalg.norm(spheres[:, :3] - eye - along[:, None] * ray, axis=1)
    between = (along > NEAR) & (along < length - NEAR)
    return bool((between & (beside < spheres[:, 3] + CLEARANCE)).any())


def telling(
    found: list[tuple[Array, list[int]]], information: Callable[[Array, list[int]], Array], count: int
) -> list[Array]:
    """Return the postures that tell the most together: each next one adds most to the determinant of information.

    Args:
        found: postures (15,) and the tags that are seen in them; the first `CANDIDATES` are compared.
        information: of a view with joints (27,) and tags, (n, n), in units of the priors.
        count: how many are chosen at most.
    """
    if not found:
        return []
    joints, told = np.zeros(NUM_JOINTS), list[Array]()
    for q, tags in found[:CANDIDATES]:
        joints[UPPER] = q
        told.append(information(joints, tags))
    views = np.array(told)
    total = np.eye(views.shape[1])
    chosen: list[int] = []
    for _ in range(min(count, len(told))):
        gain = np.linalg.slogdet(total + views)[1]
        gain[chosen] = -np.inf
        chosen.append(int(np.argmax(gain)))
        total = total + views[chosen[-1]]
    return [found[i][0] for i in chosen]
