"""What taking and placing see of a surface, where a hand is sent, and which goals they refuse."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from golem.capabilities.arms.base import ARM_COLUMNS
from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.navigation.edge_fit import NearEdge
from golem.capabilities.planning.base import PlanRefused, Refusal
from golem.capabilities.properties.base import holding_force
from golem.capabilities.properties.property_table import PropertyTable
from golem.errors import ConfigError
from golem.interfaces import topics
from golem.interfaces.payloads import ArmCommand, GripState, HandStatus
from golem.skills.base import StageFailed
from golem.skills.context import Context
from golem.skills.fetch import STANDOFF, before, stance
from golem.skills.place import PICTURE, PlaceGoal, SetDown
from golem.skills.planned_motion import PlannedMotion
from golem.skills.runner import SkillRun
from golem.skills.take import Take
from golem.skills.take_config import TakeGoal, TakeThingConfig
from golem.skills.ware_sight import leaning_surface, seen_again, surface_below
from golem.types import NUM_JOINTS, UPPER, Array, Detection, Imu, LocalizedObject, LowState, PlanarPose, Side

TOP = -0.15


def table_with_can(at: tuple[float, float] = (0.5, -0.2)) -> tuple[Array, Array]:
    """Return the points of a table and those of the lid and wall of a can on it."""
    rng = np.random.default_rng(0)
    table = np.column_stack([rng.uniform((0.3, -0.5), (0.8, 0.2), (6000, 2)), np.full(6000, TOP)])
    turn, height = rng.uniform(0, 2 * np.pi, 3000), rng.uniform(0.0, 0.12, 3000)
    can = np.column_stack([at[0] + 0.034 * np.cos(turn), at[1] + 0.034 * np.sin(turn), TOP + height])
    noise = 0.001 * rng.standard_normal((9000, 3))
    return table + noise[:6000], can + noise[6000:]


def can_at(points: Array) -> LocalizedObject:
    box = np.array([0.0, 0.0, 9.0, 9.0])
    return LocalizedObject(Detection("can", 0.9, box, box[:2]), 0.0, np.median(points, axis=0), points)


def at_home(world: Any) -> None:
    q, zero = np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS)
    q[UPPER] = POSTURES["home"]
    still = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))
    world.bus.publish(topics.LOW_STATE, LowState(0.0, q, zero, zero, still), 0.0)


def test_the_surface_is_the_fullest_layer() -> None:
    table, can = table_with_can()
    level = surface_below(np.concatenate([table, can]), np.array([0.5, -0.2, 0.0]))
    assert level == pytest.approx(TOP, abs=0.002)
    assert surface_below(table, np.array([5.0, 0.0, 0.0])) is None


def test_the_palm_camera_finds_it_beside_where_it_seemed() -> None:
    table, can = table_with_can()
    found = seen_again(np.concatenate([table, can]), can_at(can + (0.06, 0.03, 0.01)), trust=0.15)
    assert found is not None
    seen, upright = found
    np.testing.assert_allclose(upright, [0.0, 0.0, 1.0], atol=0.01)
    assert np.median(seen.points, axis=0)[:2] == pytest.approx([0.5, -0.2], abs=0.01)
    assert seen.points[:, 2].min() > TOP + 0.008
    assert seen_again(table, can_at(can), trust=0.15) is None
    assert seen_again(np.zeros((0, 3)), can_at(can), trust=0.15) is None


def test_the_palm_camera_tells_things_apart_that_stand_close_to_each_other() -> None:
    table, can = table_with_can()
    _, other = table_with_can((0.5, -0.2 + 2 * 0.034 + 0.018))
    found = seen_again(np.concatenate([table, can, other]), can_at(can + (0.01, -0.02, 0.0)), trust=0.15)
    assert found is not None
    assert np.median(found[0].points, axis=0)[:2] == pytest.approx([0.5, -0.2], abs=0.01)


def test_of_what_stands_there_that_of_the_right_size_is_taken() -> None:
    table, can = table_with_can()
    rng = np.random.default_rng(2)
    turn, height = rng.uniform(0, 2 * np.pi, 3000), rng.uniform(0.0, 0.06, 3000)
    bowl = np.column_stack([0.5 + 0.08 * np.cos(turn), 0.02 + 0.08 * np.sin(turn), TOP + height])
    points = np.concatenate([table, can, bowl])
    expected = can_at(can + (0.0, 0.12, 0.0))  # the head camera is off, and has it beside the bowl
    for size, y in ((None, 0.02), ((0.07, 0.12), -0.2), ((0.16, 0.06), 0.02), ((0.3, 0.4), 0.02)):
        found = seen_again(points, expected, 0.15, size)
        assert found is not None
        assert np.median(found[0].points, axis=0)[1] == pytest.approx(y, abs=0.03)


def test_a_tuned_force_is_what_the_thing_asks_for(world: Any) -> None:
    at_home(world)
    world.objects["head"] = lambda: []
    force: dict[bool, float] = {}
    for tuned in (False, True):
        skill = Take(TakeThingConfig(turn=0.0, tuned=tuned))
        world.run(skill.run(world.context, TakeGoal("mug")))
        force[tuned] = skill.force
    thing = PropertyTable().properties("mug")
    assert force == {False: 16.0, True: pytest.approx(holding_force(thing, 2.0, 0.004))}
    refused = world.run(Take(TakeThingConfig(tuned=True)).run(world.context, TakeGoal("teapot"))).result
    assert refused.stage == "refused" and "Unknown thing 'teapot'; valid: " in refused.reason


def test_a_hand_whose_encoders_are_off_sees_what_is_upright() -> None:
    table, can = table_with_can()
    lean = Rotation.from_euler("x", 0.09)
    points = lean.apply(np.concatenate([table, can]))
    found = seen_again(points, can_at(lean.apply(can)), trust=0.15)
    assert found is not None
    seen, upright = found
    np.testing.assert_allclose(upright, lean.apply([0.0, 0.0, 1.0]), atol=0.01)
    # What is left is the can, not the higher side of the table.
    assert np.ptp(seen.points[:, 0]) < 0.08 and np.ptp(seen.points[:, 1]) < 0.09


def test_from_above_a_cap_and_the_shoulder_below_it_are_one_thing() -> None:
    table, _ = table_with_can()
    rng = np.random.default_rng(1)
    turn, radius = rng.uniform(0, 2 * np.pi, 2000), np.sqrt(rng.uniform(0.0, 1.0, 2000))
    cap = np.column_stack([0.5 + 0.015 * radius * np.cos(turn), 0.015 * radius * np.sin(turn), 0.0 * turn + 0.22])
    ring = 0.016 + 0.019 * radius
    shoulder = np.column_stack([0.5 + ring * np.cos(turn), ring * np.sin(turn), 0.17 - 1.2 * (ring - 0.016)])
    bottle = np.concatenate([cap, shoulder]) + (0.0, -0.2, TOP)
    found = seen_again(np.concatenate([table, bottle]), can_at(bottle - (0.0, 0.0, 0.1)), trust=0.15)
    assert found is not None
    assert len(found[0].points) == len(bottle)
    # What is grasped is at its top.
    assert found[0].position[2] > TOP + 0.2


def test_a_lid_before_the_camera_is_not_the_surface() -> None:
    table, _ = table_with_can()
    rng = np.random.default_rng(1)
    lid = np.column_stack([rng.uniform((0.47, -0.23), (0.53, -0.17), (60000, 2)), np.full(60000, TOP + 0.12)])
    surface = leaning_surface(np.concatenate([table, lid]))
    assert surface is not None
    assert surface[1] == pytest.approx(TOP, abs=0.002)
    assert leaning_surface(np.zeros((0, 3))) is None


def test_nothing_is_taken_where_nothing_is_seen(world: Any) -> None:
    world.objects["head"] = lambda: []
    at_home(world)
    result = world.run(Take(TakeThingConfig(turn=0.0)).run(world.context, TakeGoal("mug"))).result
    assert (result.success, result.stage, result.slot) == (False, "detect", "localizer")
    assert result.reason == "The head camera shows no mug."
    assert world.bus.latest(topics.hand_goal("right")) is None


@pytest.mark.parametrize("raises", [True, False])
def test_an_arm_that_hangs_low_is_raised_before_the_torso_turns(
    world: Any, monkeypatch: pytest.MonkeyPatch, raises: bool
) -> None:
    at_home(world)
    low = POSTURES["home"].copy()
    low[ARM_COLUMNS["right"]] += 0.5
    world.bus.publish(topics.ARM_COMMAND, ArmCommand(low, np.zeros(2), np.zeros(2), False), 0.0)
    world.objects["head"] = lambda: []
    moves: list[tuple[tuple[str, ...], Array]] = []

    async def to_joints(motion: PlannedMotion, goal: Array, sides: Sequence[Side], hand_speed: float) -> None:
        assert motion.world.cloud is not None  # it has looked
        moves.append((tuple(sides), goal))
        if sides and not raises:
            raise PlanRefused(Refusal.GOAL, "Something is in the way.")

    monkeypatch.setattr(PlannedMotion, "to_joints", to_joints)
    result = world.run(Take(TakeThingConfig(turn=0.4)).run(world.context, TakeGoal("mug"))).result
    assert result.reason == "The head camera shows no mug."
    assert [sides for sides, _ in moves] == ([("right",), (), (), ()] if raises else [("right",)])
    turns = [0.0, 0.4, -0.4, 0.0]  # in the end it looks ahead again: the next take turns from there
    for (_, goal), turn in zip(moves, turns[: len(moves)], strict=True):
        np.testing.assert_allclose(goal, POSTURES["home"] + turn * np.eye(15)[0], atol=1e-9)


def test_both_hands_go_home_that_were_tried_in_vain(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    at_home(world)
    _, can = table_with_can()
    world.objects["head"] = lambda: [can_at(can)]
    raised, rested = list[str](), list[str]()

    async def to_joints(motion: PlannedMotion, goal: Array, sides: Sequence[Side], hand_speed: float) -> None:
        raised.extend(sides)

    async def rest(motion: PlannedMotion, goal: Array, side: Side, hand_speed: float, stage: str) -> None:
        rested.append(side)

    async def propose(*_: object) -> list[object]:
        return []

    monkeypatch.setattr(PlannedMotion, "to_joints", to_joints)
    monkeypatch.setattr(PlannedMotion, "rest", rest)
    monkeypatch.setattr(Context, "propose", propose)
    result = world.run(Take(TakeThingConfig(look_again=False)).run(world.context, TakeGoal("can"))).result
    assert result.reason == "No grasp was proposed for the can."
    assert raised == ["right", "left"] * 2 and rested == ["left", "right"]


@pytest.mark.parametrize("side", ["right", "either"])
def test_a_hand_that_holds_something_does_not_let_it_fall_for_another_thing(
    world: Any, monkeypatch: pytest.MonkeyPatch, side: Any
) -> None:
    at_home(world)
    _, can = table_with_can()
    world.objects["head"] = lambda: [can_at(can)]
    world.grips, asked = [True], list[str]()
    world.context.hands["right"].close(5.0)
    for _ in range(20):
        world.step()
    assert world.holds

    async def come(take: Take, context: Context, *given: Any) -> None:
        asked.append(given[3])
        raise StageFailed("approach", "planner", "There is no way.")

    monkeypatch.setattr(Take, "_come", come)
    result = world.run(Take().run(world.context, TakeGoal("can", side))).result
    assert asked == ([] if side == "right" else ["left", "left"])
    assert (result.success, result.stage) == (False, "approach") and world.holds
    assert side == "either" or result.reason == "The right hand already holds something."


def test_an_empty_hand_places_nothing(world: Any) -> None:
    result = world.run(SetDown().run(world.context, PlaceGoal(0.4, 0.0))).result
    assert (result.stage, result.reason) == ("detect", "Neither hand holds anything.")


def test_what_is_held_stays_held_where_no_surface_is_seen(world: Any) -> None:
    held = HandStatus(0.0, GripState.HOLDING, 0.06, 0.0, np.zeros(2))
    at_home(world)
    run = SkillRun("place", SetDown().run(world.context, PlaceGoal(0.4, 0.0)))
    world.step()
    world.bus.publish(topics.hand_status("right"), held, world.t)
    world.bus.deliver(world.t + 1.0)
    run.step()
    assert run.result is not None
    assert run.result.reason == "The head camera shows no surface at that place."
    assert world.bus.latest(topics.hand_goal("right")) is None


def test_the_place_is_looked_at_anew_since_the_last_picture_has_the_thing_where_it_stood(
    world: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_home(world)
    asked: list[float] = []

    def see() -> list[LocalizedObject]:
        asked.append(world.t)
        return []

    world.objects["head"] = see
    monkeypatch.setattr(SetDown, "_holder", lambda *_: "right")
    for label in ("", "bowl"):
        began = world.t
        result = world.run(SetDown().run(world.context, PlaceGoal(0.4, 0.0, label=label))).result
        assert result.reason == "The head camera shows no surface at that place."
        assert bool(asked) == bool(label) and all(t >= began for t in asked)


def test_by_an_old_picture_nothing_is_set_down(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    at_home(world)
    monkeypatch.setattr(SetDown, "_holder", lambda *_: "right")
    began = world.t
    result = world.run(SetDown().run(world.context, PlaceGoal(0.4, 0.0, label="bowl"))).result
    assert (result.stage, result.slot) == ("detect", "localizer") and "No new picture" in result.reason
    assert world.t - began < PICTURE + 0.1


def test_what_does_not_stand_where_it_was_set_down_is_not_done() -> None:
    table, can = table_with_can()
    goal, spot = PlaceGoal(0.5, -0.2, below=0.08, above=0.04, radius=0.034), np.array([0.5, -0.2, TOP])

    def looked(points: Array) -> str:
        try:
            SetDown()._stands(cast(Context, SimpleNamespace(scene=lambda camera: points)), goal, spot)
        except StageFailed as failure:
            return str(failure)
        return ""

    lying = can[:, [0, 2, 1]] - can[:, [0, 2, 1]].mean(axis=0) + (0.5, -0.2, TOP + 0.034)
    assert looked(np.concatenate([table, can])) == ""
    assert looked(table) == "Nothing stands where it was set down."
    assert "12 cm high is 7 cm now: it fell over." in looked(np.concatenate([table, lying]))
    assert looked(np.zeros((0, 3))) == ""  # not seen is not known
    assert looked(np.concatenate([table, can + (0.0, 0.2, 0.0)])) != ""  # it stands elsewhere


def test_a_place_at_the_edge_is_refused(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    at_home(world)
    table, _ = table_with_can()
    xy = np.random.default_rng(3).uniform((0.0, -0.5), (0.3, 0.2), (6000, 2))
    scene = np.concatenate([table, np.column_stack([xy, np.full(6000, -1.0)])])
    monkeypatch.setattr(SetDown, "_scene", lambda *_: scene)
    motion, context = PlannedMotion(world.context), world.context
    inside = SetDown()._spot(context, motion, PlaceGoal(0.45, -0.2, radius=0.08), "right")
    assert inside[2] == pytest.approx(TOP, abs=0.002)
    with pytest.raises(StageFailed, match="ends within the width"):
        SetDown()._spot(context, motion, PlaceGoal(0.34, -0.2, radius=0.08), "right")


def test_a_stance_is_before_the_place_and_straight_to_the_edge() -> None:
    edge = NearEdge(PlanarPose(1.0, 0.3, 0.2), 2.0, 0.003, 40)
    here, place = PlanarPose(2.0, 1.0, 0.5), np.array([0.15, 0.5])
    goal = edge.pose @ PlanarPose(place[0], place[1], 0.0)
    spot = here @ goal
    there = stance(edge, here, np.array([spot.x, spot.y]))
    across = edge.pose.to(there)
    assert across.yaw == pytest.approx(0.0) and STANDOFF[0] <= -across.x <= STANDOFF[1]
    assert abs(across.y - 0.5) <= 0.16 + 1e-9
    facing = before(PlanarPose(0.0, 0.0, 0.0), np.array([0.0, 2.0]), 0.5)
    assert (facing.x, facing.y, facing.yaw) == pytest.approx((0.0, 1.5, np.pi / 2))


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        (TakeGoal, {"label": ""}),
        (TakeGoal, {"label": "mug", "near": (1.0,)}),
        (TakeGoal, {"label": "mug", "near": (1.0, float("nan"))}),
        (PlaceGoal, {"x": float("inf"), "y": 0.0}),
        (PlaceGoal, {"x": 0.4, "y": 0.0, "below": 2.0}),
        (PlaceGoal, {"x": 0.4, "y": 0.0, "aside": (0.1,)}),
        (PlaceGoal, {"x": 0.4, "y": 0.0, "off": (0.1, float("nan"))}),
    ],
)
def test_a_goal_without_sense_is_refused(kind: type[Any], wrong: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        kind(**wrong)
