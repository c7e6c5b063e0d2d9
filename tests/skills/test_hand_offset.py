from __future__ import annotations

import numpy as np
import pytest

from golem.robots.worlds.ioniq5 import Ioniq5Layout
from golem.skills.hand_offset import DROOP, Droop, hand_offset
from golem.skills.poses import moved
from golem.types import Array

EDGE = np.array(
    [
        (0.02, -0.57, 0.0), (0.02, -0.46, 0.0), (0.02, -0.34, 0.0), (0.02, -0.3, 0.0),
        (-0.02, -0.47, -0.065), (-0.02, -0.34, -0.065),
    ]
)  # fmt: skip


@pytest.mark.parametrize("off", [(0.0, 0.0, 0.0), (-0.05, 0.03, 0.02), (0.04, -0.045, -0.03)])
def test_what_several_agree_on_is_the_offset(off: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(0)
    seen = EDGE[[1, 3, 4]] + off + rng.normal(0.0, 0.003, (3, 3))
    found = hand_offset(seen, EDGE + rng.normal(0.0, 0.003, EDGE.shape))
    assert found is not None and np.allclose(found, off, atol=0.008)


def test_one_more_that_only_the_hand_sees_does_not_matter() -> None:
    seen = np.vstack([EDGE[[1, 3, 4]] + (0.03, 0.02, 0.0), [(0.2, 0.1, 0.0)]])
    found = hand_offset(seen, EDGE)
    assert found is not None and np.allclose(found, (0.03, 0.02, 0.0))


@pytest.mark.parametrize("seen", [EDGE[:0], EDGE[:1], EDGE[:3] + (0.3, 0.0, 0.0)])
def test_too_little_is_unclear(seen: np.ndarray) -> None:
    assert hand_offset(seen, EDGE) is None


def test_a_left_hand_before_the_ledge_of_a_real_pack() -> None:
    """Seen in a trial: by the nearest one alone the hand took its neighbour, three centimetres inwards and higher."""
    pack = Ioniq5Layout().fasteners()
    known = pack[[7, 8, 9, 10, 11, 75, 76]] + (0.947, 0.077, -0.082)
    seen = np.array([(0.913, 0.379, -0.107), (0.876, 0.444, -0.168), (0.92, 0.286, -0.111)])
    found = hand_offset(seen, known)
    assert found is not None and np.allclose(found, (-0.048, -0.022, -0.025), atol=1e-3)


def test_nothing_known_is_unclear() -> None:
    assert hand_offset(EDGE[:3], EDGE[:0]) is None


def test_a_regular_row_is_unclear() -> None:
    row = np.array([(0.0, 0.034 * k, 0.0) for k in range(8)])
    assert hand_offset(row[3:5] + (0.0, 0.017, 0.0), row) is None


def come(friction: float, held: Array, late: int, seconds: float = 12.0) -> tuple[Array, float]:
    """Return (2,) how far a hand is beside its goal in the end, and the longest way it swings in the last 2 s [m].

    Args:
        friction: it follows only what is sent farther off than this [m].
        held: (3,) by how much it stays behind where it is sent [m].
        late: ticks of 10 ms after which it is measured.
    """
    droop, goal, dt = Droop(), np.eye(4), 0.01
    goal[:3, :3] = np.diag((1.0, -1.0, -1.0))
    hand, sent, places = goal.copy(), goal.copy(), [goal[:3, 3]]
    for _ in range(round(seconds / dt)):
        now = goal.copy()
        now[:3, 3] = places[max(len(places) - late, 0)]
        wanted = goal[:3, 3] + droop(goal, sent, now, dt)
        sent[:3, 3] += 0.3 * (wanted - sent[:3, 3])
        left = sent[:3, 3] + held - hand[:3, 3]
        size = float(np.linalg.norm(left))
        if size > friction:
            hand[:3, 3] += 0.25 * left * (1.0 - 0.5 * friction / size)
        places.append(hand[:3, 3].copy())
    end = np.array(places)[-round(2.0 / dt) :, :2]
    return end[-1], float(np.ptp(end, axis=0).max())


@pytest.mark.parametrize("friction", [0.0, 0.001, 0.002])
@pytest.mark.parametrize("late", [1, 30, 70])
def test_a_hand_comes_to_rest_at_its_goal_however_late_and_held_by_friction(friction: float, late: int) -> None:
    left, swings = come(friction, np.array([0.005, -0.003, 0.01]), late)
    assert np.linalg.norm(left) < 0.003 and swings < 0.003


def test_along_the_approach_nothing_is_made_up() -> None:
    goal, now = np.eye(4), np.eye(4)
    now[:3, 3] = (0.0, 0.002, 0.02)
    sent = Droop()(goal, goal, now, 0.1)
    assert sent[1] < 0.0 and (sent[0], sent[2]) == (0.0, 0.0)


def test_it_is_made_up_for_a_little_way_alone_and_where_the_hand_arrives() -> None:
    droop, goal, now, far = Droop(), np.eye(4), np.eye(4), np.eye(4)
    now[:3, 3], far[:3, 3] = (0.03, 0.0, 0.0), (0.05, 0.0, 0.0)
    assert not droop(goal, far, now, 0.01).any()
    for _ in range(200):
        sent = droop(goal, moved(goal, droop(goal, goal, now, 0.0)), now, 0.01)
    assert np.allclose(sent, (-DROOP, 0.0, 0.0))
