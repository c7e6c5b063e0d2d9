"""The plane around an object, found from its cloud."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from golem.capabilities.grasping.object_cloud import MIN_GROUND, ground_plane, height_above_ground
from golem.types import Array, Detection, LocalizedObject

TOP = np.array([0.43, -0.14, -0.03])


def sighting(
    slope: tuple[float, float], extra: Array | None = None, noise: float = 0.0, n: int = 15
) -> LocalizedObject:
    """Return a head 1 cm above ground that rises with `slope` along x and y, seen as `n` by `n` points."""
    side = np.linspace(-0.02, 0.02, n)
    x, y = (a.ravel() for a in np.meshgrid(side, side))
    z = slope[0] * x + slope[1] * y - 0.010
    ground = TOP + np.stack([x, y, z], axis=1)
    ground[:, 2] += noise * np.random.default_rng(0).standard_normal(len(ground))
    head = TOP + np.zeros((20, 3))
    points = np.vstack([ground, head] if extra is None else [ground, head, extra])
    box = np.array([0.0, 0.0, 10.0, 10.0])
    return LocalizedObject(Detection("screw", 0.9, box, box[:2]), 0.0, TOP.copy(), points)


def normal_of(slope: tuple[float, float]) -> Array:
    n = np.array([-slope[0], -slope[1], 1.0])
    return n / np.linalg.norm(n)


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.1, 0.0), (0.0, -0.1), (0.08, 0.05)])
def test_the_plane_and_the_height_above_it_are_found(slope: tuple[float, float]) -> None:
    plane = ground_plane(sighting(slope))
    assert plane is not None
    np.testing.assert_allclose(plane[0], normal_of(slope), atol=1e-9)
    np.testing.assert_allclose(plane[1], 0.010 * normal_of(slope)[2], atol=1e-9)


def test_noise_of_a_millimetre_turns_it_by_less_than_a_degree() -> None:
    plane = ground_plane(sighting((0.05, 0.0), noise=0.001))
    assert plane is not None
    assert np.degrees(np.arccos(plane[0] @ normal_of((0.05, 0.0)))) < 1.0


def test_a_step_in_the_ground_is_left_out() -> None:
    step = TOP + np.array([[0.02, y, -0.030] for y in np.linspace(-0.02, 0.02, 15)])
    plane = ground_plane(sighting((0.0, 0.0), extra=step))
    assert plane is not None
    assert np.degrees(np.arccos(plane[0][2])) < 2.0


def test_too_few_points_give_no_plane() -> None:
    assert ground_plane(sighting((0.0, 0.0), n=7)) is None
    assert 7 * 7 < MIN_GROUND


def test_a_wall_is_no_ground() -> None:
    assert ground_plane(sighting((0.39, 0.0))) is None


def test_points_in_one_line_give_no_plane() -> None:
    thing = sighting((0.0, 0.0))
    thing.points[:, 1] = TOP[1]
    assert ground_plane(thing) is None


def test_the_height_needs_no_plane() -> None:
    thing = sighting((0.0, 0.0))
    assert height_above_ground(thing) == pytest.approx(0.010)
    assert height_above_ground(replace(thing, points=thing.points[:0])) is None
