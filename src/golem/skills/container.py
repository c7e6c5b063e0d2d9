"""A container that things are put into, as the head camera saw it: where to let go, and what lies in it since."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from golem.capabilities.perception.open_box import EDGE_ROOM, GRID, OpenBox, fit_open_box
from golem.types import Array, LocalizedObject

BRIM = 0.01
"""What is this far outside of the rim may still lie inside [m]: as much is the depth off."""
KNOWN = 0.6
"""Share of the inside that two looks have to show."""
RISE = 0.004
"""What is higher than before by this is new [m]: a screw lies 10 mm high, and the noise of a cell is 1 mm."""
SPOTS = 3
"""Cells that have to be higher."""
ROLLED = 0.06
"""How far from where it was let go something lies [m]."""
INNER = int(EDGE_ROOM / GRID)
"""Cells beside those of `OpenBox.heights` that are inside the walls, too."""
SHIFT = 1
"""Cells by which the second look may be off sideways."""
TALL = 0.02
"""What stands higher than this above the floor is wall [m]."""
APART = 0.03
"""Distance between two places that are tried [m]."""
BESIDE_MIDDLE: Array = 0.04 * np.array([(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)])
"""Places of a container of unknown shape besides its middle, for a hand that does not get there [m]."""


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

    def gained(self, points: Array, let_go: Sequence[float] = ()) -> bool | None:
        """Return whether something lies in it that was not there when it was sighted; None where that is not in view.

        Args:
            points: (n, 3) what the same camera shows of it now, in odom [m].
            let_go: x and y where it would lie, or about there, where that is known [m].
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
        if raised.sum() >= SPOTS:
            return True
        return None if let_go and self._shown(known, let_go) < KNOWN else False

    def _shown(self, known: NDArray[np.bool_], place: Sequence[float]) -> float:
        """Return the share of what is about a place, and inside the rim, that `known` cells of `box.cells()` show."""
        assert self.box is not None
        here, inside = (np.linalg.norm(self.box.cells(n) - place, axis=2) < ROLLED for n in (0, INNER))
        return float((known & here).sum() / max(1, inside.sum()))

    def places(self, margin: float) -> Array:
        """Return (n, 3) places on its floor in odom, `margin` [m] inside its rim and apart.

        The first is the middle as the localizer tells it: of a box that the view cuts off, the shape has another one.
        """
        chosen = [self.sighting.position]
        for place in chosen[0] + BESIDE_MIDDLE if self.box is None else self.box.places(margin):
            if all(np.linalg.norm(place - one) > APART for one in chosen):
                chosen.append(place)
        return np.array(chosen)
