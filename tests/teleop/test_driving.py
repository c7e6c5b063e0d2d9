"""A robot in lock-step whose pilot lives on robot time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from golem.interfaces import topics
from golem.runtime.executor import FOREVER
from golem.runtime.lockstep import LockstepRunner
from golem.teleop.driving import FAR, Driving
from golem.teleop.pilot import HandPilot, PilotConfig
from golem.types import Array

DOWN = {"hold": True, "right": {"v": [0.0, 0.0, -1.0, 0.0, 0.0, 0.0]}}
SWAY = 0.006
"""How far a robot that hangs moves in its hoist while its hand stays in odom [m]."""


class Cockpit:
    """A pilot and the robot that follows."""

    def __init__(self, running: LockstepRunner, **config: Any) -> None:
        self.running, self.pilot = running, HandPilot(PilotConfig(**config))
        self.driving = Driving(self.pilot, lambda: running.executor.t)
        self.run = running.start(self.driving, None)
        self.hands: list[tuple[float, Array, Array]] = []
        self.until(1.0)

    def until(self, t: float, say: Callable[[float], Any] = lambda t: None, side: str = "right") -> None:
        """Let time pass, and keep where the hand is and is sent, in base_link, 100 times a second."""
        arm = self.running.context.arms["right" if side == "right" else "left"]

        def over() -> bool:
            now = self.running.executor.t
            said = say(now)
            if said is not None:
                self.pilot.hear("a", said, now)
            if round(now / 0.002) % 5 == 0:
                self.hands.append((now, arm.pose.copy(), arm.commanded.copy()))
            return now >= t

        self.running.executor.run(FOREVER, over)

    @property
    def hand(self) -> Array:
        return self.hands[-1][1][:3, 3]


@pytest.fixture
def cockpit(twin: tuple[LockstepRunner, Any]) -> Cockpit:
    return Cockpit(twin[0])


def test_the_hand_follows_the_rates(cockpit: Cockpit) -> None:
    start = cockpit.hand
    cockpit.until(2.0, lambda t: DOWN)
    cockpit.until(2.3, lambda t: {"hold": True})
    moved = cockpit.hand - start
    assert moved[2] == pytest.approx(-0.15, abs=0.01) and np.abs(moved[:2]).max() < SWAY
    # What the pilot asks for, what the arm is sent, and where it is: the way from the first to the second is ours.
    sent = np.array([(t, goal[2, 3]) for t, _, goal in cockpit.hands if 1.2 < t < 1.95])
    asked = start[2] - 0.15 * (sent[:, 0] - 1.0)
    assert np.sqrt(np.mean((sent[:, 1] - asked) ** 2)) < min(0.005, 0.06 * 0.15)


@pytest.mark.parametrize("end", ["let go", "cut", "nonsense"])
def test_without_a_hand_on_the_switch_it_holds_still(cockpit: Cockpit, end: str) -> None:
    cockpit.until(1.5, lambda t: DOWN)
    if end == "let go":
        cockpit.pilot.hear("a", {"hold": False}, cockpit.running.executor.t)
    elif end == "cut":
        cockpit.pilot.leave("a")
    else:
        with pytest.raises(Exception, match="map"):
            cockpit.pilot.hear("a", 7, cockpit.running.executor.t)
    cockpit.until(2.2)
    still = cockpit.hand
    cockpit.until(3.5)
    assert np.linalg.norm(cockpit.hand - still) < SWAY
    safety = cockpit.running.safety
    assert safety is not None and not safety.stopped


def test_a_gizmo_thrown_away_is_refused_and_the_hand_stays(cockpit: Cockpit) -> None:
    start, T = cockpit.hand, cockpit.hands[-1][1].copy()
    T[0, 3] += 2.0
    cockpit.pilot.drag("view 1", "right", T, 1.0)
    cockpit.until(2.5)
    assert "too far" in cockpit.driving.refused["right"]
    assert np.linalg.norm(cockpit.hand - start) < SWAY


def test_a_goal_beyond_the_arm_says_so_and_stops_nobody(cockpit: Cockpit) -> None:
    T = cockpit.hands[-1][1].copy()
    T[0, 3] += 0.9 * FAR
    cockpit.pilot.drag("view 1", "right", T, 1.0)
    cockpit.until(4.5)
    assert cockpit.driving.refused["right"]
    safety = cockpit.running.safety
    assert safety is not None and not safety.stopped and cockpit.run.result is None


def test_a_dragged_goal_is_gone_to(cockpit: Cockpit) -> None:
    T = cockpit.hands[-1][1].copy()
    T[:3, 3] += (0.03, 0.05, -0.1)
    cockpit.pilot.drag("view 1", "right", T, 1.0)
    cockpit.until(2.5)
    assert np.linalg.norm(cockpit.hand - T[:3, 3]) < SWAY


def test_a_tracked_hand_moves_from_where_the_clutch_was_gripped(cockpit: Cockpit) -> None:
    start = cockpit.hand

    def device(x: float, hold: bool) -> dict[str, Any]:
        return {"hold": hold, "right": {"device": [x, 5.0, 1.0, 1.0, 0.0, 0.0, 0.0]}}

    cockpit.until(1.1, lambda t: device(3.0, False))
    cockpit.until(2.0, lambda t: device(3.0 + 0.05 * min(t - 1.1, 0.8), True))
    cockpit.until(2.2, lambda t: device(9.0, False))  # carried back with the clutch open
    cockpit.until(2.6, lambda t: device(9.0, True))
    assert cockpit.hand[0] - start[0] == pytest.approx(0.04, abs=0.006)


def test_hands_close_and_open(cockpit: Cockpit) -> None:
    cockpit.until(2.5, lambda t: {"hold": True, "left": {"grip": 0.0}}, side="left")
    status = cockpit.running.bus.latest(topics.hand_status("left"))
    assert status is not None and status.gap < 0.01
    cockpit.until(4.0, lambda t: {"hold": True, "left": {"grip": 0.08}}, side="left")
    status = cockpit.running.bus.latest(topics.hand_status("left"))
    assert status is not None and status.gap == pytest.approx(0.08, abs=0.01)


def test_the_waist_turns_and_the_hand_stays(cockpit: Cockpit) -> None:
    cockpit.until(1.2, lambda t: DOWN)
    cockpit.until(1.6, lambda t: {"hold": True})
    start, turned = cockpit.hand, cockpit.running.context.joints[0]
    cockpit.until(4.0, lambda t: {"hold": True, "waist": 0.5})
    assert cockpit.running.context.joints[0] - turned > 0.1
    assert np.linalg.norm(cockpit.hand - start) < 2.0 * SWAY


@pytest.mark.slow
def test_a_standing_robot_walks_and_stands_when_let_go(walker: tuple[LockstepRunner, Any]) -> None:
    running, robot = walker
    running.executor.run(8.0, lambda: not robot.on_gantry)
    begun = running.executor.t
    cockpit = Cockpit(running)
    cockpit.until(begun + 1.0)
    x = running.context.T_odom_base[0, 3]
    cockpit.until(begun + 4.0, lambda t: {"hold": True, "twist": [1.0, 0.0, 0.0]})
    assert running.context.T_odom_base[0, 3] - x > 0.3
    cockpit.until(begun + 6.0)
    there = running.context.T_odom_base[:2, 3].copy()
    cockpit.until(begun + 7.0)
    assert np.linalg.norm(running.context.T_odom_base[:2, 3] - there) < 0.05
