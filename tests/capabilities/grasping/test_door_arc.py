"""The door behind a handle, and the circle that a hand finds out while it pulls."""

from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.grasping.door_arc import Door, DoorArc, door_behind

HANDLE = np.array([0.56, -0.16, 0.15])


def face(hinge_left: bool, width: float = 0.6) -> np.ndarray:
    """Return a door's face 5.5 cm behind the handle, which is 5 cm from one edge of it, and a counter beside it."""
    rng = np.random.default_rng(0)
    side = 1.0 if hinge_left else -1.0
    y = HANDLE[1] + side * rng.uniform(-0.05, width - 0.05, 4000)
    door = np.column_stack([np.full(4000, 0.615), y, rng.uniform(-0.1, 0.4, 4000)])
    counter = np.column_stack(
        [rng.uniform(0.5, 0.9, 1500), HANDLE[1] - side * rng.uniform(0.2, 0.6, 1500), np.full(1500, -0.1)]
    )
    points = np.concatenate([door, counter])
    return points + 0.002 * rng.standard_normal(points.shape)


@pytest.mark.parametrize("left", [True, False])
def test_the_hinge_is_where_the_door_goes_on(left: bool) -> None:
    door = door_behind(HANDLE, face(left))
    assert door is not None
    np.testing.assert_allclose(door.normal, [-1.0, 0.0], atol=0.02)
    assert door.hinge[1] - HANDLE[1] == pytest.approx(0.55 if left else -0.55, abs=0.04)
    assert door.hinge[0] == pytest.approx(0.66, abs=0.03)


def test_without_an_upright_plane_there_is_no_door() -> None:
    rng = np.random.default_rng(0)
    table = HANDLE + np.column_stack([rng.uniform(-0.3, 0.3, (2000, 2)), np.full(2000, -0.05)])
    assert door_behind(HANDLE, table) is None
    assert door_behind(HANDLE, np.zeros((0, 3))) is None
    assert door_behind(HANDLE, np.full((500, 3), np.nan)) is None


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("arm", [0.48, 0.55, 0.60])
def test_the_circle_is_found_out_and_the_angle_with_it(side: float, arm: float) -> None:
    rng = np.random.default_rng(1)
    hinge = HANDLE[:2] + (0.10, side * arm)
    true = DoorArc(HANDLE, Door(np.array([-1.0, 0.0]), hinge))
    arc = DoorArc(HANDLE, Door(np.array([-1.0, 0.0]), HANDLE[:2] + (0.08, side * 0.52)))
    T = np.eye(4)
    T[:3, 3] = HANDLE
    for angle in np.arange(0.02, 0.5, 0.02):
        place = true.pose(T, float(angle))[:3, 3]
        arc.add(place + 0.002 * rng.standard_normal(3))
    assert arc.arm == pytest.approx(true.arm, abs=0.08)
    assert arc.angle(true.pose(T, 0.4)[:3, 3]) == pytest.approx(0.4, abs=0.06)


def test_the_handle_comes_out_of_the_door_and_the_hand_turns_with_it_in_part() -> None:
    arc = DoorArc(HANDLE, Door(np.array([-1.0, 0.0]), HANDLE[:2] + (0.1, -0.55)))
    T = np.eye(4)
    T[:3, 3] = HANDLE
    pose = arc.pose(T, 0.3, turn=0.5)
    assert pose[0, 3] < HANDLE[0] - 0.1 and pose[2, 3] == HANDLE[2]
    assert abs(np.arctan2(pose[1, 0], pose[0, 0])) == pytest.approx(0.15)
    assert arc.angle(pose[:3, 3]) == pytest.approx(0.3)


def test_places_near_the_start_tell_nothing() -> None:
    arc = DoorArc(HANDLE, Door(np.array([-1.0, 0.0]), HANDLE[:2] + (0.1, -0.55)))
    before = arc.hinge.copy()
    for k in range(10):
        arc.add(HANDLE + (0.0, 0.004 * k, 0.0))
    np.testing.assert_array_equal(arc.hinge, before)
