"""The servo law on synthetic sightings: an arm that follows with a lag, a camera at 15 Hz that is late and noisy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from golem.capabilities.grasping.base import GraspMethod, Gripper, ServoLaw, ServoStatus, ServoStep
from golem.capabilities.grasping.centroid import Centroid, grasp_pose
from golem.capabilities.grasping.visual_servo import ServoLawConfig, VisualServo, VisualServoConfig
from golem.types import Array, Detection, LocalizedObject

DT = 0.01
FRAME = 7
SPEED = 0.15
NO_SCENE = np.zeros((0, 3))
SCREW = np.array([0.43, -0.14, -0.03])
HEAD_ERROR = np.array([0.04, -0.03, 0.02])
"""What the head camera is off by."""


def thing(position: Array, label: str = "screw", points: Array | None = None, score: float = 0.9) -> LocalizedObject:
    box = np.array([0.0, 0.0, 10.0, 10.0])
    cloud = np.zeros((0, 3)) if points is None else points
    return LocalizedObject(Detection(label, score, box, box[:2] + 5), 0.0, np.array(position, float), cloud)


def standing(position: Array, height: float, label: str = "screw") -> LocalizedObject:
    """Return an object that rises by `height` [m] from the ground around it."""
    side = np.linspace(-0.02, 0.02, 15)
    x, y = (a.ravel() for a in np.meshgrid(side, side))
    return thing(position, label, position + np.stack([x, y, np.full_like(x, -height)], axis=1))


Look = Callable[[float], list[LocalizedObject] | None]


@dataclass
class Chase:
    """A hand that goes where the law says.

    Attributes:
        look: what a frame at time t shows; None: the camera gives no frame.
        latency: ticks from exposure to law.
    """

    look: Look
    latency: int = 8
    config: VisualServoConfig = field(default_factory=VisualServoConfig)
    blocked: bool = False

    def __post_init__(self) -> None:
        method = VisualServo(self.config)
        target = thing(SCREW + HEAD_ERROR)
        grasp = method.propose(target, NO_SCENE, Gripper("right", np.eye(4), -np.pi / 2))[0]
        self.law: ServoLaw = method.servo(target, grasp, 0.0)
        self.gripper = grasp.T_odom_gripper[:3, 3] + (0.0, 0.0, 0.15)
        self.t = 0.0
        self.steps: list[ServoStep] = []
        self.path: list[Array] = []
        self._frames: dict[int, list[LocalizedObject] | None] = {}

    def run(self, seconds: float) -> ServoStep:
        """Advance until the law has ended or the time is over."""
        for _ in range(round(seconds / DT)):
            step = self.tick()
            if step.status is not ServoStatus.TRACKING:
                break
        return self.steps[-1]

    def tick(self) -> ServoStep:
        """Advance by one tick."""
        i = len(self.steps)
        if i % FRAME == 0:
            self._frames[i + self.latency] = self.look(self.t)
        step = self.law.step(self.t, self._frames.pop(i, None), grasp_pose(self.gripper, -np.pi / 2))
        assert np.isfinite(step.T_odom_gripper).all() and np.isfinite(step.target).all()
        assert np.isfinite(step.sigma)
        self.steps.append(step)
        self.path.append(self.gripper.copy())
        if not self.blocked:
            way = 0.2 * (step.T_odom_gripper[:3, 3] - self.gripper)
            self.gripper = self.gripper + way * min(1.0, SPEED * DT / max(np.linalg.norm(way), 1e-12))
        self.t += DT
        return step


def steady(t: float) -> list[LocalizedObject]:
    return [thing(SCREW)]


def test_it_is_a_grasp_method() -> None:
    method: GraspMethod = VisualServo()
    (fine,), (coarse,) = (
        m.propose(thing(SCREW), NO_SCENE, Gripper("right", np.eye(4), 0.0)) for m in (method, Centroid())
    )
    assert (fine.gap, method.latency) == (coarse.gap, 0.0)


def test_it_converges_on_what_the_palm_camera_sees() -> None:
    chase = Chase(steady)
    last = chase.run(10.0)
    assert last.status is ServoStatus.CONVERGED
    assert chase.t < 4.0
    grasp = SCREW - (0.0, 0.0, VisualServoConfig().centroid.depth)
    off = chase.gripper - grasp
    assert np.hypot(*off[:2]) < ServoLawConfig().tolerance and abs(off[2]) < ServoLawConfig().height_tolerance
    np.testing.assert_allclose(last.target, SCREW, atol=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_it_converges_under_noise(seed: int) -> None:
    rng = np.random.default_rng(seed)
    chase = Chase(lambda t: [thing(SCREW + rng.normal(0.0, (0.001, 0.001, 0.002)))])
    assert chase.run(10.0).status is ServoStatus.CONVERGED
    assert np.linalg.norm((chase.gripper - SCREW)[:2]) < 0.0045


def test_the_filtered_target_is_better_than_one_sighting() -> None:
    rng = np.random.default_rng(0)
    chase = Chase(lambda t: [thing(SCREW + rng.normal(0.0, 0.002, 3))], blocked=True)
    for _ in range(280):
        chase.tick()
    errors = np.array([s.target - SCREW for s in chase.steps[150:]])
    assert np.sqrt((errors**2).mean()) < 0.0012
    assert chase.steps[-1].sigma < 0.0015


def test_it_follows_a_target_that_sways() -> None:
    def sway(t: float) -> Array:
        return SCREW + (0.005 * np.sin(2 * np.pi * 0.4 * t), 0.0, 0.0)

    chase = Chase(lambda t: [thing(sway(t))])
    assert chase.run(15.0).status is ServoStatus.CONVERGED
    assert np.linalg.norm((chase.gripper - sway(chase.t))[:2]) < 0.006


def test_it_follows_a_target_that_jumps() -> None:
    jump = np.array([0.006, -0.004, 0.0])
    chase = Chase(lambda t: [thing(SCREW + (jump if t > 1.0 else 0.0))])
    assert chase.run(10.0).status is ServoStatus.CONVERGED
    assert np.linalg.norm((chase.gripper - SCREW - jump)[:2]) < ServoLawConfig().tolerance


def test_the_hand_stays_at_its_standoff_until_the_target_is_confirmed() -> None:
    chase = Chase(steady)
    config = ServoLawConfig()
    top = SCREW[2] - VisualServoConfig().centroid.depth
    frames = 0
    for _ in range(300):
        chase.tick()
        frames += len(chase.steps) % FRAME == (chase.latency + 1) % FRAME and len(chase.steps) > chase.latency
        if frames < config.confirm:
            assert chase.steps[-1].T_odom_gripper[2, 3] > top + config.standoff - 1e-9


def test_the_funnel_keeps_height_while_the_hand_is_off_to_the_side() -> None:
    chase = Chase(steady)
    config = ServoLawConfig()
    chase.run(10.0)
    top = SCREW[2] - VisualServoConfig().centroid.depth
    for step, hand in zip(chase.steps, chase.path, strict=True):
        lateral = np.linalg.norm((hand - step.target)[:2])
        height = step.T_odom_gripper[2, 3] - top
        if step.sigma < 0.01 and lateral > 2 * config.tolerance:
            assert height > 0.9 * min(config.slope * (lateral - config.tolerance), config.standoff)


def test_a_target_never_seen_makes_it_back_off_and_then_give_up() -> None:
    chase = Chase(lambda t: [])
    last = chase.run(20.0)
    config = ServoLawConfig()
    assert last.status is ServoStatus.LOST
    assert chase.t == pytest.approx((config.retreats + 1) * config.lost_after, abs=0.1)
    lifts = {round(float(s.T_odom_gripper[2, 3] - chase.steps[0].T_odom_gripper[2, 3]), 6) for s in chase.steps}
    assert sorted(lifts)[:3] == [0.0, 0.05, 0.10]


def test_a_camera_that_gives_no_frame_is_a_target_lost() -> None:
    assert Chase(lambda t: None).run(20.0).status is ServoStatus.LOST


def test_a_target_lost_on_the_way_is_found_again() -> None:
    chase = Chase(lambda t: [] if 0.6 < t < 2.1 else steady(t))
    assert chase.run(12.0).status is ServoStatus.CONVERGED


def test_what_is_lost_between_the_fingers_is_grasped_from_memory() -> None:
    grasp = SCREW[2] - VisualServoConfig().centroid.depth
    chase = Chase(lambda t: steady(t) if chase.gripper[2] > grasp + 0.004 else [])
    assert chase.run(10.0).status is ServoStatus.CONVERGED
    assert np.linalg.norm((chase.gripper - SCREW)[:2]) < ServoLawConfig().tolerance


def test_what_is_lost_farther_away_is_not() -> None:
    high = ServoLawConfig().blind_from + 0.01
    chase = Chase(lambda t: steady(t) if chase.gripper[2] > SCREW[2] + high else [])
    assert chase.run(20.0).status is ServoStatus.LOST


def test_a_neighbour_is_not_taken_for_what_was_lost() -> None:
    neighbour = [thing(SCREW + (0.0, 0.093, 0.0))]
    chase = Chase(lambda t: steady(t) if t < 0.6 else [] if t < 1.9 else neighbour)
    assert chase.run(20.0).status is ServoStatus.LOST
    assert np.abs(chase.steps[-1].target - SCREW).max() < 0.001


def test_a_hand_that_cannot_move_stalls() -> None:
    chase = Chase(steady, blocked=True)
    assert chase.run(20.0).status is ServoStatus.STALLED
    # It looks at the same sighting once more before it says so.
    patience = 2 * ServoLawConfig().lost_after
    assert chase.t == pytest.approx(ServoLawConfig().stall_after + patience, abs=0.5)


def test_a_neighbour_is_not_taken_for_the_target() -> None:
    def both(t: float) -> list[LocalizedObject]:
        return [thing(SCREW + (0.03, 0.0, 0.0)), thing(SCREW)]

    def chase_from(first: Look) -> Chase:
        return Chase(lambda t: first(t) if t < 0.3 else both(t))

    chase = chase_from(steady)
    assert chase.run(10.0).status is ServoStatus.CONVERGED
    np.testing.assert_allclose(chase.steps[-1].target, SCREW, atol=1e-3)


def test_an_outlier_moves_the_target_by_nothing() -> None:
    chase = Chase(lambda t: [thing(SCREW + (0.02, 0.0, 0.0))] if 1.0 < t < 1.2 else steady(t), blocked=True)
    for _ in range(200):
        chase.tick()
    np.testing.assert_allclose(chase.steps[-1].target, SCREW, atol=1e-6)


def test_another_class_is_not_followed() -> None:
    chase = Chase(lambda t: [thing(SCREW, label="nut"), thing(SCREW, label="screw_hole")])
    assert chase.run(20.0).status is ServoStatus.LOST


def test_frames_without_the_target_do_not_count_as_dwelling() -> None:
    config = VisualServoConfig(servo=ServoLawConfig(lost_after=60.0, stall_after=60.0))
    confirmed = 0.3
    chase = Chase(lambda t: steady(t) if t < confirmed else [thing(SCREW, label="nut")], config=config)
    assert chase.run(5.0).status is ServoStatus.TRACKING
    chase.look = steady
    assert chase.run(1.0).status is ServoStatus.CONVERGED


def test_something_too_far_from_the_hand_is_not_taken_at_first() -> None:
    far = SCREW + (ServoLawConfig().first_radius + 0.1, 0.0, 0.0)
    assert Chase(lambda t: [thing(far)]).run(20.0).status is ServoStatus.LOST


def test_options_reach_the_law() -> None:
    eager = VisualServoConfig(servo=ServoLawConfig(dwell=1, confirm=1, tolerance=0.01, height_tolerance=0.01))
    quick, usual = Chase(steady, config=eager), Chase(steady)
    assert quick.run(10.0).status is usual.run(10.0).status is ServoStatus.CONVERGED
    assert quick.t < usual.t - 0.1


coordinate = st.floats(-1.0, 1.0)
sighting = st.tuples(st.sampled_from(["screw", "nut"]), coordinate, coordinate, coordinate)


@settings(max_examples=60)
@given(st.lists(st.none() | st.lists(sighting, max_size=4), max_size=60))
def test_nothing_a_camera_may_show_makes_it_return_nonsense(
    frames: list[list[tuple[str, float, float, float]] | None],
) -> None:
    chase = Chase(steady)
    for i, frame in enumerate(frames):
        objects = None if frame is None else [thing(np.array(xyz), label=label) for label, *xyz in frame]
        step = chase.law.step(0.05 * i, objects, grasp_pose(chase.gripper, 0.0))
        assert np.isfinite(step.T_odom_gripper).all() and np.isfinite(step.target).all()
        R = step.T_odom_gripper[:3, :3]
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
        assert 0.0 < step.sigma < 1.0


def test_the_ground_under_a_low_head_lifts_the_grasp() -> None:
    cloud = np.array([SCREW] * 5 + [SCREW - (0.0, 0.0, 0.006)] * 20)
    chase = Chase(lambda t: [thing(SCREW, points=cloud)])
    assert chase.run(10.0).status is ServoStatus.CONVERGED
    depth = SCREW[2] - chase.gripper[2]
    assert depth < VisualServoConfig().centroid.depth / 3.0 + ServoLawConfig().height_tolerance


@pytest.mark.parametrize(
    ("height", "label", "status"),
    [
        (0.006, "screw", ServoStatus.TIGHT),
        (0.0105, "screw", ServoStatus.CONVERGED),
        (0.006, "nut", ServoStatus.CONVERGED),
    ],
)
def test_a_screw_that_stands_as_low_as_a_tight_one_is_left(height: float, label: str, status: ServoStatus) -> None:
    chase = Chase(lambda t: [standing(SCREW, height, label)])
    chase.law.label = label
    assert chase.run(8.0).status is status


NEIGHBOUR = SCREW + (0.0, 0.093, 0.0)


def test_a_tight_screw_is_left_for_the_loose_one_beside_it() -> None:
    chase = Chase(lambda t: [standing(SCREW, 0.006), standing(NEIGHBOUR, 0.0115)])
    assert chase.run(20.0).status is ServoStatus.CONVERGED
    np.testing.assert_allclose(chase.steps[-1].target, NEIGHBOUR, atol=1e-3)


def test_what_is_out_of_reach_is_left_for_what_is_beside_it() -> None:
    chase = Chase(lambda t: [thing(SCREW), thing(NEIGHBOUR)])

    def reachable(t: float) -> list[LocalizedObject]:
        chase.blocked = t < ServoLawConfig().stall_after + 0.5
        return [thing(SCREW), thing(NEIGHBOUR)]

    chase.look = reachable
    assert chase.run(20.0).status is ServoStatus.CONVERGED
    np.testing.assert_allclose(chase.steps[-1].target, NEIGHBOUR, atol=1e-3)


def test_two_tight_screws_are_called_tight() -> None:
    chase = Chase(lambda t: [standing(SCREW, 0.006), standing(NEIGHBOUR, 0.006)])
    assert chase.run(20.0).status is ServoStatus.TIGHT


def test_a_doubtful_sighting_keeps_the_track_and_begins_none() -> None:
    doubtful = [thing(SCREW, score=0.16)]
    assert Chase(lambda t: doubtful).run(20.0).status is ServoStatus.LOST
    assert Chase(lambda t: steady(t) if t < 0.5 else doubtful).run(20.0).status is ServoStatus.CONVERGED


def test_what_lies_far_below_the_tight_screw_is_no_neighbour() -> None:
    deep = standing(NEIGHBOUR - (0.0, 0.0, 0.06), 0.0115)
    assert Chase(lambda t: [standing(SCREW, 0.006), deep]).run(20.0).status is ServoStatus.TIGHT


def test_a_head_camera_that_is_off_by_nine_centimetres_in_height_will_do() -> None:
    chase = Chase(steady)
    chase.law = VisualServo().servo(
        thing(SCREW - (0.0, 0.0, 0.09)),
        VisualServo().propose(thing(SCREW), NO_SCENE, Gripper("right", np.eye(4), -np.pi / 2))[0],
        0.0,
    )
    assert chase.run(10.0).status is ServoStatus.CONVERGED
