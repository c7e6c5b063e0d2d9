"""A lower body on its own terms: nothing of ours between a policy from outside and the robot."""

from __future__ import annotations

import numpy as np

from golem.capabilities.legs.base import Envelope, LocomotionCommand
from golem.capabilities.legs.gait import GaitConfig
from golem.capabilities.legs.hold import JointHold
from golem.capabilities.legs.locomotion import Locomotion
from golem.evaluation.episodes.plain_episode import BARE, PlainEpisode, PlainRobot
from golem.interfaces.payloads import LegCommand
from golem.runtime.lockstep import start_posture
from golem.types import BaseEstimate, LowState, Twist


class Listening(JointHold):
    """Notes the twists it is asked for."""

    def __init__(self) -> None:
        super().__init__()
        self.envelope, self.gait = Envelope(vx=(-0.5, 0.5)), GaitConfig(start="command")
        self.asked: list[float] = []

    def step(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, dt: float) -> LegCommand:
        self.asked.append(motion.twist.vx)
        return super().step(state, base, motion, dt)


def test_a_policy_from_outside_gets_the_twist_as_it_is() -> None:
    robot, legs = PlainRobot(None, start_posture(on_ground=True)), Listening()
    locomotion = Locomotion(legs, BARE)
    for _ in range(200):
        locomotion.step(robot.state(), robot.base(), Twist(0.3), 0.002)
    assert legs.asked == [0.3] * 20


def test_its_upper_body_keeps_the_posture_of_its_description() -> None:
    episode = PlainEpisode("policy:almi_stand", None, np.random.default_rng(0))
    episode.run(1.0)
    q = episode._robot.state().q
    assert abs(q[13:]).max() < 0.1 and abs(q[12]) < 0.05
    assert not episode.over
