"""A stack around a user's module: whatever the module does wrong ends in a fault with its name, not in a traceback."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from golem.errors import ConfigError, GolemError, ModuleFault
from golem.interfaces import topics
from golem.interfaces.payloads import GateState
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.stack import Choice, Stack

GOOD = """
import numpy as np
from golem.interfaces.payloads import ArmCommand, GripState, HandStatus, LegCommand
from golem.capabilities.legs.base import Envelope
from golem.capabilities.legs.gait import GaitConfig
from golem.types import BaseEstimate, HandCommand, LowCommand

BROKEN = {broken!r}

class Estimator:
    def reset(self, state): pass
    def step(self, state, dt):
        I = np.eye(4)
        return {{"": BaseEstimate(state.t, I), "none": None, "nan": BaseEstimate(state.t, I * np.nan),
                "shape": BaseEstimate(state.t, I[:3, :3])}}[BROKEN]

class Servo:
    def reset(self, state): pass
    def step(self, state, q_cmd, dt, leg_gains=None, leg_tau=None):
        z, n = np.zeros(27), np.full(27, np.nan)
        bad = {{"": z, "nan": n, "shape": np.zeros(26), "none": None}}[BROKEN]
        return None if BROKEN == "none" else LowCommand(state.t, q_cmd, z, bad, z + 200.0, z + 5.0)

class Hand:
    def open(self, gap): pass
    def close(self, force): pass
    def status(self): return HandStatus(0.0, GripState.OPEN, 0.0, 0.0, np.zeros(2))
    def step(self, state, t):
        return {{"": HandCommand(t, 0.05, 1.0), "none": None, "nan": HandCommand(t, np.nan, 1.0),
                "shape": HandCommand(t, np.zeros(2), 1.0)}}[BROKEN]

class Legs:
    rate, latency, envelope, gait = 50.0, 0.0, Envelope(), GaitConfig()
    def reset(self, state): pass
    def step(self, state, base, motion, dt):
        q, kp, kd = state.q[:12], np.full(12, 200.0), np.full(12, 5.0)
        return {{"": LegCommand(q, kp, kd), "none": None, "nan": LegCommand(q, kp * np.nan, kd),
                "shape": LegCommand(np.zeros(27), kp, kd)}}[BROKEN]

class Arms:
    rate, latency = 100.0, 0.0
    def reset(self, q): self.q = q[12:]
    def step(self, left, right, q, dt):
        z = np.zeros(2)
        return {{"": ArmCommand(self.q, z, z, False), "none": None, "nan": ArmCommand(self.q * np.nan, z, z, False),
                "shape": ArmCommand(q, z, z, False)}}[BROKEN]

class Eyes:
    latency = 0.0
    def locate(self, frame, labels):
        return {{"": [], "none": None, "nan": [1.0], "shape": ["screw"]}}[BROKEN]
