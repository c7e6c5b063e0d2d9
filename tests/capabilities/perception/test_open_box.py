"""A tray's rim, what lies inside, and where to let go of a screw, from a cloud."""

from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.perception.open_box import OpenBox, fit_open_box
from golem.types import Array, Detection, LocalizedObject

SIZE = np.array([0.18, 0.24])
CENTER = np.array([0.5, -0.3])


def cloud(yaw: float = 0.4, fill: float = 0.0, walls: bool = True, clutter: bool = False) -> Array:
    """Return (n, 3) points of a tray of 45 mm on a plate, its floor 16 mm above the plate, off by 2 mm."""
    rng = np.random.default_rng(0)
    c, s = np.cos(yaw), np.sin(yaw)
    R = np.array([[c, -s], [s, c]])
    plate = rng.uniform(-0.25, 0.25, (4000, 2))
    plate = plate[(np.abs(plate) > 0.5 * SIZE + 0.005).any(axis=1)]
    inner = rng.uniform(-0.5, 0.5, (4000, 2)) * (SIZE - 0.006)
    parts = [
        np.column_stack([plate, np.zeros(len(plate))]),
        np.column_stack([inner, np.full(len(inner), 0.016 + fill)]),
    ]
    if walls:
        for axis in (0, 1):
            for end in (-1, 1):
                along = rng.uniform(-0.5, 0.5, (800, 2)) * SIZE
                along[:, axis] = end * 0.5 * SIZE[axis]
                parts.append(np.column_stack([along, rng.uniform(0.016, 0.058, 800)]))
    if clutter:
        thing = rng.uniform(-0.02, 0.02, (300, 2)) + (0.2, 0.0)
        parts.append(np.column_stack([thing, np.full(300, 0.05)]))
    points = np.concatenate(parts)
    points[:, :2] = points[:, :2] @ R.T + CENTER
    return points + rng.normal(0.0, 0.002, points.shape)


def sighting(points: Array, level: float = 0.016) -> LocalizedObject:
    detection = Detection("tray", 0.9, np.array([0.0, 0.0, 10.0, 10.0]), np.array([5.0, 5.0]))
    return LocalizedObject(detection, 0.0, np.array([*CENTER, level]), points)


@pytest.mark.parametrize("yaw", [-0.5, 0.0, 0.4, 1.2])
@pytest.mark.parametrize("clutter", [False, True])
def test_the_rim_is_found(yaw: float, clutter: bool) -> None:
    box = fit_open_box(sighting(cloud(yaw, clutter=clutter)))
    assert box is not None
    np.testing.assert_allclose(box.center, CENTER, atol=0.006)
    np.testing.assert_allclose(np.sort(box.size), SIZE, atol=0.015)
    assert box.rim == pytest.approx(0.056, abs=0.006) and box.level == pytest.approx(0.016, abs=0.002)
    assert not box.full
    c, s = np.cos(yaw), np.sin(yaw)
    corner = np.array([[c, -s], [s, c]]) @ (0.5 * SIZE)
    points = CENTER + np.array([0.9 * corner, 1.1 * corner, -0.9 * corner])
    assert box.contains(points).tolist() == [True, False, True]


def test_a_tray_that_is_filled_up_is_full() -> None:
    box = fit_open_box(sighting(cloud(fill=0.027), level=0.043))
    assert box is not None and box.full


def test_what_hangs_above_a_tray_does_not_fill_it() -> None:
    points = cloud()
    hand = np.column_stack([np.random.default_rng(1).uniform(-0.06, 0.06, (3000, 2)) + CENTER, np.full(3000, 0.2)])
    inside = np.linalg.norm(points[:, :2] - CENTER, axis=1) < 0.07
    box = fit_open_box(sighting(np.concatenate([points[~inside], hand])))
    assert box is not None and not box.full


@pytest.mark.parametrize("points", [np.zeros((0, 3)), cloud(walls=False)])
def test_where_no_walls_stand_is_no_box(points: Array) -> None:
    assert fit_open_box(sighting(points)) is None


def test_a_post_is_no_box() -> None:
    points = np.random.default_rng(0).uniform(-0.01, 0.01, (300, 3)) + (*CENTER, 0.05)
    assert fit_open_box(sighting(points)) is None


def test_places_are_inside_and_begin_in_the_middle() -> None:
    box = OpenBox(CENTER, 0.4, SIZE, 0.058, 0.016)
    places = box.places(0.04)
    np.testing.assert_allclose(places[0], (*CENTER, 0.016))
    assert len(places) > 20 and box.contains(places, 0.0399).all()
    assert np.all(np.diff(np.linalg.norm(places[:, :2] - CENTER, axis=1)) > -1e-9)
    assert len(box.places(0.11)) == 1 and len(OpenBox(CENTER, 0.0, SIZE, 0.0, 0.0).places(0.095)) == 3
