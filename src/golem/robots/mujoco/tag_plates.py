"""The calibration cuff as a camera sees it: white plates with the black cells of their tags."""

from __future__ import annotations

import cv2
import mujoco

from golem.robots.model import magpie_model
from golem.robots.model.spatial import quat_of
from golem.robots.model.tag_cuff import CELLS, PLATE, TAG_SIZE, cuff_tags
from golem.robots.worlds import parts
from golem.true_runs import true_runs
from golem.types import SIDES

THICK = 0.002
"""Thickness of a plate [m]."""
PROUD = 0.0004
"""How far the print stands out of it [m]: enough for a depth buffer."""
BLACK, WHITE = (0.02, 0.02, 0.02, 1.0), (0.95, 0.95, 0.95, 1.0)


def add_tag_cuffs(spec: mujoco.MjSpec) -> None:
    """Clamp a cuff around each hand; it weighs nothing and touches nothing."""
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    cell = TAG_SIZE / CELLS
    for side in SIDES:
        hand = spec.body(magpie_model.hand_name(side))
        for number, T in cuff_tags(side).items():
            quat = quat_of(T[:3, :3]).tolist()
            plate = (T[:3, :3] @ (0.0, 0.0, THICK / 2.0) + T[:3, 3]).tolist()
            size = (PLATE / 2.0, PLATE / 2.0, THICK / 2.0)
            parts.visual(hand, mujoco.mjtGeom.mjGEOM_BOX, size, plate, material="", quat=quat, rgba=WHITE)
            bits = cv2.aruco.generateImageMarker(family, number, CELLS) < 128
            for row in range(CELLS):
                for begin, end in true_runs(bits[row]).tolist():
                    x = (0.5 * (begin + end) - CELLS / 2.0) * cell
                    y = (row + 0.5 - CELLS / 2.0) * cell
                    # Centred on the plate's face, so that half of it stands out.
                    place = (T[:3, :3] @ (x, y, 0.0) + T[:3, 3]).tolist()
                    size = (0.5 * (end - begin) * cell, 0.5 * cell, PROUD)
                    parts.visual(hand, mujoco.mjtGeom.mjGEOM_BOX, size, place, material="", quat=quat, rgba=BLACK)
