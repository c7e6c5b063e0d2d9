from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem.hardware.hands.base import HandController
from golem.hardware.hands.magpie import FORCE_STEP, MagpieConfig, MagpieHand, clamp_force
from golem.interfaces.payloads import GripState
from golem.robots.model.magpie_model import MAX_FORCE, MAX_GAP, MIN_FORCE
from golem.types import HandCommand, HandState

DT = 0.01


@dataclass
class Fingers:
    """Fingers that move at 0.1 m/s and press on an object of a given width with what they are told, less friction."""

    width: float | None = None
    gap: float = MAX_GAP
    offset: float = 0.0
    efficiency: float = 0.9
    t: float = 0.0

    def report(self, command: HandCommand) -> HandState:
        self.t += DT
        stop = 0.0 if self.width is None else self.width
        step = 0.1 * DT
        target = max(command.gap, stop) if self.gap >= stop else command.gap
        self.gap += float(np.clip(target - self.gap, -step, step))
        force = np.full(2, 0.05)
        if self.gap <= stop + 1e-9 and command.gap < stop + 1e-9:
            force = np.full(2, self.efficiency * command.force)
        elif self.offset and self.gap <= stop + 2.0 * self.offset and command.gap < self.gap:
            force[0] = self.efficiency * command.force  # one finger meets an off-centre object first
        return HandState(self.t, self.gap, np.full(2, self.gap / 2), force)


def run(hand: MagpieHand, fingers: Fingers, seconds: float) -> list[GripState]:
    states: list[GripState] = []
    command = hand.step(HandState(fingers.t, fingers.gap, np.full(2, fingers.gap / 2), np.zeros(2)), fingers.t)
    for _ in range(round(seconds / DT)):
        command = hand.step(fingers.report(command), fingers.t)
        if not states or states[-1] is not hand.status().state:
            states.append(hand.status().state)
    return states


def grasp(width: float | None, force: float = 4.0, **options: float) -> tuple[MagpieHand, Fingers, list[GripState]]:
    hand, fingers = MagpieHand(), Fingers(width, **options)
    run(hand, fingers, 0.1)
    hand.close(force)
    return hand, fingers, run(hand, fingers, 2.0)


def test_it_is_a_hand_controller() -> None:
    assert isinstance(MagpieHand(), HandController)


def test_closing_on_an_object_goes_through_contact_to_holding() -> None:
    hand, _, states = grasp(0.016)
    assert states == [GripState.CLOSING, GripState.CONTACT, GripState.HOLDING]
    status = hand.status()
    assert status.holding
    assert status.gap == pytest.approx(0.016)
    assert status.force.min() == pytest.approx(3.6, abs=0.1)


def test_closing_on_nothing_is_empty() -> None:
    hand, _, states = grasp(None)
    assert states == [GripState.CLOSING, GripState.EMPTY]
    assert not hand.status().holding


def test_one_finger_alone_is_no_contact() -> None:
    _, fingers, states = grasp(0.016, offset=0.02)
    assert fingers.gap == pytest.approx(0.016)
    hand, fingers = MagpieHand(), Fingers(0.016, offset=0.02)
    hand.close(4.0)
    run(hand, fingers, 0.75)  # the first finger touches at a gap of 56 mm, 0.52 s after the start
    assert 0.02 < fingers.gap < 0.05
    assert hand.status().state is GripState.CLOSING
    assert states[-1] is GripState.HOLDING


def test_fingers_that_stall_below_the_contact_share_still_hold() -> None:
    # Friction eats two thirds of the force: contact by force alone (half of it) would never be seen.
    _, _, states = grasp(0.016, efficiency=0.33)
    assert states == [GripState.CLOSING, GripState.HOLDING]


def test_fingers_that_stall_without_force_hold_nothing() -> None:
    _, _, states = grasp(0.016, efficiency=0.05)
    assert states == [GripState.CLOSING]


@pytest.mark.parametrize("event", ["pulled out", "dropped"])
def test_losing_the_object_is_a_slip(event: str) -> None:
    hand, fingers, _ = grasp(0.016)
    fingers.width = None if event == "pulled out" else 0.006
    states = run(hand, fingers, 1.0)
    assert states[-1] is GripState.SLIPPED
    hand.close(4.0)
    assert hand.status().state is GripState.CLOSING


