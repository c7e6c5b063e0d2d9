"""Shoves on a lower body's own terms: who survives, what is the same for all, what is left out for whom."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from golem.capabilities.legs.base import Envelope, LocomotionCommand
from golem.capabilities.legs.gait import GaitConfig
from golem.capabilities.legs.hold import JointHold
from golem.capabilities.legs.locomotion import Locomotion
from golem.errors import ConfigError
from golem.evaluation.episodes.plain_episode import BARE, PlainEpisode
from golem.evaluation.own_terms import OwnTermsTrial
from golem.evaluation.push_bench import DOES_NOT_WALK
from golem.interfaces.payloads import LegCommand
from golem.robots.mujoco.plain_robot import PlainRobot
from golem.runtime.lockstep import start_posture
from golem.skills.base import FAULT
from golem.types import BaseEstimate, LowState, Twist

METHODS = Path(__file__).with_name("leg_methods.py")
TRIAL = OwnTermsTrial(f"{METHODS}:Stiff", None, "standing", (0.3, 0.0, 0.0), ("front",), 5.0, 0, 0)


def test_shoves_are_survived_and_lost_from_one_moment() -> None:
    both = replace(TRIAL, directions=("front", "back")).run()
    assert [both[d]["lost"] for d in both] == [None, None]
    assert 0.0 < both["front"]["lean"] < 0.2 and abs(both["front"]["speed"]) < 0.05
    strong = replace(TRIAL, directions=("front", "back"), level=120.0)
    together = strong.run()
    assert together["back"]["lost"] == "fall" and together["back"]["lean"] > 0.5
    apart = {k: v for d in strong.directions for k, v in replace(strong, directions=(d,)).run().items()}
    assert together == apart
    assert replace(strong, index=1).run() != together


def test_who_falls_breaks_its_contract_or_does_not_walk_is_named() -> None:
    limp = replace(TRIAL, method=f"{METHODS}:Limp").run()
    assert limp == {"front": {"lost": "fall"}}
    assert replace(TRIAL, phase="left_swing").run() == {"front": {"lost": DOES_NOT_WALK}}
    # It raises after 2 s, and stands for 2 to 3 s before the shove.
    assert replace(TRIAL, method=f"{METHODS}:Broken").run() == {"front": {"lost": FAULT}}
    with pytest.raises(ConfigError, match="vendor"):
        replace(TRIAL, method="vendor").run()


def test_ours_walks_as_told_and_takes_a_shove_in_mid_step() -> None:
    found = replace(TRIAL, method="almi", phase="left_swing", directions=("right",), level=20.0).run()
    assert found["right"]["lost"] is None and found["right"]["steps"] >= 6
    assert found["right"]["speed"] == pytest.approx(0.3, abs=0.1)


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
    q = episode.state().q
    assert abs(q[13:]).max() < 0.1 and abs(q[12]) < 0.05
    assert not episode.over
