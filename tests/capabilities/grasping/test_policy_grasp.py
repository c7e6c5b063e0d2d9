"""The grasp method `policy`, on its own and as a method of the ladder."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("websockets")
pytest.importorskip("msgpack")
from tests.capabilities.grasping.things import can

from golem.capabilities.grasping.base import SeeingLaw, ServoStatus
from golem.capabilities.grasping.policy_grasp import FAR, PolicyGrasp, PolicyGraspConfig, PolicyLaw
from golem.capabilities.policies.vectors import GRIPS, ActionRefused, palm_numbers
from golem.errors import ConfigError
from golem.evaluation.base import TrialSpec, rung_class
from golem.types import Array

HAND: Array = np.array([[0, 1, 0, 0.4], [1, 0, 0, -0.2], [0, 0, -1, 0.1], [0, 0, 0, 1.0]])


class Scripted:
    """Answers with one action again and again."""

    def __init__(self, pose: Array, gap: float) -> None:
        self.action = np.zeros((4, 25))
        self.action[:, :9] = self.action[:, 9:18] = palm_numbers(pose)
        self.action[:, GRIPS] = gap

    def infer(self, observation: Any) -> Array:
        return self.action


def law(pose: Array, gap: float, **given: Any) -> PolicyLaw:
    return PolicyLaw(Scripted(pose, gap), PolicyGraspConfig(latency=0.0, **given), can(), 0.05)


def test_the_hand_goes_where_the_policy_says_seen_from_the_base() -> None:
    goal, base = HAND.copy(), np.eye(4)
    goal[2, 3] -= 0.02
    base[0, 3] = 0.01
    one = law(goal, 0.05)
    assert isinstance(one, SeeingLaw)
    before = one.step(0.0, None, HAND)
    assert before.status is ServoStatus.TRACKING and np.array_equal(before.T_odom_gripper, HAND)
    one.see(0.0, "right", base, lambda: {}, False)
    np.testing.assert_allclose(one.step(0.0, None, HAND).T_odom_gripper, base @ goal)


def test_fingers_close_once_the_policy_asks_for_it_for_a_while() -> None:
    one = law(HAND, 0.0)
    told: list[ServoStatus] = []
    for k in range(5):
        one.see(0.01 * k, "right", np.eye(4), lambda: {}, False)
        told.append(one.step(0.01 * k, None, HAND).status)
    assert told == [ServoStatus.TRACKING] * 2 + [ServoStatus.CONVERGED] * 3


def test_a_step_too_far_is_refused() -> None:
    goal = HAND.copy()
    goal[0, 3] += FAR + 0.1
    one = law(goal, 0.05)
    one.see(0.0, "right", np.eye(4), lambda: {}, False)
    with pytest.raises(ActionRefused, match=r"0.25 m away"):
        one.step(0.0, None, HAND)


def test_a_file_that_is_no_policy_is_named(tmp_path: Path) -> None:
    for path in (tmp_path / "none.onnx", tmp_path / "other.onnx"):
        if path.stem == "other":
            path.write_bytes(b"x")
        with pytest.raises(ConfigError, match=path.name):
            PolicyGrasp(PolicyGraspConfig(file=str(path)))


@pytest.mark.slow
def test_a_server_that_is_not_there_loses_the_trial_by_its_name() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    from golem.evaluation.harness.trials import run_trial

    spec = TrialSpec("tether", f"{{use: policy, port: {port}}}", "field", 0, 0)
    outcome = run_trial(rung_class("tether")(), spec)
    assert not outcome.success and outcome.module is not None and "policy" in outcome.module
    assert outcome.module.startswith("grasp_method") and f"127.0.0.1:{port} cannot be reached" in outcome.detail