def test_losing_the_force_alone_is_a_slip() -> None:
    hand, fingers, _ = grasp(0.016)
    for _ in range(10):
        fingers.t += DT
        hand.step(HandState(fingers.t, 0.016, np.full(2, 0.008), np.array([3.0, 0.0])), fingers.t)
    assert hand.status().state is GripState.SLIPPED


def test_a_short_loss_of_force_is_no_slip() -> None:
    hand, fingers, _ = grasp(0.016)
    for i in range(100):
        force = np.zeros(2) if i % 10 < 4 else np.full(2, 3.0)
        fingers.t += DT
        hand.step(HandState(fingers.t, 0.016, np.full(2, 0.008), force), fingers.t)
        assert hand.status().holding


def test_opening_releases_and_arrives() -> None:
    hand, fingers, _ = grasp(0.016)
    hand.open(0.06)
    assert run(hand, fingers, 2.0) == [GripState.OPENING, GripState.OPEN]
    assert fingers.gap == pytest.approx(0.06)


def test_a_hand_starts_by_opening() -> None:
    hand, fingers = MagpieHand(), Fingers(gap=0.03)
    assert run(hand, fingers, 2.0) == [GripState.OPENING, GripState.OPEN]
    assert fingers.gap == pytest.approx(MAX_GAP)


def test_bad_or_old_reports_change_nothing() -> None:
    hand, fingers, _ = grasp(0.016)
    t, force = fingers.t, np.full(2, 3.0)
    for report in (
        HandState(t + 0.1, math.nan, np.zeros(2), force),
        HandState(t + 0.1, 0.016, np.zeros(2), np.array([math.nan, 3.0])),
        HandState(math.nan, 0.016, np.zeros(2), force),
        HandState(t + 0.1, 0.016, np.zeros(2), np.zeros(3)),
        HandState(t - 1, 0.0, np.zeros(2), np.zeros(2)),
    ):
        command = hand.step(report, t + 0.1)
        assert hand.status().holding
        assert (command.t, command.gap) == (t + 0.1, 0.0)


def test_a_grip_of_which_nothing_is_heard_any_more_is_not_believed_in() -> None:
    hand, fingers, _ = grasp(0.016)
    last = HandState(fingers.t, 0.016, np.full(2, 0.008), np.full(2, 3.0))
    assert hand.step(last, fingers.t + 0.19).gap == 0.0 and hand.status().holding
    assert hand.step(last, fingers.t + 0.21).gap == 0.0  # the fingers go on pressing
    assert hand.status().state is GripState.SLIPPED


def test_a_hand_opens_no_further_than_it_can() -> None:
    hand = MagpieHand(MagpieConfig(max_gap=0.104))
    state = HandState(0.0, 0.0, np.zeros(2), np.zeros(2))
    assert hand.step(state, 0.0).gap == 0.104
    hand.open(0.05)
    assert hand.step(state, 0.0).gap == 0.05


def test_before_the_first_report_nothing_is_known() -> None:
    status = MagpieHand().status()
    assert math.isnan(status.gap) and not status.holding


@given(st.floats())
def test_a_commanded_force_is_always_one_the_servo_can_be_told(force: float) -> None:
    told = clamp_force(force)
    assert MIN_FORCE <= told <= MAX_FORCE
    steps = (told - MIN_FORCE) / FORCE_STEP
    assert abs(steps - round(steps)) < 1e-6 or told == MAX_FORCE
    if MIN_FORCE <= force <= MAX_FORCE:
        assert abs(told - force) <= FORCE_STEP / 2 + 1e-9


@given(st.floats(allow_nan=False))
def test_a_commanded_gap_is_always_one_the_hand_can_reach(gap: float) -> None:
    hand = MagpieHand()
    hand.open(gap)
    command = hand.step(HandState(0.0, 0.05, np.full(2, 0.025), np.zeros(2)), 0.0)
    assert 0.0 <= command.gap <= MAX_GAP
