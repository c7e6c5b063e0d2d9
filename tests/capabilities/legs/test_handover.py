"""Walk with one controller, stand with another: who is in charge when, and how the legs change hands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from tests.capabilities.legs.recorder import Recorder, crouching, still

from golem.capabilities.legs.balance_errors import VelocityIntegratorConfig
from golem.capabilities.legs.base import Envelope
from golem.capabilities.legs.gait import GaitConfig
from golem.capabilities.legs.handover import Handover, HandoverConfig, HandoverPart
from golem.capabilities.legs.locomotion import Locomotion, LocomotionConfig
from golem.errors import ConfigError
from golem.types import BaseEstimate, LowState, Twist

DT = 0.02
RECORDER = "tests.capabilities.legs.recorder:Recorder"
BLENDING = HandoverConfig(HandoverPart(RECORDER), HandoverPart(RECORDER)).blend
BLEND = round(BLENDING / DT)
"""For how long both controllers have the legs [s], and in ticks."""


class Robot:
    """A base layer over both controllers, on a robot whose state is given."""

    def __init__(
        self,
        walk: dict[str, object] | None = None,
        stand: dict[str, object] | None = None,
        trim: float = 0.0,  # the plant stands still
        shoved: float | None = None,
    ) -> None:
        walker = HandoverPart(RECORDER, {"target": 1.0} | (walk or {}))
        stander = HandoverPart(RECORDER, {"target": 0.0} | (stand or {}))
        self.legs = Handover(HandoverConfig(walker, stander, shoved=shoved))
        self.layer = Locomotion(self.legs, LocomotionConfig(trim=VelocityIntegratorConfig(gain=trim)))
        self.state, self.base = crouching(), still()
        self.layer.reset(self.state)
        self.targets: list[float] = []

    @property
    def walk(self) -> Recorder:
        return self.legs._walk.controller  # pyright: ignore

    @property
    def stand(self) -> Recorder:
        return self.legs._stand.controller  # pyright: ignore

    def run(self, seconds: float, twist: Twist | None = None, dt: float = DT) -> None:
        """Let `seconds` pass under one twist."""
        for _ in range(round(seconds / dt)):
            command = self.layer.step(self.state, self.base, twist, dt)
            self.targets.append(float(command.q[0]))


def test_it_stands_with_one_walks_with_the_other_and_stands_again() -> None:
    robot = Robot()
    robot.run(1.0)
    assert (len(robot.stand.motions), len(robot.walk.motions)) == (50, 0)
    robot.run(2.0, Twist(0.5))
    assert robot.legs.walking
    assert robot.walk.resets == 1
    assert robot.walk.motions[-1].twist == Twist(0.5)
    robot.run(2.0, Twist())
    assert not robot.legs.walking
    assert robot.stand.resets == 2
    assert robot.walk.motions[-1 - BLEND].stepping
    assert not any(m.stepping for m in robot.walk.motions[-BLEND:])
    assert not robot.stand.motions[50 + BLEND].stepping
    # Nobody was asked for what is not his: no twist for the standing one, and a tick for both only while they change.
    assert {m.twist for m in robot.stand.motions} == {Twist()}
    assert len(robot.stand.motions) + len(robot.walk.motions) == 250 + 2 * BLEND


def test_targets_go_over_smoothly() -> None:
    robot = Robot()
    robot.run(0.5)
    robot.run(1.0, Twist(0.5))
    steps = np.diff(robot.targets)
    assert robot.targets[0] == 0.0
    assert robot.targets[-1] == 1.0
    assert steps.max() == pytest.approx(1.0 / BLEND)
    assert (steps >= -1e-12).all()


def test_while_the_legs_change_hands_both_controllers_act() -> None:
    robot = Robot()
    robot.run(0.5)
    robot.run(0.4, Twist(0.5))
    before = robot.targets[-1]
    robot.stand.target = -1.0
    robot.run(DT, Twist(0.5))
    share = before + 1.0 / BLEND
    assert robot.targets[-1] == pytest.approx(share - (1.0 - share))


@pytest.mark.parametrize("seconds", [0.1, 0.5])
def test_targets_do_not_jump_however_soon_the_other_controller_is_wanted_again(seconds: float) -> None:
    robot = Robot(walk={"gait": GaitConfig(start="never")})
    robot.run(0.5)
    robot.run(seconds, Twist(0.5))
    robot.run(2.5, Twist())
    assert not robot.legs.walking
    assert max(robot.targets) > 0.9
    assert robot.targets[-1] == 0.0
    assert np.abs(np.diff(robot.targets)).max() <= 1.0 / BLEND + 1e-9


def turned(base: BaseEstimate, yaw: float, velocity: tuple[float, float]) -> BaseEstimate:
    T = base.T_odom_base.copy()
    T[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    return replace(base, T_odom_base=T, velocity=np.array([*velocity, 0.0]))


def test_a_robot_that_is_shoved_while_it_walks_is_caught_at_once_and_walks_on_when_it_is_in_place() -> None:
    robot = Robot(shoved=0.5)
    robot.run(0.5)
    robot.run(2.0, Twist(0.4))
    robot.base = turned(robot.base, 0.5 * np.pi, (0.0, 0.8))  # ahead: it looks along y of odom
    robot.run(0.5, Twist(0.4))
    assert robot.legs.walking
    robot.base = turned(robot.base, 0.5 * np.pi, (0.6, 0.4))
    robot.run(DT, Twist(0.4))
    assert not robot.legs.walking and robot.stand.resets == 2
    robot.run(0.5, Twist(0.4))
    assert robot.targets[-1] == 0.0 and robot.stand.motions[-1].twist == Twist()
    steps = np.abs(np.diff(robot.targets[-round(0.5 / DT) - 1 :]))
    assert steps.max() < 1.0 / BLEND * 10.0
    robot.base = still()
    robot.run(1.0, Twist(0.4))
    assert robot.legs.walking and robot.walk.motions[-1].twist == Twist(0.4)


def test_nobody_is_caught_who_stands_whose_velocity_is_not_known_or_who_is_not_to_be() -> None:
    for shoved, stale, caught in ((0.5, False, True), (0.5, True, False), (None, False, False)):
        robot = Robot(shoved=shoved)
        robot.run(0.5)
        robot.base = turned(still(), 0.0, (0.0, 0.9))
        robot.run(0.5)
        assert robot.stand.resets == 1
        robot.base = still()
        robot.run(2.0)
        robot.run(2.0, Twist(0.4))
        robot.base = replace(turned(still(), 0.0, (0.4, 0.9)), stale=stale)
        robot.run(0.2, Twist(0.4))
        assert robot.legs.walking != caught


def rotating(state: LowState) -> LowState:
    return replace(state, imu=replace(state.imu, gyro=np.array([0.0, 1.1, 0.0])))


def kicking(state: LowState) -> LowState:
    dq = state.dq.copy()
    dq[3] = -6.5
    return replace(state, dq=dq)


def leaning(state: LowState) -> LowState:
    angle = np.arcsin(0.27)
    return replace(state, imu=replace(state.imu, quat=np.array([np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0])))


@pytest.mark.parametrize("upset", [rotating, kicking, leaning])
def test_an_unhealthy_robot_keeps_its_controller(upset: Callable[[LowState], LowState]) -> None:
    robot = Robot()
    robot.run(0.5)
    calm, robot.state = robot.state, upset(robot.state)
    robot.run(0.5, Twist(0.5))
    assert not robot.legs.walking
    robot.state = calm
    robot.run(4 * DT, Twist(0.5))
    assert not robot.legs.walking
    robot.run(DT, Twist(0.5))
    assert robot.legs.walking


@pytest.mark.parametrize(
    "moved",
    [
        BaseEstimate(0.0, np.eye(4), velocity=np.array([0.15, -0.15, 0.0]), contact=np.ones(2)),
        BaseEstimate(0.0, np.eye(4), contact=np.array([1.0, 0.1])),
    ],
    ids=["drifting", "on one leg"],
)
def test_it_does_not_change_hands_in_motion_or_on_one_leg(moved: BaseEstimate) -> None:
    robot = Robot(walk={"gait": GaitConfig(start="never")})
    robot.run(0.5)
    robot.run(0.5, Twist(0.5))
    robot.base = moved
    robot.run(2.0, Twist())
    assert robot.legs.walking
    robot.base = still()
    robot.run(0.2, Twist())
    assert not robot.legs.walking


def test_a_push_is_taken_by_the_one_that_stands_steps_and_all() -> None:
    robot = Robot(stand={"gait": GaitConfig(capture_stop=0.01)}, trim=0.8)
    robot.run(0.5)
    robot.base = replace(still(), velocity=np.array([0.8, 0.0, 0.0]))
    robot.run(0.3)
    # Healthy again, but still stepping, and the base layer corrects what the push did to the place.
    robot.base = replace(still(), velocity=np.array([0.15, 0.0, 0.0]))
    robot.run(0.5)
    assert robot.stand.motions[-1].stepping
    assert not robot.legs.walking
    assert {m.twist for m in robot.stand.motions} == {Twist()}


def test_a_clock_that_never_stops_is_left_when_both_feet_are_down() -> None:
    robot = Robot(walk={"gait": GaitConfig(start="always")}, stand={"gait": GaitConfig(start="command")})
    robot.run(0.5)
    robot.run(1.0, Twist(0.5))
    robot.run(2.0, Twist())
    assert not robot.legs.walking
    last = robot.walk.motions[-1 - BLEND]
    after = robot.stand.motions[26 + BLEND]
    assert last.stepping
    assert (after.phase < robot.walk.gait.stance).all()
    assert not robot.stand.motions[-1].stepping


def test_envelope_and_clock_are_those_of_the_controller_they_are_for() -> None:
    narrow = Envelope((-0.1, 0.3), (0.0, 0.0), (0.0, 0.0))
    slow = GaitConfig(period=1.3)
    robot = Robot(walk={"envelope": narrow, "gait": slow}, stand={"gait": GaitConfig(start="never")})
    assert robot.legs.envelope == narrow
    assert robot.legs.gait.start == "never"
    robot.run(1.0, Twist(0.5))
    assert robot.legs.gait == slow
    assert robot.walk.motions[-1].twist == Twist(0.3)
    assert robot.walk.motions[-1].stepping


def test_each_runs_at_its_own_rate() -> None:
    robot = Robot(walk={"rate": 50.0}, stand={"rate": 500.0})
    assert robot.legs.rate == 500.0
    robot.run(0.5, dt=0.002)
    robot.run(0.5, Twist(0.5), dt=0.002)
    np.testing.assert_allclose(robot.stand.steps, 0.002)
    assert len(robot.stand.steps) == 500  # it goes on for a while
    np.testing.assert_allclose(robot.walk.steps[1:], 0.02)


def test_a_controller_that_has_yet_to_start_gets_the_legs_once_it_has() -> None:
    robot = Robot(walk={"silent": 30})
    robot.run(0.5)
    robot.run(30 * DT, Twist(0.5))
    assert not robot.legs.walking
    assert len(robot.stand.motions) == 25 + 30
    robot.run(DT, Twist(0.5))
    assert robot.legs.walking
    robot.run(BLENDING, Twist(0.5))
    assert robot.targets[-1] == 1.0


def test_a_controller_that_has_started_waits_for_a_robot_that_is_calm() -> None:
    robot = Robot(walk={"silent": 30})
    robot.run(0.5)
    robot.run(20 * DT, Twist(0.5))
    calm, robot.state = robot.state, rotating(robot.state)
    robot.run(20 * DT, Twist(0.5))
    assert robot.walk.started and not robot.legs.walking
    robot.state = calm
    robot.run(4 * DT, Twist(0.5))
    assert not robot.legs.walking
    robot.run(DT, Twist(0.5))
    assert robot.legs.walking


def test_a_twist_that_waited_for_the_legs_is_reached_at_the_allowed_acceleration() -> None:
    robot = Robot()
    robot.run(0.5)
    calm, robot.state = robot.state, rotating(robot.state)
    robot.run(2.0, Twist(0.8))
    assert not robot.legs.walking and not robot.layer.moving
    assert (robot.layer.applied, robot.layer.reason) == (Twist(), "who walks does not have the legs yet")
    robot.state = calm
    robot.run(0.5, Twist(0.8))
    speeds = np.array([m.twist.vx for m in robot.walk.motions])
    assert robot.layer.reason == "" and speeds[-1] > 0.3
    assert speeds[0] <= DT + 1e-12
    assert (np.diff(speeds) <= LocomotionConfig().acceleration[0] * DT + 1e-12).all()


def test_a_hand_over_inside_another_waits_for_whoever_walks_in_the_end() -> None:
    slow = GaitConfig(period=1.3)
    inner = {"walk": {"use": RECORDER, "options": {"gait": slow}}, "stand": {"use": RECORDER}}
    outer = HandoverConfig(HandoverPart("handover", inner), HandoverPart(RECORDER))
    legs = Handover(outer)
    layer = Locomotion(legs, LocomotionConfig(trim=VelocityIntegratorConfig(gain=0.0)))
    state, base = crouching(), still()
    layer.reset(state)
    for _ in range(100):
        layer.step(state, base, Twist(0.5), DT)
    assert legs.follows and layer.applied == Twist(0.5)
    assert legs.gait == slow and layer.motion.stepping  # not the clock of who stood inside when the legs were taken


def test_a_controller_that_starts_too_slowly_is_left_alone_again() -> None:
    robot = Robot(walk={"silent": 60})
    robot.run(0.5, Twist(0.5))
    robot.run(1.0, Twist())
    assert not robot.legs.walking
    assert len(robot.walk.motions) < 60
    assert set(robot.targets) == {0.0}


def test_a_reset_gives_the_legs_to_the_standing_one() -> None:
    robot = Robot()
    robot.run(1.0, Twist(0.5))
    robot.layer.reset(robot.state)
    robot.run(DT)
    assert not robot.legs.walking
    assert robot.targets[-1] == 0.0


def test_who_stands_does_not_step_for_a_twist_while_it_waits_for_the_one_that_walks() -> None:
    """A robot that marks time is on both feet for too short a time to change hands, and would do so for ever."""
    robot = Robot(walk={"silent": 30})
    robot.run(30 * DT, Twist(0.5))
    assert not any(m.stepping for m in robot.stand.motions)
    robot.run(0.2, Twist(0.5))
    assert robot.legs.walking and robot.walk.motions[-1].stepping


@pytest.mark.parametrize("speed", [0.5, 0.1])
def test_a_walk_that_is_found_is_ended_by_the_one_that_walks_and_a_step_in_place_is_not(speed: float) -> None:
    robot = Robot()
    former = Locomotion(Recorder(), LocomotionConfig(trim=VelocityIntegratorConfig(gain=0.0)))
    former.reset(robot.state)
    for _ in range(15):
        former.step(robot.state, robot.base, Twist(0.5), DT)
    assert former.gait.stepping
    former.hand_over(robot.legs, robot.state, None)
    robot.layer = former
    robot.base = replace(still(), velocity=np.array([speed, 0.0, 0.0]))
    robot.run(DT)
    assert robot.legs.walking == (speed > 0.2)
    robot.base = still()
    robot.run(1.5)
    assert not robot.legs.walking


def test_an_unknown_controller_is_named() -> None:
    with pytest.raises(ConfigError, match="Unknown lower_body implementation 'walkk'"):
        Handover(HandoverConfig(HandoverPart("walkk"), HandoverPart("hold")))


def test_it_stands_at_its_own_height_before_the_legs_change_hands() -> None:
    heights = Envelope(height=(0.78, 0.96, 1.0))
    robot = Robot(stand={"envelope": heights})
    assert robot.legs.envelope == replace(robot.walk.envelope, height=heights.height)
    robot.run(4.0, Twist(height=0.8))
    assert robot.stand.motions[-1].height == 0.8
    robot.run(1.0, Twist(0.5, height=0.8))
    assert not robot.legs.walking and robot.layer.reason == "who walks does not have the legs yet"
    robot.run(4.0, Twist(0.5))
    assert robot.legs.walking and robot.walk.motions[-1].height is None
    assert robot.legs.envelope.height is None
