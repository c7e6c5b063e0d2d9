"""The pick skill, stage by stage, in a scripted world: each failure is named, and leaves the robot safe."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from golem.capabilities.grasping.base import Grasp, GraspMethod, Gripper, OpenLoop, ServoStatus, ServoStep
from golem.capabilities.grasping.centroid import Centroid, CentroidConfig
from golem.capabilities.grasping.visual_servo import VisualServo
from golem.capabilities.perception.open_box import OpenBox
from golem.capabilities.planning.base import PlanRefused, Refusal
from golem.errors import ConfigError
from golem.interfaces import topics
from golem.interfaces.payloads import DetectionRequest, GripState
from golem.robots.model.magpie_model import MAX_GAP
from golem.skills.base import SkillResult, StageFailed
from golem.skills.pick import Pick, PickConfig, PickGoal, followed
from golem.skills.pick_config import Hand
from golem.skills.pick_targets import called
from golem.skills.runner import SkillRun
from golem.skills.travel import LineTravel
from golem.types import Array, CameraInfo, LocalizedObject, RgbdImage, Side

SCREW = np.array([0.43, -0.14, -0.03])
TRAY = np.array([0.48, -0.31, -0.03])
HEAD_ERROR = np.array([0.02, -0.015, 0.01])
CONFIG = PickConfig(travel="lines", turn=0.0, look_timeout=0.5, close_timeout=0.5)


def stocked(world: Any, thing: Any, screw: Array = SCREW, tray: Array = TRAY) -> Any:
    """Fill the world: the head camera is off, the palm cameras are right, every closing holds."""
    world.objects["head"] = lambda: [
        thing("screw", screw + HEAD_ERROR, world.t),
        thing("tray", tray + HEAD_ERROR, world.t),
    ]
    for side in ("left", "right"):
        world.objects[f"{side}_hand"] = lambda: [thing("screw", screw, world.t)]
    world.grips = [True] * 5
    return world


@pytest.fixture
def full(world: Any, thing: Any) -> Any:
    """A world with a screw and a tray."""
    return stocked(world, thing)


def refusing(refusal: Refusal) -> Any:
    """Return a way over an object that is always refused; its `shares` are those that were asked for."""

    async def over(travel: LineTravel, side: Side, T: Array, clearance: float, share: float, speed: float) -> None:
        over.shares.append(share)  # pyright: ignore[reportFunctionMemberAccess]
        raise StageFailed("approach", "planner", "Not so.") from PlanRefused(refusal, "Not so.")

    over.shares = list[float]()  # pyright: ignore[reportFunctionMemberAccess]
    return over


def picked(
    world: Any, method: GraspMethod | None = None, side: Hand = "right", config: PickConfig = CONFIG, **goal: Any
) -> SkillResult:
    """Run a pick to its end."""
    world.method = method or VisualServo()
    run = world.run(Pick(config).run(world.context, PickGoal(side=side, **goal)))
    assert run.result is not None
    return run.result


def assert_safe(world: Any, side: Side = "right") -> None:
    """Check that every camera sleeps, the hand was told to open, and the arm was sent home."""
    for camera in world.objects:
        assert world.bus.latest(topics.detection_request(camera)) in (None, DetectionRequest())
    goal = world.bus.latest(topics.hand_goal(side))
    assert goal is not None and goal.gap is not None
    np.testing.assert_allclose(world.context.arms[side].commanded[:3, 3], [0.35, -0.2, 0.1], atol=1e-9)


def failed(result: SkillResult, stage: str, slot: str, words: str, outcome: str = "") -> None:
    """Check how a pick failed."""
    assert (result.success, result.stage, result.slot) == (False, stage, slot), result
    assert outcome in ("", result.value.outcome), result
    assert words in result.reason
    assert result.timings["total"] > 0.0 and "start" not in result.timings


def test_a_pick_goes_through_its_stages(full: Any) -> None:
    result = picked(full)
    assert (result.success, result.stage, result.slot) == (True, "done", None), result
    full.step()
    assert full.stages == ["detect", "approach", "servo", "grasp", "extract", "place", "done"]
    assert 0.0 < result.timings["detect_to_grasp"] < result.timings["total"]
    assert set(result.timings) == {"detect_to_grasp", "total"}
    assert_safe(full)


def test_the_hand_closes_where_the_palm_camera_saw_the_screw(full: Any) -> None:
    seen_at: list[Array] = []
    tick = full.step

    def step() -> None:
        tick()
        goal = full.bus.latest(topics.hand_goal("right"))
        if goal is not None and goal.gap is None and not seen_at:
            seen_at.append(full.context.arms["right"].commanded[:3, 3].copy())

    full.step = step
    picked(full)
    assert np.linalg.norm((seen_at[0] - SCREW)[:2]) < 0.003


def let_go_at(world: Any, **goal: Any) -> Array:
    """Return where a pick let go, (3,) in odom."""
    let_go: list[Array] = []
    tick = world.step

    def step() -> None:
        held = world.holds
        tick()
        goal = world.bus.latest(topics.hand_goal("right"))
        if held and goal is not None and goal.gap is not None and not let_go:
            let_go.append(world.context.arms["right"].commanded[:3, 3].copy())

    world.step = step
    picked(world, **goal)
    return let_go[0]


def test_the_screw_is_let_go_above_the_tray_however_much_the_head_camera_is_off(full: Any) -> None:
    np.testing.assert_allclose(let_go_at(full), TRAY + (0.0, 0.0, CONFIG.drop_height), atol=1e-9)


def test_what_no_hand_brings_to_the_tray_is_set_back_where_it_was_taken(full: Any, monkeypatch: Any) -> None:
    carry = LineTravel.carry

    async def refused(self: LineTravel, side: Side, goals: list[Array], speed: float) -> None:
        if all(np.linalg.norm((T[:3, 3] - TRAY)[:2]) < 0.1 for T in goals):
            raise StageFailed("place", "upper_body", "No way to there.")
        await carry(self, side, goals, speed)

    monkeypatch.setattr(LineTravel, "carry", refused)
    at = let_go_at(full)
    assert np.linalg.norm((at - SCREW)[:2]) < 0.003
    assert at[2] - SCREW[2] < 0.02
    assert_safe(full)


def test_what_one_hand_brings_nowhere_is_set_back_and_the_other_hand_brings_it(
    world: Any, thing: Any, monkeypatch: Any
) -> None:
    screw, tray = np.array([0.43, 0.08, -0.03]), np.array([0.5, -0.07, -0.03])
    carry, carried = LineTravel.carry, list[Side]()

    async def refused(self: LineTravel, side: Side, goals: list[Array], speed: float) -> None:
        if not carried:
            carried.append(side)
            raise StageFailed("place", "planner", "The robot touches itself.")
        await carry(self, side, goals, speed)
        carried.append(side)

    monkeypatch.setattr(LineTravel, "carry", refused)
    result = picked(stocked(world, thing, screw=screw, tray=tray), side="either")
    assert result.success, result
    assert [one.outcome for one in result.value.tried] == ["failed", "picked"]
    assert result.value.tried[0].side != result.value.tried[1].side == carried[-1]


def test_a_hand_leans_where_it_reaches_no_place_in_the_tray_straight(full: Any, monkeypatch: Any) -> None:
    carry, leans = LineTravel.carry, list[Array]()

    async def leaning(self: LineTravel, side: Side, goals: list[Array], speed: float) -> None:
        leans.extend(T[:3, 2] for T in goals if T[2, 2] > -0.99)
        await carry(self, side, [T for T in goals if T[2, 2] > -0.99], speed)

    monkeypatch.setattr(LineTravel, "carry", leaning)
    np.testing.assert_allclose(let_go_at(full), TRAY + (0.0, 0.0, CONFIG.drop_height), atol=1e-9)
    assert all(fingers[:2] @ TRAY[:2] > 0.3 * np.linalg.norm(TRAY[:2]) for fingers in leans)


def test_a_neighbour_of_the_one_that_is_wanted_is_let_go_above_the_tray_too(full: Any, thing: Any) -> None:
    beside = SCREW + (0.0, 0.09, 0.0)
    see = full.objects["head"]
    full.objects["head"] = lambda: [*see(), thing("screw", beside + HEAD_ERROR, full.t)]
    full.objects["right_hand"] = lambda: [thing("screw", beside, full.t)]
    at = let_go_at(full, wanted=tuple((SCREW + HEAD_ERROR)[:2].tolist()))
    assert np.linalg.norm((at - TRAY)[:2]) < 0.03


def test_what_stands_on_another_level_is_not_what_is_wanted(full: Any, thing: Any) -> None:
    here, level = tuple((SCREW + HEAD_ERROR)[:2].tolist()), float((SCREW + HEAD_ERROR)[2])
    assert picked(full, wanted=here, level=(level,)).success
    stocked(full, thing)
    # The hand looks where it is listed, and does not take what stands higher.
    failed(picked(full, wanted=here, level=(level - 0.065,)), "servo", "localizer", "lost the screw", "nothing_there")


def test_what_the_head_camera_does_not_see_is_looked_for_by_the_hand_where_it_is_listed(full: Any, thing: Any) -> None:
    here, level = tuple((SCREW + HEAD_ERROR)[:2].tolist()), float((SCREW + HEAD_ERROR)[2])
    seen = full.objects["head"]
    full.objects["head"] = lambda: [one for one in seen() if one.label != "screw"]
    failed(picked(full, wanted=here), "detect", "localizer", "no reachable", "nothing_there")
    tick, texts = full.step, set[str]()

    def step() -> None:
        tick()
        texts.add(full.bus.latest(topics.FEEDBACK).text)

    full.step = step
    assert picked(full, wanted=here, level=(level,)).success
    assert not any("Looking around" in text for text in texts)


def test_what_is_nearer_to_another_of_the_list_is_not_what_is_wanted(full: Any, thing: Any) -> None:
    wanted, pitch = SCREW + HEAD_ERROR, np.array([0.0, 0.043, 0.0])
    see = full.objects["head"]
    full.objects["head"] = lambda: [replace(o, position=o.position + pitch) if o.label == "screw" else o for o in see()]
    full.objects["right_hand"] = lambda: [thing("screw", SCREW + p, full.t) for p in (0.0 * pitch, pitch)]
    where = {"wanted": tuple(wanted[:2].tolist()), "level": (float(wanted[2]),)}
    # The head camera shows the neighbour alone; the hand looks where the other is listed.
    result = picked(full, **where, landmarks=tuple(np.concatenate([wanted, wanted + pitch]).tolist()))
    assert result.success and abs(result.value.tried[0].y - SCREW[1]) < 0.005


def test_a_neighbour_is_not_taken_where_it_is_known_what_the_palm_camera_is_off_by(full: Any, thing: Any) -> None:
    here, off = tuple((SCREW + HEAD_ERROR)[:2].tolist()), tuple((-HEAD_ERROR)[:2].tolist())
    assert picked(full, wanted=here, off=off).success
    stocked(full, thing)
    full.objects["right_hand"] = lambda: [thing("screw", SCREW + (0.0, 0.05, 0.0), full.t)]
    failed(picked(full, wanted=here, off=off), "servo", "localizer", "lost the screw", "nothing_there")


@pytest.mark.parametrize(
    ("seen", "off", "goes"),
    [
        ((0.02, 0.08), (0.02, 0.03), (0.02, 0.03)),  # one half of it: the whole is where its shape is
        ((0.0, 0.05), (0.01, 0.02), (0.0, 0.0)),  # near enough
        ((0.2, 0.13), (0.2, 0.13), (0.0, 0.0)),  # another one
    ],
)
def test_a_hand_lets_go_where_the_palm_camera_shows_the_shape_of_the_tray(
    full: Any, thing: Any, monkeypatch: pytest.MonkeyPatch, seen: Array, off: Array, goes: Array
) -> None:
    let_go: list[Array] = []
    tick, box = full.step, OpenBox(TRAY[:2], 0.0, np.array([0.14, 0.22]), float(TRAY[2]) + 0.04, float(TRAY[2]))

    def find(wanted: OpenBox, points: Array, around: Sequence[Array]) -> OpenBox | None:
        near = min(np.linalg.norm(at - TRAY[:2] - off) for at in around)
        return replace(wanted, center=TRAY[:2] + off) if near < 0.07 else None

    monkeypatch.setattr("golem.skills.container.fit_open_box", lambda _: box)
    monkeypatch.setattr("golem.skills.pick_place.find_box", find)
    full.objects["right_hand"] = lambda: [
        thing("screw", SCREW, full.t), thing("tray", TRAY + (*seen, 0.0), full.t, 0.15)
    ]  # fmt: skip

    def step() -> None:
        held = full.holds
        tick()
        goal = full.bus.latest(topics.hand_goal("right"))
        if held and goal is not None and goal.gap is not None and not let_go:
            let_go.append(full.context.arms["right"].commanded[:3, 3].copy())

    full.step = step
    result = picked(full)
    assert result.success
    np.testing.assert_allclose(let_go[0][:2], TRAY[:2] + goes, atol=0.002)
    there = [] if seen[0] == 0.2 else TRAY[:2] + goes - np.array(off)  # the palm camera did not see what is below it
    np.testing.assert_allclose(result.value.let_go, there, atol=0.002)


@pytest.mark.parametrize("turned", [0.0, 0.5 * np.pi, -2.0])
def test_the_hand_has_its_heading_from_where_the_robot_faces(
    turned: float, full: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The map of reach is of one heading in base_link: beside a pack the robot faces another way than in odom."""
    asked = list[float]()

    class Recording(Centroid):
        def propose(self, target: Any, scene: Any, gripper: Gripper) -> list[Grasp]:
            asked.append(gripper.yaw)
            return super().propose(target, scene, gripper)

    monkeypatch.setattr(type(full.context), "heading", turned)
    picked(full, Recording())
    np.testing.assert_allclose(asked[0], turned + CONFIG.heading("right"))