"""
SLOTS = {
    "estimator": "Estimator",
    "servo": "Servo",
    "hand": "Hand",
    "lower_body": "Legs",
    "upper_body": "Arms",
    "localizer": "Eyes",
}


class Look:
    """A skill that looks."""

    name = "look"

    async def run(self, context: Context, goal: None) -> SkillResult:
        with context.watch("head", "screw") as eye:
            await eye.look(1.0)
        return SkillResult(True, "done", None, "Looked.")


def running(slot: str, use: str, options: dict[str, Any] | None = None) -> LockstepRunner:
    """Return a stack with another module in one slot."""
    return build(Stack({slot: Choice(use, options or {})}, profile="ideal"), seed=0)[0]


@pytest.fixture
def module(tmp_path: Path) -> Callable[[str, str], str]:
    """Writes a module for a slot that is broken in a certain way; returns how a stack names it."""

    def write(slot: str, broken: str, extra: str = "") -> str:
        path = tmp_path / f"mine_{slot}_{broken or 'good'}.py"
        path.write_text(GOOD.format(broken=broken) + extra)
        return f"{path}:{SLOTS[slot]}"

    return write


@pytest.mark.parametrize("slot", SLOTS)
def test_a_users_module_runs_in_every_slot(slot: str, module: Callable[[str, str], str]) -> None:
    stack = running(slot, module(slot, ""))
    assert stack.execute(Look(), None, timeout=0.5).success
    assert stack.safety is not None and stack.safety.state is GateState.ACTIVE


@pytest.mark.parametrize("broken", ["none", "nan", "shape"])
@pytest.mark.parametrize("slot", [slot for slot in SLOTS if slot != "lower_body"])
def test_what_a_module_returns_wrongly_is_its_fault(slot: str, broken: str, module: Callable[[str, str], str]) -> None:
    use = module(slot, broken)
    stack = running(slot, use)
    if slot == "localizer":  # the robot goes on without
        result = stack.execute(Look(), None, timeout=0.5)
        assert (result.success, result.stage, result.slot) == (False, "fault", slot) and use in result.reason
        assert stack.safety is not None and stack.safety.state is GateState.ACTIVE
        return
    with pytest.raises(ModuleFault) as caught:
        stack.execute(Look(), None, timeout=0.5)
    assert (caught.value.slot, caught.value.use) == (slot, use)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("return ArmCommand(np.zeros(15, int), np.zeros(2), np.zeros(2), False)", "its target of .* jumps by"),
        (
            "self.q = self.q + 0.4 * (np.arange(15) == 1); return ArmCommand(self.q, np.zeros(2), np.zeros(2), False)",
            "jumps by 0.4 rad",
        ),
        ("return ArmCommand(self.q + 3.0, np.zeros(2), np.zeros(2), False)", "outside its limits"),
        ("raise SystemExit(1)", r"SystemExit: 1 \(mine_upper_body_good.py:\d+\)"),
    ],
)
def test_arms_that_leave_their_limits_or_end_the_process_are_named(
    line: str, reason: str, module: Callable[[str, str, str], str]
) -> None:
    use = module("upper_body", "", f"def step(self, left, right, q, dt):\n    {line}\nArms.step = step\n")
    with pytest.raises(ModuleFault, match=reason) as caught:
        running("upper_body", use).execute(Look(), None, timeout=0.5)
    assert (caught.value.slot, caught.value.use) == ("upper_body", use)


def test_a_skill_is_told_where_the_module_that_ended_it_failed(module: Callable[[str, str, str], str]) -> None:
    use = module("localizer", "", "def locate(self, frame, labels):\n    return 1 / 0\nEyes.locate = locate\n")
    result = running("localizer", use).execute(Look(), None, timeout=0.5)
    assert "ZeroDivisionError: division by zero (mine_localizer_good.py:" in result.reason
    assert (result.trace or "").splitlines()[2:] == ["    return 1 / 0", "ZeroDivisionError: division by zero"]


def test_a_skill_that_fails_itself_is_told_where() -> None:
    class Fails:
        name = "fails"

        async def run(self, context: Context, goal: None) -> SkillResult:
            raise SystemExit("enough")

    result = running("hand", "magpie").execute(Fails(), None, timeout=0.5)
    assert (result.stage, result.slot) == ("fault", "skill")
    assert "fails failed: SystemExit: enough (test_nodes.py:" in result.reason and "in run" in (result.trace or "")


@pytest.mark.parametrize("slot", SLOTS)
def test_a_module_without_its_methods_is_refused_when_the_stack_is_built(slot: str, tmp_path: Path) -> None:
    path = tmp_path / f"empty_{slot}.py"
    path.write_text("class Empty:\n    rate, latency = 50.0, 0.0\n")
    with pytest.raises(ConfigError, match="it lacks .* of the contract"):
        running(slot, f"{path}:Empty")


@pytest.mark.parametrize(
    ("slot", "line"),
    [
        ("lower_body", "Legs.rate = 0.0"),
        ("upper_body", "Arms.rate = float('nan')"),
        ("upper_body", "Arms.rate = 'fast'"),
        ("lower_body", "Legs.latency = -0.1"),
        ("localizer", "Eyes.latency = None"),
    ],
)
def test_a_rate_or_latency_that_is_none_is_refused(
    slot: str, line: str, module: Callable[[str, str, str], str]
) -> None:
    with pytest.raises(ModuleFault, match=rf"{line.split('.')[1].split(' ')[0]} is .*finite number of at least"):
        running(slot, module(slot, "", line))


@pytest.mark.parametrize(
    ("line", "what"),
    [
        ("Legs.envelope = ((-0.4, 0.8), (0.0, 0.0), (0.0, 0.0))", "envelope is a tuple, .* Envelope"),
        ("Legs.gait = 'trot'", "gait is a str, .* GaitConfig"),
    ],
)
def test_legs_whose_envelope_or_clock_is_none_are_refused(
    line: str, what: str, module: Callable[[str, str, str], str]
) -> None:
    with pytest.raises(ModuleFault, match=what):
        running("lower_body", module("lower_body", "", line))


def test_a_controller_faster_than_the_clock_is_refused(module: Callable[[str, str, str], str]) -> None:
    with pytest.raises(ConfigError, match="UpperBodyNode wants to run at 1000 Hz"):
        running("upper_body", module("upper_body", "", "Arms.rate = 1000.0"))


def test_a_robot_that_lacks_its_methods_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "robot.py"
    path.write_text("class R:\n    cameras = {}\n")
    with pytest.raises(ModuleFault, match="robot: .*it lacks .*advance.* of the contract Robot"):
        running("robot", f"{path}:R")


def test_the_gate_is_active_from_the_first_tick_on_and_only_it_writes_the_motors() -> None:
    stack = running("hand", "magpie")
    stack.executor.run(0.05)
    assert stack.safety is not None and stack.safety.state is GateState.ACTIVE
    assert stack.bus.count(topics.LOW_CMD) == stack.bus.count(topics.SAFETY) == 25


def test_a_pressed_stop_ends_the_skill_with_a_result_that_says_so() -> None:
    stack = running("hand", "magpie")

    class Press:
        name = "press"

        async def run(self, context: Context, goal: None) -> SkillResult:
            await context.sleep(0.1)
            stack.estop.press()
            await context.sleep(1.0)
            return SkillResult(True, "done", None, "Not reached.")

    result = stack.execute(Press(), None, timeout=2.0)
    assert (result.success, result.stage, result.slot) == (False, "safety", "safety")
    assert "estop_pressed" in result.reason
    assert stack.executor.t < 0.15


def test_a_skill_that_takes_too_long_is_given_up() -> None:
    stack = running("hand", "magpie")

    class Sleep:
        name = "sleep"
        cancelled = False

        async def run(self, context: Context, goal: None) -> SkillResult:
            try:
                await context.sleep(10.0)
            finally:
                self.cancelled = True
            return SkillResult(True, "done", None, "Not reached.")

    skill = Sleep()
    result = stack.execute(skill, None, timeout=0.1)
    assert (result.success, result.stage) == (False, "timeout")
    assert skill.cancelled
    assert stack.executor.t == pytest.approx(0.1, abs=0.003)


def test_two_skills_at_once_are_refused() -> None:
    stack = running("hand", "magpie")
    first = stack.start(Look(), None)
    with pytest.raises(GolemError, match="Another skill is running"):
        stack.start(Look(), None)
    first.cancel()
    stack.start(Look(), None).cancel()
