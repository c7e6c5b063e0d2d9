"""Where the arrow of a push is drawn."""

from __future__ import annotations

import numpy as np
import pytest

from golem.evaluation.episodes.last_seconds import project
from golem.robots.mujoco.spectator import Shot


@pytest.mark.parametrize(
    ("point", "side"), [((0.0, 0.0, 1.0), "middle"), ((0.0, -0.5, 1.0), "right"), ((0.0, 0.0, 1.5), "above")]
)
def test_points_are_projected_as_the_camera_sees_them(point: tuple[float, ...], side: str) -> None:
    shot = Shot(look_at=(0.0, 0.0, 1.0), azimuth=0.0, elevation=-10.0, distance=4.0)  # looks along x
    x, y = project(shot, (300, 400), np.array(point))
    if side == "middle":
        assert (x, y) == pytest.approx((150.0, 200.0))
    elif side == "right":
        assert x > 180.0 and y == pytest.approx(200.0, abs=1.0)
    else:
        assert y < 170.0 and x == pytest.approx(150.0)