def test_the_extraction_is_straight_and_slow(full: Any) -> None:
    picked(full)
    path = np.array([T[:3, 3] for T in full.sent])
    lowest = int(np.argmin(path[:, 2]))
    pull = path[lowest:]
    pull = pull[pull[:, 2] < path[lowest, 2] + CONFIG.pull]
    assert np.ptp(pull[:, 0]) < 1e-3 and np.ptp(pull[:, 1]) < 1e-3
    speed = np.linalg.norm(np.diff(pull, axis=0), axis=1) / 0.01
    assert speed.max() <= CONFIG.pull_speed * (1 + 1e-6) + 1e-9


def test_the_hand_never_travels_across_below_its_travel_height(full: Any) -> None:
    picked(full, Centroid())
    path = np.array([T[:3, 3] for T in full.sent])
    across = np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1) / 0.01
    assert path[1:][across > 0.02][:, 2].min() > CONFIG.travel_height - 1e-9


def test_the_left_hand_is_the_mirror_of_the_right(world: Any, thing: Any) -> None:
    flip = np.array([1.0, -1.0, 1.0])
    stocked(world, thing, screw=SCREW * flip, tray=TRAY * flip)
    result = picked(world, side="left")
    assert result.success, result


def test_of_several_screws_the_most_comfortable_is_taken(world: Any, thing: Any) -> None:
    stocked(world, thing)
    near = np.array([*CONFIG.comfort, -0.03])
    others = [near + (0.1, 0.0, 0.0), near, near + (0.0, 0.15, 0.0)]
    world.objects["head"] = lambda: [thing("screw", p, world.t) for p in others] + [thing("tray", TRAY, world.t)]
    proposals: list[Array] = []

    class Spy(Centroid):
        def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:
            proposals.append(target.position)
            return super().propose(target, scene, gripper)

    picked(world, Spy())
    np.testing.assert_array_equal(proposals[0], near)


