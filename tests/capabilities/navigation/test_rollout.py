"""People are where they will be at each moment: a twist that gets there later is free, one that meets them is not."""

from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.navigation.astar import Way
from golem.capabilities.navigation.footprint import HOME
from golem.capabilities.navigation.local_controller import Around, LocalController, LocalControllerConfig
from golem.types import Array, PlanarPose, Twist

HERE = PlanarPose(0.0, 0.0, 0.0)
FRAME = np.array([-4.0, -4.0, 1.0, 0.0, 0.1])
OPEN = np.full((80, 80), 10.0)
AHEAD = Twist(0.5, 0.0, 0.0)
LOCAL = LocalController(LocalControllerConfig())


def walking(x: float, y: float, vx: float, vy: float) -> Array:
    return np.array([[x, y, vx, vy, 0.3]])


@pytest.mark.parametrize(
    ("person", "free"),
    [
        (walking(1.6, -1.3, 0.0, 1.0), False),  # they meet
        (walking(1.6, -0.75, 0.0, 1.5), True),  # gone before the robot is there
        (walking(2.6, 0.0, 0.6, 0.0), True),  # walks on ahead
        (walking(2.6, 0.0, -1.0, 0.0), False),  # comes
        (walking(0.0, 1.5, 0.0, -1.0), False),  # comes from the side
        (walking(-1.2, 0.0, -1.0, 0.0), True),  # leaves
    ],
)
def test_a_twist_is_tried_against_where_people_are_by_then(person: Array, free: bool) -> None:
    assert LOCAL.clear(AHEAD, HERE, HOME, Around(OPEN, FRAME, person)) is free


def test_it_stands_for_nobody_who_walks_elsewhere_and_evades_who_comes() -> None:
    way, goal = Way(np.linspace((0.0, 0.0), (3.0, 0.0), 60)), PlanarPose(3.0, 0.0, 0.0)
    aside = LOCAL.follow(HERE, way, goal, HOME, Around(OPEN, FRAME, walking(2.0, 2.0, 0.0, 1.0)))
    assert aside == LOCAL.follow(HERE, way, goal, HOME, Around(OPEN, FRAME))
    evaded = LOCAL.follow(HERE, way, goal, HOME, Around(OPEN, FRAME, walking(1.7, 0.1, -1.2, 0.0)))
    assert evaded is not None and evaded.vx <= 0.0 and evaded.vy < 0.0


def test_it_evades_into_no_obstacle() -> None:
    way, goal = Way(np.linspace((0.0, 0.0), (3.0, 0.0), 60)), PlanarPose(3.0, 0.0, 0.0)
    walled = np.full((80, 80), 0.02)  # whatever it does, something comes nearer than its margin
    walled[35:46, 35:50] = 0.07
    coming = walking(1.7, 0.0, -1.2, 0.0)
    twist = LOCAL.follow(HERE, way, goal, HOME, Around(walled, FRAME, coming))
    assert twist is None or LOCAL.clear(twist, HERE, HOME, Around(walled, FRAME))
