"""Real robots on their feet: who stands, who falls, who is stopped, and who is to blame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.evaluation.episodes import episode as episodes
from golem.evaluation.episodes.episode import Episode, legs_stack, with_legs
from golem.evaluation.episodes.scripted_motion import WIDE_AREA, ArmMotion, ScriptedMotion
from golem.evaluation.rungs.leg_rung import NOTHING, lifted
from golem.hardware.safety.base import SafetyLimits
from golem.interfaces import topics
from golem.robots.mujoco.shoves import shove
from golem.skills.base import FAULT
from golem.stack import Choice, Stack
from golem.types import Twist

METHODS = Path(__file__).parents[1] / "leg_methods.py"


def episode(name: str, lift: str = NOTHING) -> Episode:
    return Episode(legs_stack(f"{METHODS}:{name}", "ideal"), 0, limits=lifted(SafetyLimits.from_profile(), lift))


def test_a_method_is_a_lower_body_or_the_files_of_a_policy() -> None:
    stack = Stack()
    assert with_legs(stack, "wbc").choice("lower_body") == Choice("wbc")
    assert with_legs(stack, "legs.py:Mine").choice("lower_body") == Choice("legs.py:Mine")
    files = {"file": "almi_open", "network": "net.pt"}
    assert with_legs(stack, "policy:almi_open:net.pt").choice("lower_body") == Choice("policy", files)
    assert with_legs(stack, "policy:mine.yaml").choice("lower_body") == Choice("policy", {"file": "mine.yaml"})
    vendor = with_legs(stack, "vendor:almi_open:net.pt")
    assert vendor.choice("lower_body") == Choice("vendor")
    assert vendor.choice("onboard") == Choice("policy", files)
    assert with_legs(stack, "{use: almi, walk: net.onnx}").choice("lower_body") == Choice("almi", {"walk": "net.onnx"})


def test_what_is_compared_is_not_replaced_as_well() -> None:
    with pytest.raises(ConfigError, match="leave out --use lower_body"):
        legs_stack("almi", "ideal", {"lower_body": "hold"})


@pytest.mark.parametrize(
    ("robot", "options"), [("physx", {}), ("{use: isaaclab, backend: newton}", {"backend": "newton"})]
)
def test_another_twin_keeps_the_options_and_brings_its_own(robot: str, options: dict[str, str]) -> None:
    choice = legs_stack("almi", "ideal", {"robot": robot}).choice("robot")
    assert choice.use in robot
    assert choice.options == {"support": "ground", "world": "open", **options}


def test_a_robot_that_never_carries_its_weight_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(episodes, "READY", 1.0)
    robot = episode("Limp")
    try:
        robot.stand(5.0)
        assert robot.over and robot.t == pytest.approx(1.0)
        assert robot.loss is not None and robot.loss.stage == "settle"
    finally:
        robot.close()


def test_a_robot_that_loses_its_balance_is_stopped_before_it_leans() -> None:
    robot = episode("Stiff")
    try:
        robot.stand(1.2)
        begin = robot.t
        robot.push(shove("front", 80.0))
        robot.run(3.0)
        loss, seen = robot.loss, robot.recorder.trace()
        assert loss is not None and loss.stage == "safety" and "balance_lost" in loss.detail
        assert robot.t < begin + 0.3 and 0.1 < seen.rpy[-1, 1] < 0.3
    finally:
        robot.close()


def test_a_robot_that_stands_is_pushed_over_and_the_gate_stops_it() -> None:
    robot = episode("Stiff", lift="balance")
    try:
        robot.stand(1.2)
        assert robot.loss is None and not robot.over
        assert robot.recorder.quiet > 1.0
        robot.push(shove("front", 80.0))
        robot.run(3.0)
        loss, seen = robot.loss, robot.recorder.trace()
        assert loss is not None and loss.stage == "safety" and "tilt" in loss.detail
        assert robot.t < 4.0, "a lost robot ends the run"
        robot.run(1.0)
        assert robot.t < 4.0, "and it stays so"
        assert seen.margin[-1] < -0.1 < 0.08 < seen.window(1.0, 1.2).margin.min()
        assert seen.force[:, 0].max() == pytest.approx(400.0) and not seen.force[-1].any()
        assert seen.rpy[-1, 1] > 0.3, "pushed ahead, it leans ahead"
    finally:
        robot.close()


def test_the_fallback_does_not_count_for_a_controller_that_failed() -> None:
    robot = episode("Broken")
    try:
        robot.run(2.5)
        loss = robot.loss
        assert loss is not None and loss.stage == FAULT and "my bug" in loss.detail
    finally:
        robot.close()


def test_an_exercise_moves_the_hands_through_the_work_area_and_commands_the_base() -> None:
    motion = ArmMotion(np.random.default_rng(3), WIDE_AREA)
    path = np.array([motion.positions(t) for t in np.arange(0.0, 60.0, 0.02)])
    middle = np.array([[0.43, 0.22, 0.20], [0.43, -0.22, 0.20]])
    assert (np.abs(path - middle) <= np.array(WIDE_AREA) + 1e-9).all()
    assert (np.ptp(path, axis=0) > np.array(WIDE_AREA)).all(), "more than half of the area is used"
    assert np.linalg.norm(np.diff(path, axis=0), axis=2).max() / 0.02 < 0.6
    robot = episode("Stiff")
    try:
        robot.start(ScriptedMotion(motion, lambda t: Twist(vx=0.1 * t)))
        robot.run(1.0)
        targets = robot.running.bus.latest(topics.PALM_TARGETS)
        status = robot.running.bus.latest(topics.LEG_STATUS)
        assert targets is not None and targets.left is not None and targets.right is not None
        assert status is not None and 0.08 < status.commanded.vx < 0.1
    finally:
        robot.close()