def test_a_method_gets_the_scene_and_the_hand_in_numbers(full: Any) -> None:
    info = CameraInfo("head", 4, 3, 100.0, 100.0, 1.5, 1.0, near=0.2, far=6.0, rate=15.0)
    depth = np.full((3, 4), 2.0, np.float32)
    depth[0, 0] = np.nan
    depth[1, 2] = 0.0
    frame = RgbdImage(0.0, info, np.zeros((3, 4, 3), np.uint8), depth, np.eye(4))
    full.bus.publish(topics.rgbd_images("head"), frame, 0.0)
    given: list[tuple[Array, Gripper]] = []

    class Spy(Centroid):
        def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:
            given.append((scene, gripper))
            return super().propose(target, scene, gripper)

    assert picked(full, Spy()).success
    ((scene, gripper),) = given
    assert scene.shape == (10, 3)
    np.testing.assert_allclose(scene[0], (-0.5 / 100.0 * 2.0, -1.0 / 100.0 * 2.0, 2.0))
    assert (gripper.side, gripper.yaw, gripper.max_gap) == ("right", CONFIG.yaw, MAX_GAP)
    np.testing.assert_array_equal(gripper.T_odom_gripper[:3, 3], (0.35, -0.2, 0.1))


def test_a_slow_method_costs_the_time_that_it_declares(world: Any, thing: Any) -> None:
    class Slow(Centroid):
        latency = 0.5

    took: list[float] = []
    for method in (Centroid(), Slow()):
        stocked(world, thing)
        result = picked(world, method)
        assert result.success
        took.append(result.timings["detect_to_grasp"])
    assert took[1] - took[0] == pytest.approx(0.5, abs=0.08)  # a frame of the head camera more or less


