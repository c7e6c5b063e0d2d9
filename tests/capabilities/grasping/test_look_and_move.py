"""Look-and-move on synthetic sightings: it moves only between looks, and a look waits for the hand to rest."""

from __future__ import annotations

import numpy as np

from golem.capabilities.grasping.base import Gripper, ServoLaw, ServoStatus, ServoStep
from golem.capabilities.grasping.centroid import grasp_pose
from golem.capabilities.grasping.look_and_move import LookAndMove, LookAndMoveConfig
from golem.types import Array, Detection, LocalizedObject

DT, FRAME, SPEED, YAW = 0.02, 4, 0.15, -np.pi / 2
SCREW = np.array([0.43, -0.14, -0.03])
HEAD_ERROR = np.array([0.04, -0.03, 0.02])


def screw(position: Array) -> LocalizedObject:
    box = np.array([0.0, 0.0, 10.0, 10.0])
    return LocalizedObject(Detection("screw", 0.9, box, box[:2] + 5), 0.0, position, np.zeros((0, 3)))


class Hand:
    """A hand that goes where the law says at `SPEED`; its camera sees the screw until `blind` [s]."""

    def __init__(self, config: LookAndMoveConfig | None = None, blind: float = np.inf) -> None:
        method = LookAndMove(config)
        target = screw(SCREW + HEAD_ERROR)
        (grasp,) = method.propose(target, np.zeros((0, 3)), Gripper("right", np.eye(4), YAW))
        self.law: ServoLaw = method.servo(target, grasp, 0.0)
        self.place = grasp.T_odom_gripper[:3, 3] + (0.0, 0.0, 0.15)
        self.blind, self.t = blind, 0.0
        self.steps: list[ServoStep] = []
        self.goals: list[Array] = []

    def run(self, seconds: float) -> ServoStep:
        """Advance until the law has ended or the time is over."""
        end = self.t + seconds
        while self.t < end and (not self.steps or self.steps[-1].status is ServoStatus.TRACKING):
            frame = len(self.steps) % FRAME == 0
            seen = [screw(SCREW)] if self.t < self.blind else []
            step = self.law.step(self.t, seen if frame else None, grasp_pose(self.place, YAW))
            self.steps.append(step)
            self.goals.append(step.T_odom_gripper[:3, 3].copy())
            way = step.T_odom_gripper[:3, 3] - self.place
            self.place = self.place + way * min(1.0, SPEED * DT / max(np.linalg.norm(way), 1e-12))
            self.t += DT
        return self.steps[-1]


def moves(hand: Hand) -> list[int]:
    """Return the ticks at which the law sent the hand elsewhere."""
    return [k for k in range(1, len(hand.goals)) if np.linalg.norm(hand.goals[k] - hand.goals[k - 1]) > 1e-9]


def test_it_converges_in_many_moves() -> None:
    hand = Hand()
    assert hand.run(90.0).status is ServoStatus.CONVERGED
    config = LookAndMoveConfig()
    grasp = SCREW - (0.0, 0.0, config.centroid.depth)
    off = hand.place - grasp
    assert np.hypot(*off[:2]) < config.servo.tolerance and abs(off[2]) < config.servo.height_tolerance
    assert 30.0 < hand.t < hand.law.patience


def test_a_look_comes_after_the_move_and_the_rest() -> None:
    hand = Hand()
    hand.run(20.0)
    gaps = np.diff(moves(hand)) * DT
    assert len(gaps) >= 3 and (gaps >= LookAndMoveConfig().move + LookAndMoveConfig().rest - 1e-9).all()


def test_a_step_is_bounded_and_a_share_of_the_error() -> None:
    hand = Hand()
    start = hand.place.copy()
    hand.run(3.0)
    assert np.linalg.norm(hand.place - start) <= LookAndMoveConfig().step + 1e-9


def test_blind_it_stays_then_backs_off_then_is_lost() -> None:
    hand = Hand(blind=6.0)
    hand.run(9.0)
    low = hand.place[2]
    np.testing.assert_allclose(hand.goals[-1], hand.goals[round(6.0 / DT)])
    assert hand.run(80.0).status is ServoStatus.LOST
    assert hand.place[2] > low + 0.02
