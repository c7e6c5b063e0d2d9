"""Antipodal grasps: on the object's two sides, free of what is around, in the hand's range, and reproducible."""

from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.grasping.antipodal import Antipodal, AntipodalConfig, upright
from golem.capabilities.grasping.base import Gripper
from golem.capabilities.grasping.hand_view import collides
from golem.capabilities.grasping.object_cloud import normals_of, object_points
from golem.errors import ConfigError
from golem.finite import NotFinite
from golem.skills.palm_look import View, shift_between
from golem.types import Array, LocalizedObject

from . import things

DOWN, AHEAD = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0])


def hand(approach: Array) -> Gripper:
    return Gripper("right", np.eye(4), -np.pi / 2, approach)


def test_the_ground_and_the_door_are_no_part_of_the_object() -> None:
    can = things.can()
    cloud = object_points(can.points, can.position)
    assert cloud[:, 2].min() > things.CAN[2] + 0.002
    assert len(cloud) > 1000
    bar = things.bar()
    cloud = object_points(bar.points, bar.position)
    assert cloud[:, 0].max() < 0.60
    assert len(cloud) > 500


def test_a_cut_through_a_bottle_is_not_what_it_stands_on_and_its_cap_not_all_of_it() -> None:
    front, top = things.bottle(above=False), things.bottle(above=True)
    assert len(object_points(front.points, front.position)) > 0.98 * len(front.points)
    assert len(object_points(top.points, top.position, 0, DOWN)) > 0.98 * len(top.points)
    assert np.ptp(object_points(top.points, top.position)[:, 2]) < 0.02


def test_a_bottle_is_taken_by_its_body_and_not_by_its_neck() -> None:
    table = np.column_stack([np.random.default_rng(1).uniform(-0.2, 0.2, (6000, 2)), np.zeros(6000)])
    for above, approach in ((True, DOWN), (False, np.array([0.88, 0.0, -0.48]))):
        thing = things.bottle(above=above)
        scene = np.concatenate([thing.points, table + things.BOTTLE])
        best = Antipodal().propose(thing, scene, hand(approach))[0]
        above_foot = float(best.T_odom_gripper[2, 3] - things.BOTTLE[2])
        assert best.gap > 0.07
        # From above the palm stays off the cap, which is 220 mm above the foot.
        assert (0.220 - 0.095 < above_foot < 0.140) if above else (0.03 < above_foot < 0.13)


def test_normals_of_a_plane_are_its_own() -> None:
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.random((300, 2)), 1e-4 * rng.standard_normal(300)])
    normals, smooth = normals_of(points)
    assert smooth.all()
    assert np.abs(normals[:, 2]).min() > 0.99


@pytest.mark.parametrize("approach", [DOWN, AHEAD], ids=["down", "ahead"])
@pytest.mark.parametrize("thing", [things.can(), things.bar()], ids=["can", "bar"])
def test_a_grasp_closes_on_two_sides_along_the_wanted_approach(thing: LocalizedObject, approach: Array) -> None:
    if thing.label == "handle" and approach is DOWN:
        pytest.skip("nobody takes an upright bar before a door from above")
    config = AntipodalConfig()
    grasps = Antipodal(config).propose(thing, thing.points, hand(approach))
    assert 3 <= len(grasps) <= config.most
    scores = [grasp.score for grasp in grasps]
    assert scores == sorted(scores, reverse=True)
    axis = (things.CAN if thing.label == "can" else things.BAR)[:2]
    for grasp in grasps:
        T = grasp.T_odom_gripper
        np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-9)
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
        assert np.arccos(np.clip(T[:3, 2] @ approach, -1, 1)) <= config.tilt + 1e-6
        assert grasp.gap <= hand(approach).max_gap
    best = grasps[0].T_odom_gripper
    # The closing axis passes the object's own axis, and lies across it.
    away = (axis - best[:2, 3]) @ best[:2, 1]
    assert abs(away) < 0.008
    assert abs(best[2, 1]) < 0.4


def test_a_lid_is_held_in_its_middle_and_far_down() -> None:
    rng = np.random.default_rng(0)
    turn, radius = rng.uniform(0.0, 2 * np.pi, 2000), 0.034 * np.sqrt(rng.random(2000))
    lid = things.CAN + np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full(2000, 0.12)])
    table = things.CAN + np.column_stack([rng.uniform(-0.15, 0.15, (4000, 2)), np.zeros(4000)])
    scene = np.concatenate([lid, table])
    grasps = Antipodal().propose(things.seen(lid, lid[0]), scene, hand(DOWN))
    best = grasps[0].T_odom_gripper
    np.testing.assert_allclose(best[:2, 3], things.CAN[:2], atol=0.004)
    assert 0.03 < best[2, 3] - things.CAN[2] < 0.075
    # A round thing is offered to the wrist in many turns.
    turns = {round(float(np.arctan2(*g.T_odom_gripper[:2, 1])) % np.pi, 1) for g in grasps[:20]}
    assert len(turns) > 4