def test_a_method_that_thinks_on_a_worker_stops_no_clock(full: Any) -> None:
    thought = threading.Event()

    class Waits(Centroid):
        def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:
            assert thought.wait(30.0)
            return super().propose(target, scene, gripper)

    full.method = Waits(CentroidConfig())
    with ThreadPoolExecutor(1) as pool:
        full.context.modules = replace(full.context.modules, worker=pool)
        run = SkillRun("pick", Pick(CONFIG).run(full.context, PickGoal()))
        for _ in range(100):
            full.step()
            run.step()
        assert run.result is None and full.sent == []
        thought.set()
        pool.submit(lambda: None).result()
        for _ in range(6000):
            full.step()
            run.step()
    assert run.result is not None and run.result.success


def test_a_head_camera_that_says_nothing_is_the_localizers_failure(world: Any) -> None:
    failed(picked(world), "detect", "localizer", "no detections in time")
    assert_safe(world)


@pytest.mark.parametrize(
    ("labels", "words", "outcome"),
    [
        (["tray"], "no reachable screw", "nothing_there"),
        (["screw"], "no tray", "tray_missing"),
        ([], "no reachable screw", "nothing_there"),
        (["nut"], "screw", "nothing_there"),
    ],
)
def test_what_is_not_seen_is_named(labels: list[str], words: str, outcome: str, world: Any, thing: Any) -> None:
    world.objects["head"] = lambda: [thing(label, SCREW, world.t) for label in labels]
    failed(picked(world), "detect", "localizer", words, outcome)


