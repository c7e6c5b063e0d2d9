"""A cuff with AprilTags that is clamped around each hand for the calibration of cameras and encoders.

Four plates stand around the hand's approach axis, each with one tag of the family 36h11; the left hand has the tags 0
to 3, the right one 4 to 7. The cuff sits on the link that carries the hand, against the hand's adapter.
"""

from __future__ import annotations

import numpy as np

from golem.robots.model.spatial import transform
from golem.types import SIDES, Array, Side

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
    """Return the (4, 4) pose of each tag in the hand frame, by its number.

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
