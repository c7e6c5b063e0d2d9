"""A robot in lock-step whose arms a policy server moves, or fails to."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("websockets")
pytest.importorskip("msgpack")
from tests.capabilities.policies.servers import late, policy_server
from tests.dashboard.conftest import BLIND

from golem.capabilities.policies.vectors import ACTION, GRIPS, STATE
from golem.interfaces import topics
from golem.runtime.lockstep import build
from golem.skills.base import SkillResult
from golem.stack import Stack
from golem.types import Array, Twist

PALMS = slice(list(STATE).index("left_palm.x"), list(STATE).index("left_palm.x") + 18)


def run(
    answer: Callable[[dict[str, Any]], Any], seconds: float = 2.0, timeout: float = 2.0
) -> tuple[SkillResult, Array]:
    """Return how the skill ended, and how far the hands moved [m]."""
    running, robot = build(Stack(profile="bench").with_choice("localizer", BLIND), 0)
    try:
        running.executor.run(1.0)
        arms = running.context.arms
        before = np.array([arms[side].pose[:3, 3] for side in ("left", "right")])
        with policy_server(answer) as port:
            from golem.capabilities.policies.openpi import PolicyLinkConfig
            from golem.skills.served_policy import PolicyGoal, PolicySkill

            skill = PolicySkill(PolicyLinkConfig(port=port, cameras=(), timeout=timeout))
            result = running.execute(skill, PolicyGoal("down", seconds))
        after = np.array([arms[side].pose[:3, 3] for side in ("left", "right")])
        return result, after - before
    finally:
        robot.close()


def stay(seen: dict[str, Any]) -> Array:
    """Return the action that keeps the hands where they are."""
    action = np.zeros((8, len(ACTION)))
    action[:, :18] = seen["observation.state"][PALMS]
    action[:, GRIPS] = 0.05
    return action


def test_the_hands_go_where_the_policy_says() -> None:
    asked: list[dict[str, Any]] = []

    def down(seen: dict[str, Any]) -> Array:
        asked.append(seen)
        action = stay(seen)
        action[:, 11] -= 0.03
        return action

    result, moved = run(down)
    assert result.success, result.reason
    assert moved[1, 2] < -0.05 and abs(moved[0, 2]) < 0.03
    assert asked[0]["prompt"] == "down" and 3 <= len(asked) <= 5


def nan(seen: dict[str, Any]) -> Array:
    return np.full((8, 25), np.nan)


def far(seen: dict[str, Any]) -> Array:
    action = stay(seen)
    action[:, 9] += 2.0
    return action


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (nan, "NaN"),
        (lambda seen: np.zeros((8, 7)), "shape"),
        (lambda seen: "Traceback\nValueError: boom", "ValueError: boom"),
        (far, "2.00 m away"),
        (late(3.0), "no answer within"),
    ],
)
def test_a_policy_that_fails_leaves_the_arms_where_they_were(answer: Any, words: str) -> None:
    result, moved = run(answer, timeout=0.5)
    assert not result.success and result.stage == "policy" and words in result.reason
    assert result.reason.count("The arms stay where they are.") == 1
    assert np.linalg.norm(moved, axis=1).max() < 0.012  # what the hoist sways


def test_cancelled_it_leaves_the_legs_standing(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from golem.capabilities.policies.openpi import PolicyLinkConfig
    from golem.skills import served_policy

    link = SimpleNamespace(close=lambda: None, step=lambda *_: np.zeros(len(ACTION)))
    monkeypatch.setattr(served_policy, "open_policy", lambda config: (link, config))
    monkeypatch.setattr(served_policy, "ActionStream", lambda *_: link)
    monkeypatch.setattr(served_policy.PolicySkill, "_do", lambda self, context, action: context.legs.drive(Twist(0.3)))
    skill = served_policy.PolicySkill(PolicyLinkConfig(cameras=()))
    run = world.run(skill.run(world.context, served_policy.PolicyGoal()), 5)
    assert world.bus.latest(topics.TWIST) == Twist(0.3)
    run.cancel()
    assert run.result is not None and run.result.stage == "cancelled"
    assert world.bus.latest(topics.TWIST) == Twist()