@pytest.mark.parametrize("place", [(0.43, 0.25, -0.03), (0.9, -0.1, -0.03), (0.43, -0.14, -0.4)])
def test_what_is_out_of_reach_is_left_alone(place: tuple[float, ...], world: Any, thing: Any) -> None:
    stocked(world, thing, screw=np.array(place))
    failed(picked(world), "detect", "localizer", "no reachable screw", "out_of_reach")
    assert_safe(world)


def test_a_method_without_a_grasp_fails_in_approach(full: Any) -> None:
    class Refuses(OpenLoop):
        latency = 0.0

        def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:
            return []

    failed(picked(full, Refuses()), "approach", "grasp_method", "No grasp was proposed")
    assert_safe(full)


def test_a_screw_the_palm_camera_never_sees_is_lost(full: Any) -> None:
    full.objects["right_hand"] = lambda: []
    failed(picked(full), "servo", "localizer", "lost the screw", "nothing_there")
    assert_safe(full)


def test_a_screw_that_cameras_call_a_nut_is_taken_where_it_is_known_to_stand(full: Any, thing: Any) -> None:
    see = full.objects["head"]
    full.objects["head"] = lambda: [called(one, "nut") if one.label == "screw" else one for one in see()]
    for side in ("left", "right"):
        full.objects[f"{side}_hand"] = lambda: [thing("nut", SCREW, full.t)]
    failed(picked(full), "detect", "localizer", "no reachable screw", "nothing_there")
    here = tuple((SCREW + HEAD_ERROR)[:2].tolist())
    assert picked(full, wanted=here).success
    assert full.bus.latest(topics.detection_request("right_hand")) == DetectionRequest()


def test_a_hand_that_hangs_off_its_goal_is_sent_beyond_it(full: Any) -> None:
    full.kinematics.offset = np.array([0.006, 0.004, 0.0])
    assert picked(full).success
    assert_safe_after_offset(full)


def test_a_hand_that_cannot_follow_stalls(full: Any) -> None:
    full.kinematics.offset = np.array([0.03, 0.0, 0.0])
    result = picked(full)
    assert (result.stage, result.slot) == ("servo", "upper_body"), result
    assert_safe_after_offset(full)


def assert_safe_after_offset(world: Any) -> None:
    goal = world.bus.latest(topics.hand_goal("right"))
    assert goal is not None and goal.gap == CONFIG.release_gap


def test_a_hand_stopped_on_its_way_down_fails_in_descend(full: Any) -> None:
    full.kinematics.offset = np.array([0.0, 0.0, 0.03])
    failed(picked(full, Centroid()), "descend", "localizer", "stopped 30 mm before the grasp")


