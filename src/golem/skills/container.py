"""What a pick drops things into: where to let go of them, and which lie in it already."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from golem.capabilities.perception.open_box import OpenBox, fit_open_box
from golem.types import Array, LocalizedObject

BRIM = 0.01
"""What is this far outside of the rim may still lie inside [m]: as much is the depth off."""
KNOWN = 0.6
"""Share of the inside that two looks have to show."""
RISE = 0.004
"""What is higher than before by this is new [m]: a screw lies 10 mm high, and the noise of a cell is 1 mm."""
SPOTS = 3
"""Cells that have to be higher."""
SHIFT = 1
"""Cells by which the second look may be off sideways."""
TALL = 0.02
"""What stands higher than this above the floor is wall [m]."""
APART = 0.03
"""Distance between two places that are tried [m]."""
SURE = 0.02
"""Up to here a difference along a row is no mistaken neighbour [m]; screws stand 9 cm apart."""


@dataclass(frozen=True, slots=True)
class Container:
    """A container as the head camera saw it.

    Attributes:
        sighting: that view.
        box: its shape; None where the view does not tell.
        radius: what is nearer to its middle than this lies in it, where the shape is not known [m].
    """

    sighting: LocalizedObject
    box: OpenBox | None
    radius: float

    @classmethod
    def of(cls, sighting: LocalizedObject, radius: float) -> Container:
        """Return the container that a sighting shows; `radius` as above."""
        return cls(sighting, fit_open_box(sighting), radius)

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """Return (n,) which of the points (n, 3) in odom lie in it, seen from above."""
        if self.box is not None:
            return self.box.contains(points, -BRIM)
        return np.linalg.norm(points[:, :2] - self.sighting.position[:2], axis=1) < self.radius

    def gained(self, points: Array) -> bool | None:
        """Return whether something lies in it that was not there when it was sighted; None where that is not in view.

        Args:
            points: (n, 3) what the same camera shows of it now, in odom [m].
        """
        if self.box is None or not len(points):
            return None
        now, before = self.box.heights(points), self.box.heights(self.sighting.points, SHIFT)
        change = now - before[SHIFT:-SHIFT, SHIFT:-SHIFT]
        known = np.isfinite(change)
        if known.mean() < KNOWN:
            return None
        raised = known & (change - np.median(change[known]) > RISE)
        # The robot sways: a wall may show a little beside where it was. Nothing dropped is as high.
        walls = np.nan_to_num(before, nan=-np.inf) - np.nanmedian(before) > TALL
        near_wall = np.asarray(maximum_filter(walls, 2 * SHIFT + 1), bool)
        raised &= ~near_wall[SHIFT:-SHIFT, SHIFT:-SHIFT]
        return bool(raised.sum() >= SPOTS)

    def places(self, margin: float) -> Array:
        """Return (n, 3) places on its floor in odom, `margin` [m] inside its rim and apart.

        The first is the middle as the localizer tells it: of a box that the view cuts off, the shape has another one.
        """
        chosen = [self.sighting.position]
        for place in () if self.box is None else self.box.places(margin):
            if all(np.linalg.norm(place - one) > APART for one in chosen):
                chosen.append(place)
        return np.array(chosen)


def shift_of(seen: Array, expected: Array, others: Array) -> Array:
    """Return by how much a hand misses what the head camera shows, to send it elsewhere by the same.

    Head camera and encoders are off by centimetres, and the palm camera tells by how much at the object that was
    taken. What looks alike in a row may be mistaken for its neighbour. So what the difference has in the direction
    of the nearest of `others` counts only up to `SURE`.

    Args:
        seen: (3,) where the palm camera saw the object, in odom [m].
        expected: (3,) where the head camera did.
        others: (n, 3) where the head camera saw such objects, this one included.
    """
    shift = seen - expected
    away = others - expected
    distance = np.linalg.norm(away, axis=1)
    apart = distance > 1e-6
    if not apart.any():
        return shift
    k = int(np.argmin(np.where(apart, distance, np.inf)))
    direction = away[k] / distance[k]
    along = float(shift @ direction)
    return shift - along * direction if abs(along) > SURE else shift
