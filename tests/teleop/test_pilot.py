from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from golem.teleop.pilot import SILENCE, BadMessage, HandPilot

HOLD = {"hold": True, "right": {"v": [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]}}


def test_only_a_held_switch_moves_anything() -> None:
    pilot = HandPilot()
    pilot.hear("a", {**HOLD, "hold": False}, 0.0)
    assert not pilot.wish(0.0).moves
    pilot.hear("a", HOLD, 0.1)
    wish = pilot.wish(0.1)
    assert wish.moves and wish.rates["right"][0] == pytest.approx(pilot.config.speed)


def test_a_silent_window_has_let_go() -> None:
    pilot = HandPilot()
    pilot.hear("a", HOLD, 0.0)
    assert pilot.wish(0.9 * SILENCE).moves
    assert not pilot.wish(1.1 * SILENCE).moves


def test_a_window_that_is_gone_has_let_go() -> None:
    pilot = HandPilot()
    pilot.hear("a", HOLD, 0.0)
    pilot.leave("a")
    assert not pilot.wish(0.0).moves


def test_two_that_hold_get_nothing_until_both_let_go() -> None:
    pilot = HandPilot()
    pilot.hear("a", HOLD, 0.0)
    pilot.hear("b", HOLD, 0.0)
    assert not pilot.wish(0.0).moves and pilot.state == "two"
    pilot.hear("b", {"hold": False}, 0.1)
    pilot.hear("a", HOLD, 0.1)
    assert not pilot.wish(0.1).moves  # who held on does not win
    pilot.hear("a", {"hold": False}, 0.2)
    pilot.wish(0.2)
    pilot.hear("a", HOLD, 0.3)
    assert pilot.wish(0.3).moves and pilot.state == "a"


def test_who_watches_disturbs_nobody() -> None:
    pilot = HandPilot()
    pilot.hear("a", HOLD, 0.0)
    pilot.hear("b", {"hold": False, "twist": [1.0, 0.0, 0.0]}, 0.0)
    wish = pilot.wish(0.0)
    assert wish.moves and not wish.twist.any()


def test_a_drag_holds_until_it_is_let_go() -> None:
    pilot, T = HandPilot(), np.eye(4)
    pilot.drag("view 1", "left", T, 0.0)
    assert pilot.wish(10.0).goals["left"] is T
    pilot.drag("view 1", "left", None, 10.0)
    assert not pilot.wish(10.0).moves


@pytest.mark.parametrize(
    "message",
    [
        None,
        [],
        {"hold": True, "right": 3},
        {"hold": True, "right": {"v": [1.0]}},
        {"hold": True, "right": {"v": [math.nan] * 6}},
        {"hold": True, "right": {"v": [2.0] + [0.0] * 5}},
        {"hold": True, "right": {"v": "abcdef"}},
        {"hold": True, "right": {"device": [0.0] * 7}},
        {"hold": True, "right": {"grip": [0.1]}},
        {"hold": True, "twist": [math.inf, 0, 0]},
        {"hold": True, "twist": [True, 0, 0]},
        {"hold": True, "lift": 5.0},
    ],
)
def test_nonsense_is_a_hand_off_the_switch(message: Any) -> None:
    pilot = HandPilot()
    pilot.hear("a", HOLD, 0.0)
    with pytest.raises(BadMessage):
        pilot.hear("a", message, 0.1)
    assert not pilot.wish(0.1).moves