def test_an_empty_grip_is_tried_again_when_the_method_looks_again(full: Any) -> None:
    full.grips = [False, True]
    assert picked(full).success
    assert full.stages.count("servo") == 2


def test_an_open_loop_method_is_not_tried_again(full: Any) -> None:
    full.grips = [False, True]
    failed(picked(full, Centroid()), "grasp", "grasp_method", "hold nothing (gap 0 mm)")
    assert full.stages == ["detect", "approach", "descend", "grasp"]
    assert_safe(full)


def test_empty_grips_are_a_failure_after_a_second_look(full: Any) -> None:
    full.grips = [False] * 4 + [True]
    result = picked(full)
    failed(result, "grasp", "grasp_method", "hold nothing", "nothing_there")
    assert [one.outcome for one in result.value.tried] == ["nothing_there"] * 2
    assert full.stages.count("detect") >= 2
    assert_safe(full)


@pytest.mark.parametrize("method", [Centroid(), VisualServo()], ids=lambda method: type(method).__name__)
def test_after_a_failure_the_hand_goes_straight_up_before_anything_else(method: GraspMethod, full: Any) -> None:
    """Between walls, fingers that open wide or move sideways press on them."""
    full.grips, tick, told = [False] * 9, full.step, list[tuple[float, float | None]]()

    def step() -> None:
        tick()
        goal = full.bus.latest(topics.hand_goal("right"))
        told.append((float(full.context.arms["right"].commanded[2, 3]), goal and goal.gap))

    full.step = step
    failed(picked(full, method), "grasp", "grasp_method", "hold nothing")
    path = np.array([T[:3, 3] for T in full.sent])
    lowest = len(path) - 1 - int(np.argmin(path[::-1, 2]))
    up = path[lowest:][: int(np.argmax(path[lowest:, 2] > path[lowest, 2] + 0.9 * CONFIG.clearance))]
    assert len(up) > 10 and np.ptp(up[:, :2], axis=0).max() < 1e-3
    low = [gap for height, gap in told if gap is not None and height < path[lowest, 2] + 0.5 * CONFIG.clearance]
    assert low and max(low) < CONFIG.release_gap


def test_what_the_fingers_missed_is_taken_after_a_second_look(full: Any) -> None:
    full.grips = [False, False, True]
    result = picked(full)
    assert result.success, result
    assert [one.outcome for one in result.value.tried] == ["nothing_there", "picked"]


def test_it_does_not_look_again_when_time_is_short(full: Any) -> None:
    full.grips = [False, False, True]
    result = picked(full, config=replace(CONFIG, look_again=0.0))
    failed(result, "grasp", "grasp_method", "hold nothing", "nothing_there")


def test_what_is_tight_is_left_alone_after_a_second_look(full: Any) -> None:
    full.loses = lambda: full.stages[-1:] == ["extract"]
    assert len(picked(full).value.tried) == 1


def test_a_screw_that_slips_while_it_is_pulled(full: Any) -> None:
    full.loses = lambda: full.stages[-1:] == ["extract"]
    result = picked(full)
    failed(result, "extract", "grasp_method", "slipped out", "tight")
    assert np.linalg.norm(np.array([result.value.tried[0].x, result.value.tried[0].y]) - SCREW[:2]) < 0.003
    assert_safe(full)


def test_a_screw_that_rose_before_it_slipped_is_jammed(full: Any, thing: Any) -> None:
    def lifted() -> list[Any]:
        rise = 0.008 if full.stages.count("servo") > 1 else 0.0
        return [thing("screw", SCREW + (0.0, 0.0, rise), full.t)]

    full.objects["right_hand"] = lifted
    full.loses = lambda: full.stages[-1:] == ["extract"]
    failed(picked(full), "extract", "grasp_method", "slipped out", "jammed")


def test_a_screw_lost_on_the_way(full: Any) -> None:
    full.loses = lambda: full.stages[-1:] == ["place"]
    failed(picked(full), "place", "grasp_method", "lost on the way", "slipped")
    assert_safe(full)


def test_a_hand_that_does_not_open_is_named_and_nothing_is_called_dropped(full: Any) -> None:
    tick = full.step

    def step() -> None:
        tick()
        if full.stages[-1:] == ["place"] and full._state["right"] is GripState.OPENING:
            full._moving["right"] = 2

    full.step = step
    failed(picked(full), "place", "hand", "The right hand does not open (gap 10 mm)", "failed")