def test_what_has_moved_is_found_again_though_a_part_is_hidden() -> None:
    rng = np.random.default_rng(0)
    turn, radius = rng.uniform(0.0, 2 * np.pi, 2000), 0.04 * np.sqrt(rng.random(2000))
    lid = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full(2000, 0.12)])
    table = np.column_stack([rng.uniform(-0.15, 0.15, (9000, 2)), np.zeros(9000)])
    moved = lid + (0.017, -0.008, -0.006)
    # The second view ends in the middle of the thing.
    shown = moved[moved[:, 1] < 0.01]
    before, after = (
        View(lid, np.concatenate([lid, table])),
        View(shown, np.concatenate([shown, table[table[:, 1] < 0.01]])),
    )
    shift = shift_between(before, after, DOWN)
    np.testing.assert_allclose(shift, [0.017, -0.008, -0.006], atol=0.003)


@pytest.mark.parametrize("lean", [0.0, 0.2, 0.4])
def test_of_a_bottle_the_cap_says_how_far_it_moved_though_more_of_it_is_seen(lean: float) -> None:
    turn, down = (grid.ravel() for grid in np.meshgrid(np.linspace(0.0, 6.3, 60), np.arange(0.0, 0.14, 0.003)))
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    neck = np.column_stack([0.015 * ring, 0.22 - 0.4 * down])
    shoulder = np.column_stack([(0.015 + 0.14 * down)[:, None] * ring, 0.165 - 0.2 * down])
    body = np.column_stack([0.035 * ring, 0.14 - down])
    table = np.column_stack([np.random.default_rng(0).uniform(-0.2, 0.2, (9000, 2)), np.zeros(9000)])
    # First the neck alone in a narrow view; then one side of what is below it, too.
    before = View(neck, np.concatenate([neck, table[np.abs(table[:, 0]) < 0.02]]))
    more = np.concatenate([neck, shoulder[ring[:, 1] > 0.0], body[ring[:, 1] > 0.0]]) + (0.004, 0.012, -0.005)
    axis = np.array([0.0, np.sin(lean), -np.cos(lean)])
    shift = shift_between(before, View(more, np.concatenate([more, table])), axis)
    np.testing.assert_allclose(shift, [0.004, 0.012, -0.005], atol=0.002)


def test_fingers_that_would_be_in_a_wall_are_not_proposed() -> None:
    can = things.can()
    free = Antipodal().propose(can, can.points, hand(DOWN))
    wall = np.column_stack(
        [
            np.repeat(np.linspace(0.4, 0.7, 60), 60),
            np.full(3600, things.CAN[1] + 0.047),
            np.tile(np.linspace(0.0, 0.4, 60), 60),
        ]
    )
    beside = Antipodal().propose(can, np.concatenate([can.points, wall]), hand(DOWN))
    assert len(free) > 10

    def touched(grasps: list) -> int:
        return sum(bool(collides(g.T_odom_gripper[None], np.array([g.gap]), wall)[0]) for g in grasps)

    assert touched(free) > len(free) // 2
    assert touched(beside) == 0


def test_it_draws_the_same_grasps_again_and_others_with_another_seed() -> None:
    can = things.can()
    first, again, other = (
        Antipodal(AntipodalConfig(seed=seed)).propose(can, can.points, hand(DOWN)) for seed in (0, 0, 1)
    )
    assert [g.score for g in first] == [g.score for g in again]
    assert [g.score for g in first] != [g.score for g in other]


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.full((500, 3), np.nan), np.zeros((500, 3))])
def test_a_cloud_that_holds_no_object_has_no_grasp(points: Array) -> None:
    assert Antipodal().propose(things.seen(points, np.zeros(3)), points, hand(DOWN)) == []


def test_a_position_that_is_not_finite_is_refused() -> None:
    with pytest.raises(NotFinite, match="position"):
        Antipodal().propose(things.seen(np.zeros((0, 3)), np.full(3, np.nan)), np.zeros((0, 3)), hand(DOWN))


def test_a_scene_with_nan_is_no_wall() -> None:
    can = things.can()
    scene = np.concatenate([can.points, np.full((200, 3), np.nan)])
    assert len(Antipodal().propose(can, scene, hand(DOWN))) > 10


def test_an_upside_down_hand_is_turned() -> None:
    T = np.eye(4)
    T[:3, :3] = np.column_stack([(0, 0, 1.0), (0, -1.0, 0), (1.0, 0, 0)])
    (turned,) = upright(T[None], 0.0)
    np.testing.assert_array_equal(turned[:3, 0], [0, 0, -1])
    np.testing.assert_array_equal(turned[:3, 2], [1, 0, 0])


def test_a_friction_that_cannot_be_meant_is_refused() -> None:
    with pytest.raises(ConfigError, match="friction is from 0 to 2"):
        AntipodalConfig(friction=-1.0)
