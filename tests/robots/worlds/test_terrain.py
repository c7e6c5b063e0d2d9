"""Grounds: flat around the start, and ahead as steep or as rough as told; measured with rays from above."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from golem.robots.sensors.streams import stream
from golem.robots.worlds import terrain
from golem.types import Array


class Ground:
    """A compiled world of ground only."""

    def __init__(self, spec: mujoco.MjSpec) -> None:
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        # Rays shall meet what can be stood on only.
        self.model.geom_group[:] = np.where(self.model.geom_contype > 0, 0, 5)

    def height(self, x: float, y: float) -> float:
        """Return the height of the ground at x, y [m]."""
        eye, down = np.array([x, y, 3.0]), np.array([0.0, 0.0, -1.0])
        only, hit = np.array([1, 0, 0, 0, 0, 0], np.uint8), np.zeros(1, np.int32)
        return 3.0 - mujoco.mj_ray(self.model, self.data, eye, down, only, 1, -1, hit, None)


def slope(angle: float) -> Ground:
    spec = mujoco.MjSpec()
    terrain.add_slope(spec, angle)
    return Ground(spec)


def rubble(height: float, seed: int = 0) -> Ground:
    spec = mujoco.MjSpec()
    terrain.add_rubble(spec, height, stream(seed, "world/rubble"))
    return Ground(spec)


def step(height: float) -> Ground:
    spec = mujoco.MjSpec()
    terrain.add_step(spec, height)
    return Ground(spec)


def start_area() -> Array:
    return np.random.default_rng(0).uniform(-0.99, 0.99, (40, 2))


def test_the_open_hall_is_flat_and_has_nothing_in_it() -> None:
    spec = mujoco.MjSpec()
    terrain.add_open(spec)
    ground = Ground(spec)
    assert (ground.model.geom_contype > 0).sum() == 1
    assert ground.height(6.5, 3.0) == pytest.approx(0.0, abs=1e-9)


def test_the_step_goes_up_and_down_again_as_high_as_told() -> None:
    ground, end = step(0.05), terrain.FLAT + terrain.PLATFORM[0]
    for x, z in ((0.99, 0.0), (1.01, 0.05), (end - 0.01, 0.05), (end + 0.01, 0.0)):
        assert ground.height(x, 0.3) == pytest.approx(z, abs=1e-6)


@pytest.mark.parametrize("angle", [np.radians(3.0), np.radians(5.0), np.radians(10.0)])
def test_the_ramp_goes_up_and_down_again_as_steep_as_told(angle: float) -> None:
    ground = slope(float(angle))
    length, level, _ = terrain.RAMP
    run, top = length * np.cos(angle), length * np.sin(angle)
    for x, z in (
        (terrain.FLAT + 0.01, 0.01 * np.tan(angle)),
        (terrain.FLAT + 0.5 * run, 0.5 * top),
        (terrain.FLAT + run - 0.01, top - 0.01 * np.tan(angle)),
        (terrain.FLAT + run + 0.01, top),
        (terrain.FLAT + run + level - 0.01, top),
        (terrain.FLAT + 1.5 * run + level, 0.5 * top),
        (terrain.FLAT + 2.0 * run + level + 0.05, 0.0),
    ):
        for y in (-1.5, 0.0, 1.5):
            assert ground.height(float(x), y) == pytest.approx(z, abs=1e-3), (x, y)


def test_the_start_is_flat() -> None:
    for ground in (slope(0.0873), rubble(0.03)):
        assert max(abs(ground.height(*spot)) for spot in start_area()) < 1e-6


@pytest.mark.parametrize("height", [0.01, 0.03])
def test_the_tiles_are_as_uneven_as_told_and_no_more(height: float) -> None:
    ground = rubble(height)
    spots = np.random.default_rng(1).uniform(-3.8, 3.8, (400, 2))
    spots = spots[np.abs(spots).max(axis=1) > terrain.FLAT + terrain.TILE]
    heights = np.array([ground.height(*spot) for spot in spots])
    assert heights.min() >= -1e-9 and heights.max() <= height + 1e-9
    assert heights.max() > 0.9 * height and heights.min() < 0.1 * height
    assert heights.std() == pytest.approx(height / np.sqrt(12.0), rel=0.15)


def test_the_seed_draws_the_tiles() -> None:
    same = [rubble(0.03, seed=4).model.geom_pos for _ in range(2)]
    np.testing.assert_array_equal(*same)
    assert np.abs(rubble(0.03, seed=5).model.geom_pos - same[0]).max() > 0.005
