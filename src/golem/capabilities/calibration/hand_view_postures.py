"""Postures of both arms in which a palm camera sees the tags on the other hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.arms.postures import posture
from golem.capabilities.calibration import view_postures
from golem.capabilities.calibration.hand_fit import OTHER, hand_information
from golem.hardware.safety.base import SafetyLimits
from golem.robots.model.magpie_model import T_HAND_CAMERA
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.model.tag_cuff import cuff_tags
from golem.robots.sensors.cameras import CAMERAS, project
from golem.types import NUM_JOINTS, SIDES, UPPER, Array, Side

MARGIN = 35.0
"""How far inside the image the tag's middle has to be [px]."""
RANGE = (0.15, 0.38)
"""Distances of the tag from the camera [m]."""
SPARE = 0.05
"""Distance kept from the ends of the joints' ranges [rad]."""


def hand_view_postures(
    camera: Side,
    count: int,
    free: Callable[[Array], bool],
    spheres: Callable[[Array], Array],
    zero: float,
    seed: int = 0,
) -> list[Array]:
    """Return up to `count` postures (15,) of torso and arms that tell the most of the mount together.

    Args:
        camera: the side whose palm camera looks at the other hand.
        count: how many.
        free: says of a posture whether it may be gone to.
        spheres: returns the (m, 4) spheres of the robot in a posture, centres in base_link and radii [m].
        zero: standard deviation of the arms' zeros [rad].
        seed: of the draws.
    """
    rng, limits = np.random.default_rng(seed), SafetyLimits.from_profile()
    lower, upper = limits.lower[UPPER] + SPARE, limits.upper[UPPER] - SPARE
    T_base_torso = Kinematics().pose("torso_link")
    found: list[tuple[Array, list[int]]] = []
    for _ in range(view_postures.DRAWS // view_postures.BATCH * len(SIDES)):
        Q = np.zeros((view_postures.BATCH, len(lower)))
        for side in SIDES:
            part = view_postures.ARM[side]
            drawn = posture(f"ready_{side}")[part] + view_postures.SPREAD * rng.uniform(
                -1.0, 1.0, (view_postures.BATCH, 7)
            )
            Q[:, part] = np.clip(drawn, lower[part], upper[part])
        eyes = T_base_torso @ view_postures.hand_poses(camera, Q[:, view_postures.ARM[camera]]) @ T_HAND_CAMERA
        hands = T_base_torso @ view_postures.hand_poses(OTHER[camera], Q[:, view_postures.ARM[OTHER[camera]]])
        seen = seen_tags(camera, eyes, hands)
        for i in np.flatnonzero(np.any(list(seen.values()), axis=0)):
            if not free(Q[i]):
                continue
            around = spheres(Q[i])
            tags = [
                n
                for n, T in cuff_tags(OTHER[camera]).items()
                if seen[n][i] and not view_postures.hidden(eyes[i][:3, 3], (hands[i] @ T)[:3, 3], around)
            ]
            if tags:
                found.append((Q[i], tags))
        if len(found) >= view_postures.CANDIDATES:
            break
    joints, told = np.zeros(NUM_JOINTS), list[Array]()
    for q, tags in found[: view_postures.CANDIDATES]:
        joints[UPPER] = q
        told.append(hand_information(camera, joints, tags, zero))
    return [found[i][0] for i in view_postures.telling(told, count)]


def seen_tags(camera: Side, eyes: Array, hands: Array) -> dict[int, NDArray[np.bool_]]:
    """Return (n,) for each tag of the other hand whether the palm camera sees it if nothing hides it.

    Args:
        camera: the side whose hand carries the camera.
        eyes: (n, 4, 4) poses of its optical frame in base_link.
        hands: (n, 4, 4) poses of the other hand in base_link.
    """
    info, inverse = CAMERAS[f"{camera}_hand"], np.linalg.inv(eyes)
    out: dict[int, NDArray[np.bool_]] = {}
    for number, T in cuff_tags(OTHER[camera]).items():
        tag = inverse @ hands @ T
        p = tag[:, :3, 3]
        distance = np.linalg.norm(p, axis=1)
        u, v = project(info, np.maximum(p, (-np.inf, -np.inf, 1e-3))).T
        good = (p[:, 2] > 0.0) & (distance >= RANGE[0]) & (distance <= RANGE[1])
        good &= (u >= MARGIN) & (u <= info.width - MARGIN) & (v >= MARGIN) & (v <= info.height - MARGIN)
        out[number] = good & (np.einsum("ij,ij->i", tag[:, :3, 2], p) >= view_postures.STEEPEST * distance)
    return out