@pytest.mark.parametrize("called", ["screw", "nut"])
def test_it_looks_afterwards_whether_the_screw_is_there(full: Any, thing: Any, called: str) -> None:
    """In the tray a camera may call it otherwise: where it is known which one is wanted, both count."""

    def seen() -> list[LocalizedObject]:
        dropped = "place" in full.stages and not full.holds
        name, where = (called, TRAY) if dropped else ("screw", SCREW)
        return [thing(name, where + HEAD_ERROR, full.t), thing("tray", TRAY + HEAD_ERROR, full.t)]

    full.objects["head"] = seen
    result = picked(full, wanted=tuple((SCREW + HEAD_ERROR)[:2].tolist()))
    assert result.success and "is seen there" in result.reason
    assert (result.value.in_tray, result.value.bore_empty) == ("yes", "yes")


def test_a_bore_that_still_looks_taken_is_reported(full: Any) -> None:
    result = picked(full)
    assert result.success and "still looks taken" in result.reason
    assert (result.value.in_tray, result.value.bore_empty) == ("unknown", "no")


@pytest.mark.parametrize("aside", [0.004, np.inf])
def test_a_hand_whose_fingers_close_stays_whatever_is_seen_of_what_they_hide(
    full: Any, thing: Any, aside: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tests.skills.conftest.FINGER_TICKS", 200)
    there, step = list[Array](), full.step

    def closing() -> bool:
        return full.stages[-1:] == ["grasp"]

    def seen() -> list[LocalizedObject]:
        off = aside if closing() else 0.0
        return [thing("screw", SCREW + (off, 0.0, 0.0), full.t)] if np.isfinite(off) else []

    def watched() -> None:
        step()
        there.extend(full.sent[-1:] if closing() else ())

    full.objects["right_hand"], full.step = seen, watched
    assert picked(full, config=replace(CONFIG, close_timeout=2.5)).success
    assert len(there) > 3 and np.ptp(there, axis=0).max() < 1e-4


def test_a_neighbour_3_cm_beside_does_not_make_an_empty_bore_look_taken(full: Any, thing: Any) -> None:
    beside = SCREW + (0.0, 0.03, 0.0)

    def seen() -> list[LocalizedObject]:
        left = [beside] if "place" in full.stages and not full.holds else [SCREW, beside]
        return [*(thing("screw", one + HEAD_ERROR, full.t) for one in left), thing("tray", TRAY + HEAD_ERROR, full.t)]

    full.objects["head"] = seen
    result = picked(full, wanted=tuple((SCREW + HEAD_ERROR)[:2].tolist()))
    assert result.value.bore_empty == "yes"


@pytest.mark.parametrize("refusal", [Refusal.GOAL, Refusal.UNREACHABLE])
def test_a_turn_from_which_the_way_down_is_straight_comes_first(full: Any, monkeypatch: Any, refusal: Refusal) -> None:
    tried = list[tuple[float, float]]()
    over = LineTravel.over

    async def some(travel: LineTravel, side: Side, T: Array, clearance: float, share: float, speed: float) -> None:
        tried.append((share, float(np.arctan2(T[1, 0], T[0, 0]))))
        if share > 0.9 and tried[-1][1] != tried[0][1] or share < 0.6:
            return await over(travel, side, T, clearance, share, speed)
        raise StageFailed("approach", "planner", "Not so.") from PlanRefused(refusal, "Not so.")

    monkeypatch.setattr(LineTravel, "over", some)
    assert picked(full).success
    assert [share for share, _ in tried] == [1.0, 1.0] and tried[0][1] != tried[1][1]
    monkeypatch.setattr(LineTravel, "over", never := refusing(refusal))
    failed(picked(full), "approach", "planner", "Not so", "blocked" if refusal is Refusal.GOAL else "out_of_reach")
    assert len(never.shares) == (9 if refusal is Refusal.GOAL else 3)


@pytest.mark.parametrize("share", np.linspace(0.0, 0.99, 12))
def test_a_pick_can_be_cancelled_at_any_time(share: float, world: Any, thing: Any) -> None:
    stocked(world, thing)
    # A whole pick takes about 9 s in this world.
    run = world.run(Pick(CONFIG).run(world.context, PickGoal()), ticks=int(share * 850) + 1)
    assert run.result is None
    held = world.holds
    sent = world.context.arms["right"].commanded.copy()
    run.cancel()
    assert run.result == SkillResult(False, "cancelled", None, "The skill was cancelled.")
    for _ in range(30):
        world.step()
    assert world.holds == held or world.stages[-2:-1] == ["grasp"]
    np.testing.assert_array_equal(world.context.arms["right"].commanded, sent)
    for camera in world.objects:
        assert world.bus.latest(topics.detection_request(camera)) in (None, DetectionRequest())
    assert world.stages[-1] == "cancelled"


def two_screws(world: Any, thing: Any) -> Any:
    """Fill the world: a second screw to the right of the first; the palm camera sees what is below it."""
    second = SCREW + (0.0, 0.09, 0.0)
    stocked(world, thing)
    world.objects["head"] = lambda: [
        thing("screw", SCREW + HEAD_ERROR, world.t),
        thing("screw", second + HEAD_ERROR, world.t),
        thing("tray", TRAY, world.t),
    ]

    def below(side: Side) -> list[LocalizedObject]:
        hand = world.context.arms[side].commanded[:3, 3]
        nearest = min((SCREW, second), key=lambda p: float(np.linalg.norm(p - hand)))
        return [thing("screw", nearest, world.t)]

    world.objects |= {"left_hand": lambda: below("left"), "right_hand": lambda: below("right")}
    return world


def test_a_screw_that_does_not_come_is_left_for_the_next(world: Any, thing: Any) -> None:
    two_screws(world, thing)
    world.grips = [False, False, True]
    result = picked(world)
    world.step()
    assert result.success, result
    assert world.stages.count("approach") == 2
    assert_safe(world)


def test_what_is_to_be_avoided_is_tried_only_where_there_is_no_other(world: Any, thing: Any) -> None:
    two_screws(world, thing)
    first, second = SCREW[:2] + 0.01, SCREW[:2] + (0.0, 0.09)
    for avoid, taken in ((first, second), (second, SCREW[:2]), ((*first, *second), SCREW[:2])):
        result = picked(world, avoid=tuple(float(v) for v in avoid))
        assert result.success
        assert np.hypot(*(np.array((result.value.tried[0].x, result.value.tried[0].y)) - taken)) < 0.02


def test_places_to_avoid_are_pairs_of_numbers() -> None:
    for wrong in ((0.4,), (0.4, float("nan"))):
        with pytest.raises(ConfigError, match="places of a pick are pairs of finite numbers"):
            PickGoal(avoid=wrong)


def test_an_open_loop_method_leaves_no_screw_for_the_next(world: Any, thing: Any) -> None:
    two_screws(world, thing)
    world.grips = [False] * 5
    result = picked(world, Centroid())
    world.step()
    failed(result, "grasp", "grasp_method", "hold nothing")
    assert world.stages.count("approach") == 1


@pytest.mark.parametrize(("flip", "side"), [(1.0, "right"), (-1.0, "left")])
def test_either_hand_is_the_one_on_the_side_of_the_tray(flip: float, side: Side, world: Any, thing: Any) -> None:
    mirror = np.array([1.0, flip, 1.0])
    middle = np.array([0.43, 0.0, -0.03])
    stocked(world, thing, screw=middle, tray=TRAY * mirror)
    world.method = VisualServo()
    run = world.run(Pick(CONFIG).run(world.context, PickGoal(side="either")))
    assert run.result is not None and run.result.success, run.result
    assert world.bus.latest(topics.hand_goal(side)) is not None
    other: Side = "left" if side == "right" else "right"
    assert world.bus.latest(topics.hand_goal(other)) is None


def test_the_object_that_was_chosen_is_remembered_and_not_the_neighbour_that_is_taken() -> None:
    chosen, neighbour = np.array([0.48, 0.13, -0.06]), np.array([0.49, 0.03, -0.06])
    steps = [(chosen + 0.02, 0.14), (chosen, 0.002), (chosen + 0.004, 0.001), (neighbour, 0.001)]
    seen = None
    for target, sigma in steps:
        seen = followed(seen, ServoStep(np.eye(4), target, sigma, ServoStatus.TRACKING))
    assert seen is not None and np.allclose(seen, chosen + 0.004)
    assert followed(None, ServoStep(np.eye(4), chosen, 0.14, ServoStatus.TRACKING)) is None
