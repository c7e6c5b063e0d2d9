"""What stands under the fingertips is seen from above by the palm camera, and the hand stays above it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from golem.interfaces import topics
from golem.robots.model.magpie_model import T_HAND_CAMERA, T_HAND_GRIPPER
from golem.robots.sensors.cameras import RIGHT_HAND, rays
from golem.skills.finger_room import ABOVE, ASIDE, PATIENCE, RAISED, SLOW, TIPS, TURNS, FingerRoom
from golem.skills.poses import lifted, moved, turned
from golem.types import Array, RgbdImage

GAP, HIGH, TOP = 0.05, 0.12, 0.02
T_GRIPPER_CAMERA = np.linalg.inv(T_HAND_GRIPPER) @ T_HAND_CAMERA


def room(
    world: Any,
    box: tuple[float, float] | None,
    fingers: bool = False,
    x: tuple[float, float] = (-1.0, 1.0),
    top: float = TOP,
    pressed: bool = False,
) -> tuple[FingerRoom, Array]:
    """Return what a hand `HIGH` above a plate at z = 0 has seen, and its pose on the plate.

    The plate has a box `top` high over `x`, and over `box` along y, in the frame of the hand [m].
    """
    info, T = RIGHT_HAND, world.context.arms["right"].pose
    T_odom_optical = lifted(T, HIGH - T[2, 3]) @ T_GRIPPER_CAMERA
    down = (rays(info) @ T_odom_optical[:3, :3].T)[..., 2]
    heights = np.zeros(down.shape)
    depth = (heights - T_odom_optical[2, 3]) / down
    if box is not None:
        points = rays(info) * ((top - T_odom_optical[2, 3]) / down)[..., None] @ T_odom_optical[:3, :3].T
        local = (points + T_odom_optical[:3, 3] - T[:3, 3]) @ T[:3, :2]
        on = (local > (x[0], box[0])).all(axis=-1) & (local < (x[1], box[1])).all(axis=-1)
        depth[on] -= top
    if fingers:
        depth[:, :40] = TIPS - 0.02
        depth[:, 40:42] = TIPS + 0.02  # the edge, mixed with the ground
    frame = RgbdImage(0.0, info, np.zeros((1, 1, 3), np.uint8), depth.astype(np.float32), T_odom_optical)
    seen = FingerRoom(world.context, "right", GAP, pressed)
    world.bus.publish(topics.rgbd_images("right_hand"), frame, 0.0)
    world.step()
    seen.look()
    return seen, lifted(T, -T[2, 3])


def test_before_the_first_image_nothing_is_in_the_way(world: Any) -> None:
    seen = FingerRoom(world.context, "right", GAP)
    seen.look()
    T = world.context.arms["right"].pose
    goal, speed = seen.way(T, T, 0.15)
    np.testing.assert_array_equal(goal, T)
    assert speed == 0.15 and not seen.blocked


@pytest.mark.parametrize("fingers", [False, True])
def test_the_room_to_a_plate_is_the_height_above_it(world: Any, fingers: bool) -> None:
    seen, T = room(world, None, fingers)
    assert seen.below(lifted(T, 0.03)) == pytest.approx(0.03, abs=0.001)
    goal, speed = seen.way(lifted(T, 0.004), lifted(T, 0.10), 0.15)
    np.testing.assert_array_equal(goal, lifted(T, 0.004))
    assert speed == 0.15 and not seen.blocked
    assert seen.way(T, lifted(T, 0.004), 0.15)[1] == SLOW


def test_a_goal_that_scrapes_along_the_plate_is_raised_a_little(world: Any) -> None:
    seen, T = room(world, None)
    goal, _ = seen.way(lifted(T, -0.003), lifted(T, 0.10), 0.15)
    assert goal[2, 3] == pytest.approx(-0.003 + RAISED, abs=1e-6) and not seen.blocked


@pytest.mark.parametrize("box", [(0.03, 0.06), (-0.06, -0.03)])
def test_a_hand_stays_above_what_is_under_either_finger(world: Any, box: tuple[float, float]) -> None:
    seen, T = room(world, box)
    goal, _ = seen.way(lifted(T, 0.004), lifted(T, 0.10), 0.15)
    assert seen.blocked and goal[2, 3] == pytest.approx(TOP + ABOVE, abs=0.001)
    np.testing.assert_array_equal(goal[:3, :3], T[:3, :3])


def test_what_kept_a_hand_off_is_known_when_it_has_gone_up_to_look_again(world: Any) -> None:
    seen, T = room(world, (0.03, 0.06))
    assert not seen.kept_off
    seen.way(lifted(T, 0.004), lifted(T, 0.10), 0.15)
    for _ in range(round(2.5 / world.context.period)):
        world.step()
        seen.way(lifted(T, 0.15), lifted(T, 0.12), 0.15)
    assert not seen.blocked and seen.kept_off
    for _ in range(round(1.0 / world.context.period)):
        world.step()
    assert not seen.kept_off


def test_a_hand_turns_where_that_gives_its_fingers_room(world: Any) -> None:
    seen, T = room(world, (0.03, 0.06), x=(0.006, 0.03))
    first, _ = seen.way(lifted(T, 0.004), lifted(T, 0.10), 0.15)
    assert not seen.blocked and first[2, 3] == pytest.approx(TOP + ABOVE, abs=0.001)
    for _ in range(100):
        goal, _ = seen.way(lifted(T, 0.004), lifted(T, 0.10), 0.15)
    np.testing.assert_allclose(goal[:3, 3], lifted(T, 0.004)[:3, 3], atol=RAISED)
    turn = np.arccos(goal[:3, 0] @ T[:3, 0])
    assert turn in [pytest.approx(t, abs=1e-6) for t in TURNS]


def test_what_is_between_the_fingers_or_beside_them_is_in_nobodys_way(world: Any) -> None:
    for box in ((-0.015, 0.015), (0.062, 0.09)):
        seen, T = room(world, box)
        seen.way(lifted(T, 0.004), lifted(T, 0.10), 0.15)
        assert not seen.blocked


def test_beside_a_wall_the_fingers_fit_along_it(world: Any) -> None:
    seen, T = room(world, (0.02, 1.0))
    for k in range(round(2 * PATIENCE / world.context.period)):
        seen.way(lifted(T, 0.004), lifted(T, 0.10), 0.15)
        assert seen.across is None or k * world.context.period > PATIENCE - 0.02
    assert seen.blocked and seen.across is not None
    turn = seen.across - np.arctan2(T[1, 0], T[0, 0])
    assert 0.7 <= abs(turn) <= 0.5 * np.pi + 1e-6
    assert max(seen.below(moved(turned(T, turn), aside * turned(T, turn)[:3, 0])) for aside in (0.0, *ASIDE)) > -0.004


def test_between_walls_on_all_sides_no_finger_fits(world: Any) -> None:
    seen, T = room(world, (0.02, 1.0))
    walled = np.hypot(*np.indices(seen._heights.shape) - np.array(seen._heights.shape)[:, None, None] / 2) > 5  # pyright: ignore
    seen._heights[walled] = TOP  # pyright: ignore
    for _ in range(round(2 * PATIENCE / world.context.period)):
        seen.way(lifted(T, 0.004), lifted(T, 0.10), 0.15)
    assert seen.blocked and seen.across is None


def test_beside_a_wall_the_hand_keeps_aside_along_the_width_of_its_fingers(world: Any) -> None:
    seen, T = room(world, (-1.0, 1.0), x=(0.012, 1.0))
    goal, _ = seen.way(T, lifted(T, HIGH), 0.15)
    assert not seen.blocked and seen.across is None
    np.testing.assert_allclose(goal[:2, 3], (T[:3, 3] + seen.shift)[:2])
    assert (T[:3, :3].T @ seen.shift)[0] in (pytest.approx(-0.004), pytest.approx(-0.007))
    assert seen.below(goal) > 0.0
    closer, T = room(world, (-1.0, 1.0), x=(0.0, 1.0))
    closer.way(T, lifted(T, HIGH), 0.15)
    assert closer.blocked and not closer.shift.any()


def test_a_hand_keeps_no_farther_aside_than_it_has_to_by_what_it_sees_from_nearer(world: Any) -> None:
    seen, T = room(world, (-1.0, 1.0), x=(0.012, 1.0))
    seen.way(T, lifted(T, HIGH), 0.15)
    far = np.linalg.norm(seen.shift)
    clear, _ = room(world, (1.0, 1.1))
    seen._heights = clear._heights  # pyright: ignore
    goal, _ = seen.way(T, lifted(T, 0.05), 0.15)
    assert far > 0.003 and not seen.blocked and not seen.shift.any()
    assert seen.below(goal) > 0.0


@pytest.mark.parametrize("pressed", [False, True])
@pytest.mark.parametrize(
    ("box", "x", "top"),
    [
        ((0.03, 0.06), (-1.0, 1.0), 0.005),  # a low head
        ((0.052, 0.08), (-1.0, 1.0), TOP),  # close beside
        ((0.032, 0.040), (0.0, 0.004), TOP),  # a stud
    ],
)
def test_fingers_that_have_pressed_keep_off_what_they_did_not_mind_before(
    world: Any, pressed: bool, box: tuple[float, float], x: tuple[float, float], top: float
) -> None:
    seen, T = room(world, box, x=x, top=top, pressed=pressed)
    goal, _ = seen.way(T, lifted(T, 0.10), 0.15)
    evades = seen.blocked or not np.allclose(goal[:, :3], T[:, :3]) or seen.shift.any()
    assert evades == pressed
