from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from golem.robots.mujoco.shoves import DIRECTIONS, SHOVE_TIME, Pusher, rod, shove
from golem.types import TICK, Array


class Scale:
    """Adds up what it is pushed with."""

    def __init__(self) -> None:
        self.force: dict[str, Array] = {}
        self.impulse: Array = np.zeros(3)

    def push(self, force: Array, body: str, point: Array | None) -> None:
        self.force[body] = force

    def advance(self) -> None:
        self.impulse += TICK * sum(self.force.values(), np.zeros(3))


def run(pusher: Any, scale: Scale, start: float, seconds: float) -> None:
    for tick in range(round(seconds / TICK)):
        pusher.drive(start + tick * TICK)
        scale.advance()


@pytest.mark.parametrize("push", [shove("left", 40.0), rod("left", 60.0)], ids=["shove", "rod"])
def test_the_robot_gets_the_whole_impulse_in_its_own_direction(push: Any) -> None:
    scale = Scale()
    pusher: Any = Pusher(scale)  # pyright: ignore[reportArgumentType]
    pusher.begin(push, 2.0, math.pi / 2)  # heading along y: its left is -x
    run(pusher, scale, 2.0, push.duration + 0.1)
    np.testing.assert_allclose(scale.impulse, [-push.impulse, 0.0, 0.0], atol=1e-3 * push.impulse)
    np.testing.assert_array_equal(pusher.force, np.zeros(3))


def test_a_push_ends_where_the_next_begins_on_another_link() -> None:
    scale = Scale()
    pusher: Any = Pusher(scale)  # pyright: ignore[reportArgumentType]
    pusher.begin(rod("front", 100.0), 0.0, 0.0)
    pusher.begin(shove("front", 20.0), 0.5, 0.0)
    run(pusher, scale, 0.5, SHOVE_TIME)
    np.testing.assert_allclose(scale.impulse, [20.0, 0.0, 0.0], atol=1e-9)


def test_every_direction_points_where_it_says() -> None:
    bearings = [shove(direction, 10.0).bearing for direction in DIRECTIONS]
    assert np.rad2deg(bearings).tolist() == pytest.approx([0, 45, 90, 135, 180, 225, 270, 315])
