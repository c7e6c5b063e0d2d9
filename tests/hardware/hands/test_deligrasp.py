from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from golem.hardware.hands.base import HandController
from golem.hardware.hands.deligrasp import DeliGrasp, DeliGraspConfig
from golem.hardware.hands.magpie import MagpieHand
from golem.interfaces.payloads import GripState
from golem.robots.model.magpie_model import ARM, MAX_SPEED
from golem.robots.mujoco.hand_servos import SERVO_KP
from golem.types import HandState

DT = 0.01
SERVO = SERVO_KP / ARM**2
"""Stiffness of a finger [N/m]."""


@dataclass
class SoftPart:
    """A part of a width [m] and a stiffness for each finger [N/m], between fingers that are springs with a ceiling."""

    stiffness: float
    width: float = 0.040
    gap: float = 0.080
    t: float = 0.0

    def __post_init__(self) -> None:
        self.reference = self.gap

    def run(self, hand: HandController, seconds: float) -> tuple[list[GripState], float]:
        """Let the hand work; return its states in order and the largest force of a finger [N]."""
        states, hardest, force = list[GripState](), 0.0, 0.0
        for _ in range(round(seconds / DT)):
            self.t += DT
            report = HandState(self.t, self.gap, np.full(2, 0.5 * self.gap), np.full(2, force))
            command = hand.step(report, self.t)
            goal = command.gap if command.gap > 0.0 else -0.02
            reach = 2.0 * MAX_SPEED * ARM * DT
            self.reference += float(np.clip(goal - self.reference, -reach, reach))
            rest = (SERVO * self.reference + self.stiffness * self.width) / (SERVO + self.stiffness)
            force = min(max(0.5 * self.stiffness * (self.width - rest), 0.0), command.force)
            self.gap = max(self.width - 2.0 * force / self.stiffness, 0.0) if force else self.reference
            hardest = max(hardest, force)
            if not states or states[-1] is not hand.status().state:
                states.append(hand.status().state)
        return states, hardest


def grasp(hand: HandController, stiffness: float, force: float) -> tuple[list[GripState], float, SoftPart]:
    part = SoftPart(stiffness)
    hand.step(HandState(0.0, part.gap, np.full(2, 0.5 * part.gap), np.zeros(2)), 0.0)
    hand.close(force)
    return *part.run(hand, 3.0), part


@pytest.mark.parametrize("stiffness", [300.0, 1000.0, 10_000.0, 100_000.0])
@pytest.mark.parametrize("force", [2.0, 4.0])
def test_it_holds_soft_and_stiff_parts_with_at_least_the_share(stiffness: float, force: float) -> None:
    hand = DeliGrasp()
    states, _, _ = grasp(hand, stiffness, force)
    assert states == [GripState.CLOSING, GripState.CONTACT, GripState.HOLDING]
    assert 0.5 * force <= hand.status().force.min() <= force + 0.25  # a stiff part takes two raises


def test_it_squeezes_a_soft_part_less_than_a_hand_that_goes_to_the_ceiling() -> None:
    _, gentle, kept = grasp(DeliGrasp(), 400.0, 4.0)
    _, strong, squeezed = grasp(MagpieHand(), 400.0, 4.0)
    assert strong == pytest.approx(4.0, abs=0.05) and gentle < 2.6
    assert kept.gap - squeezed.gap > 0.006


def test_the_ceiling_rises_only_while_something_is_touched() -> None:
    hand = DeliGrasp(DeliGraspConfig(force_step=0.1))
    part = SoftPart(300.0, width=0.0)
    hand.close(1.0)
    for i in range(50):
        command = hand.step(HandState(DT * i, part.gap, np.full(2, 0.04), np.full(2, 0.2)), DT * i)
        assert (command.gap, command.force) == (0.0, pytest.approx(1.0, abs=0.02))
    first = hand.step(HandState(0.5, 0.06, np.full(2, 0.03), np.full(2, 0.4)), 0.5)
    assert first.gap == pytest.approx(0.059) and first.force == pytest.approx(1.1, abs=0.02)
    second = hand.step(HandState(0.52, 0.06, np.full(2, 0.03), np.full(2, 0.4)), 0.52)
    assert second.gap == first.gap
    third = hand.step(HandState(0.55, 0.06, np.full(2, 0.03), np.full(2, 0.4)), 0.55)
    assert third.gap == pytest.approx(0.058) and third.force == pytest.approx(1.2, abs=0.02)


def test_one_finger_alone_is_followed_until_the_other_one_touches() -> None:
    hand = DeliGrasp()
    hand.close(2.0)
    gap, t = 0.05, 0.0
    for _ in range(200):
        t += DT
        force = np.array([1.5, 0.0 if gap > 0.04 else 1.5])
        gap = hand.step(HandState(t, gap, np.array([0.02, gap - 0.02]), force), t).gap or gap - 0.001
        if gap > 0.04:
            assert hand.status().state is GripState.CLOSING
    assert hand.status().holding


def test_closing_on_nothing_is_empty_and_it_opens_again() -> None:
    hand, part = DeliGrasp(), SoftPart(300.0, width=0.0)
    hand.close(2.0)
    assert part.run(hand, 2.0)[0][-1] is GripState.EMPTY
    hand.open(0.06)
    assert part.run(hand, 2.0)[0][-1] is GripState.OPEN
    assert part.gap == pytest.approx(0.06)
