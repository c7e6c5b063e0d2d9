"""Those who walk are followed and expected straight on; what stands is not expected anywhere else."""

from __future__ import annotations

import numpy as np

from golem.capabilities.navigation.movers import Movers
from golem.types import Array


def person(rng: np.random.Generator, at: Array) -> Array:
    """Return what a LiDAR sees of somebody: the near half of a trunk, with noise."""
    turns = rng.uniform(-2.6, -0.5, 40)
    return at + 0.2 * np.column_stack([np.cos(turns), np.sin(turns)]) + 0.02 * rng.standard_normal((40, 2))


def wall(rng: np.random.Generator) -> Array:
    return np.column_stack([rng.uniform(-3.0, 3.0, 300), np.full(300, 3.5)]) + 0.02 * rng.standard_normal((300, 2))


def watch(velocity: Array, scans: int = 12) -> tuple[Movers, Array]:
    rng, movers, at = np.random.default_rng(0), Movers(), np.array([-1.0, 2.0])
    for k in range(scans):
        at = np.array([-1.0, 2.0]) + 0.1 * k * velocity
        movers.update(0.1 * k, np.concatenate([person(rng, at), wall(rng)]), (0.0, 0.0))
    return movers, at


def test_somebody_who_walks_is_expected_straight_on() -> None:
    velocity = np.array([1.0, -0.3])
    movers, at = watch(velocity)
    ahead = movers.ahead(1.0)
    assert len(ahead)
    goes = (ahead - at) @ velocity / np.hypot(*velocity)
    aside = np.abs((ahead - at) @ np.array([0.3, 1.0]) / np.hypot(*velocity))
    assert 0.8 < goes.max() < 1.5 and aside.max() < 0.45


def test_who_stands_and_walls_are_expected_nowhere_else() -> None:
    movers, _ = watch(np.zeros(2))
    assert len(movers.ahead(1.0)) == 0


def test_who_is_out_of_sight_is_forgotten() -> None:
    movers, _ = watch(np.array([1.0, 0.0]))
    movers.update(3.0, np.zeros((0, 2)), (0.0, 0.0))
    assert len(movers.ahead(1.0)) == 0
    movers.update(2.0, np.zeros((0, 2)), (0.0, 0.0))  # another clock
    assert len(movers.ahead(1.0)) == 0


def test_who_walks_has_a_place_now_a_velocity_and_a_radius() -> None:
    velocity = np.array([1.0, -0.3])
    movers, at = watch(velocity)
    ((x, y, vx, vy, radius),) = movers.people(1.1 + 0.2)
    assert np.hypot(*((x, y) - at - 0.2 * velocity)) < 0.3
    assert np.hypot(*((vx, vy) - velocity)) < 0.3
    assert 0.2 < radius < 0.4
    assert movers.people(1.3).shape == (1, 5) and watch(np.zeros(2))[0].people(1.3).shape == (0, 5)


def test_what_shows_another_part_in_every_scan_is_nobody() -> None:
    rng, movers = np.random.default_rng(1), Movers()
    for k in range(12):
        # A box that the robot walks around: one edge stays, the other comes into view. Its middle goes 0.4 m/s.
        box = np.column_stack([rng.uniform(1.0, 1.1 + 0.08 * k, 60), np.full(60, 2.0)])
        movers.update(0.1 * k, box + 0.01 * rng.standard_normal((60, 2)), (0.0, 0.0))
        assert len(movers.people(0.1 * k)) == 0


def test_what_jumps_about_more_than_it_goes_is_nobody() -> None:
    rng, movers = np.random.default_rng(2), Movers()
    for k in range(12):
        at = np.array([1.0 + 0.05 * k + (0.12 if k % 3 == 0 else -0.06), 2.0])
        movers.update(0.1 * k, person(rng, at), (0.0, 0.0))
        assert len(movers.people(0.1 * k)) == 0
