"""The plan of a pack as people see it: what became of each fastener, the stops, the robot and the gantry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from golem.skills.fastener_list import Listed
from golem.skills.job_file import Fate, PackFastener
from golem.skills.pack_picture import COLOURS, GANTRY, MARGIN, OTHER, ROBOT, SCALE, pack_picture
from golem.types import PlanarPose


def fasteners(*fates: Fate) -> list[PackFastener]:
    listed = [Listed(f"Screw_{k}", "screw", 0.0, 0.2 * k, 0.0) for k in range(len(fates))]
    return [PackFastener(k, one, fate) for k, (one, fate) in enumerate(zip(listed, fates, strict=True))]


def colour_at(picture: NDArray[np.uint8], x: float, y: float, width: float) -> tuple[int, ...]:
    """Return the colour where a place is, in a picture of fasteners along y from 0 to `width` [m]."""
    return tuple(picture[round(SCALE * (MARGIN - x)), round(SCALE * (width + MARGIN - y))].tolist())


def test_each_fastener_has_the_colour_of_its_fate() -> None:
    fates = (Fate.OPEN, Fate.TRYING, Fate.IN_TRAY, Fate.TIGHT, Fate.MISSING)
    picture = pack_picture(fasteners(*fates), (), (), PlanarPose(-0.7, 0.4, 0.0), None)
    assert picture.dtype == np.uint8
    for k, fate in enumerate(fates):
        assert colour_at(picture, 0.0, 0.2 * k, 0.8) == COLOURS.get(fate, OTHER)


def test_robot_and_gantry_are_where_they_are() -> None:
    ones = fasteners(Fate.OPEN, Fate.OPEN)
    alone = pack_picture(ones, (), (), PlanarPose(-0.7, 0.0, 0.0), None)
    assert not (alone == GANTRY).all(axis=2).any()
    picture = pack_picture(ones, (), (), PlanarPose(-0.7, 0.0, 0.0), np.array([0.3, 0.1]))
    rows, columns = np.nonzero((picture == GANTRY).all(axis=2))
    assert abs(rows.mean() - SCALE * (MARGIN - 0.3)) < 2 and abs(columns.mean() - SCALE * (0.2 + MARGIN - 0.1)) < 2
    rows, _ = np.nonzero((picture == ROBOT).all(axis=2))
    assert rows.min() > SCALE * (MARGIN + 0.35)  # below the edge that it stands before
