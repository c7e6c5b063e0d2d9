"""Whatever the legs' controller does wrong, the robot ends on the fallback or damped, and says why."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from golem.capabilities.legs.hold import JointHold
from golem.capabilities.legs.locomotion import LocomotionConfig
from golem.errors import ConfigError, ModuleFault
from golem.interfaces import topics
from golem.interfaces.payloads import GateState, LegCommand, LegStatus
from golem.runtime.contract_check import ContractCheck
from golem.runtime.lockstep import LockstepRunner, build
from golem.runtime.lower_body_node import CheckedLowerBody
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.stack import Choice, Stack
from golem.types import LEGS, Twist

CONTROLLER = """
import time
import numpy as np
from golem.capabilities.legs.base import Envelope
from golem.interfaces.payloads import LegCommand
from golem.capabilities.legs.hold import JointHold

class Failing(JointHold):
    how: str
    def __init__(self):
        super().__init__()
        self.envelope = Envelope((-0.4, 0.8), (-0.3, 0.3), (-0.6, 0.6))
        self.ticks, self.motions = 0, []
    def step(self, state, base, motion, dt):
        self.ticks += 1
        good = super().step(state, base, motion, dt)
        if self.ticks <= 20:
            return good
        q, kp, kd = good.q, good.kp, good.kd
        if self.how == "raises": raise RuntimeError("gone")
        if self.how == "sleeps": time.sleep(1.1 / self.rate)
        if self.how == "lags": self.latency = 0.5
        if self.how == "unsure": self.latency = float("nan")
        return {{"nothing": None, "nan": LegCommand(q * np.nan, kp, kd), "shape": LegCommand(np.zeros(27), kp, kd),
                "torque": LegCommand(q, kp, kd, np.full(12, np.inf))}}.get(self.how, good)

class Chosen(Failing):
    how = "{how}"

class Late(Failing):
    how = "raises"
    def __init__(self):
        super().__init__()
        self.latency = 0.1

class Unmeasured(Failing):
    how = "unmeasured"
    @property
    def latency(self):
        return 0.01 / (self.ticks <= 20) if hasattr(self, "ticks") else 0.01
    @latency.setter
    def latency(self, value):
        pass

class Doomed(Failing):
    how = "raises"

class Slow(JointHold):
    slept = False
    def step(self, state, base, motion, dt):
        if not self.slept:
            time.sleep(1.1 / self.rate)
        self.slept = True
        return super().step(state, base, motion, dt)
"""


class Drive:
    """Sends one twist at every tick."""

    name = "drive"

    def __init__(self, twist: Twist | None = None, seconds: float = 3.0) -> None:
        self.twist, self.seconds = twist or Twist(0.5), seconds

    async def run(self, context: Context, goal: object) -> SkillResult:
        """Send it until the time is over."""
        end = context.t + self.seconds
        while context.t < end:
            context.publish(topics.TWIST, self.twist)
            await context.tick()
        return SkillResult(True, "done", None, "")


@contextmanager
def hanging(**choices: Choice) -> Iterator[LockstepRunner]:
    """A tethered stack with other modules in some slots."""
    running, robot = build(Stack(choices, profile="ideal"), seed=0)
    try:
        yield running
    finally:
        robot.close()


def write(folder: Path, how: str) -> Path:
    path = folder / f"legs_{how}.py"
    path.write_text(CONTROLLER.format(how=how))
    return path


def status(running: LockstepRunner) -> LegStatus:
    newest = running.bus.latest(topics.LEG_STATUS)
    assert newest is not None
    return newest


FAULTS = {
    "raises": "RuntimeError: gone",
    "nothing": "the leg command is a NoneType",
    "nan": "q contains NaN",
    "shape": "q has shape (27,)",
    "torque": "tau contains NaN or infinity",
    "lags": "its latency is 0.5 s, legs need at most 0.1 s",
    "unsure": "latency is nan",
    "unmeasured": "ZeroDivisionError",
}


@pytest.mark.parametrize("how", FAULTS)
def test_failed_legs_go_to_the_fallback_and_the_skill_ends_with_their_name(how: str, tmp_path: Path) -> None:
    use = f"{write(tmp_path, how)}:{'Unmeasured' if how == 'unmeasured' else 'Chosen'}"
    with hanging(lower_body=Choice(use), fallback=Choice("hold", {"stance": "crouch"})) as running:
        result = running.execute(Drive(), None, timeout=5.0)
        assert (result.success, result.stage, result.slot) == (False, "fault", "lower_body")
        assert result.reason == f"Module lower_body: {use} failed: " + result.reason.partition("failed: ")[2]
        assert FAULTS[how] in result.reason
        end = status(running)
        assert (end.controller, end.applied, end.stepping) == ("hold", Twist(), False)
        assert end.fault == result.reason
        # It failed after 0.4 s, and the fallback then had the time to take its posture.
        assert running.executor.t == pytest.approx(2.42, abs=0.1)
        assert running.safety is not None and running.safety.state is GateState.ACTIVE
        state = running.bus.latest(topics.LOW_STATE)
        command = running.bus.latest(topics.LOW_CMD)
        assert state is not None and command is not None
        np.testing.assert_allclose(command.q[[3, 9]], 0.8, atol=1e-6)
        np.testing.assert_allclose(state.q[LEGS], command.q[LEGS], atol=0.05)


def test_legs_that_take_longer_than_their_period_lose_them_where_the_wall_clock_counts(tmp_path: Path) -> None:
    use = f"{write(tmp_path, 'sleeps')}:Chosen"
    with hanging(lower_body=Choice(use)) as running:
        result = running.execute(Drive(seconds=0.6), None, timeout=5.0)
        assert result.success
    slow = Choice(use.replace("Chosen", "Slow"))
    with hanging(lower_body=Choice(use), fallback=slow) as running:
        # One late call of the fallback, its first, is no fault of its own.
        result = running.execute(Drive(), None, timeout=0.7, realtime=True)
        assert (result.stage, result.slot) == ("fault", "lower_body")
        assert "longer than its period 5 times in a row" in result.reason


def test_legs_that_are_late_are_noticed_in_the_ticks_of_a_faster_fallback(tmp_path: Path) -> None:
    use, faster = f"{write(tmp_path, 'sleeps')}:Chosen", Choice("hold", {"rate": 250.0})
    with hanging(lower_body=Choice(use), fallback=faster) as running:
        result = running.execute(Drive(), None, timeout=0.9, realtime=True)
        assert (result.stage, result.slot) == ("fault", "lower_body")
        assert "longer than its period 5 times in a row" in result.reason


def test_a_fallback_that_fails_too_leaves_the_motors_damped(tmp_path: Path) -> None:
    path = write(tmp_path, "nan")
    with hanging(lower_body=Choice(f"{path}:Chosen"), fallback=Choice(f"{path}:Doomed")) as running:
        with pytest.raises(ModuleFault) as caught:
            running.execute(Drive(), None, timeout=5.0)
        assert (caught.value.slot, caught.value.use) == ("lower_body", f"{path}:Chosen")
        assert "q contains NaN" in caught.value.reason
        assert f"the fallback {path}:Doomed failed too: RuntimeError: gone" in caught.value.reason
        assert running.safety is not None and running.safety.state is GateState.STOP1
        command = running.bus.latest(topics.LOW_CMD)
        assert command is not None
        assert not command.kp.any() and (command.kd > 0.0).all() and not command.tau.any()


def test_after_a_fault_no_skill_runs_on_the_fallback_unawares(tmp_path: Path) -> None:
    use = f"{write(tmp_path, 'raises')}:Chosen"
    with hanging(lower_body=Choice(use)) as running:
        first = running.execute(Drive(), None, timeout=5.0)
        second = running.execute(Drive(), None, timeout=5.0)
        assert (second.stage, second.reason) == ("fault", first.reason)


def test_what_failed_legs_sent_late_does_not_come_any_more(tmp_path: Path) -> None:
    use = f"{write(tmp_path, 'raises')}:Late"
    stiff = {"kp": (400.0,) * 6}
    with hanging(lower_body=Choice(use), fallback=Choice("hold", stiff)) as running:
        running.executor.run(0.4)
        while status(running).fault is None:
            running.executor.run(running.executor.t + 0.002)
        running.executor.run(running.executor.t + 0.05)
        command = running.bus.latest(topics.LEG_COMMAND)
        assert command is not None
        # A third of the way from 200 to the fallback's gains; those of its own last commands would come until 0.1 s.
        assert 240.0 < command.kp[0] < 300.0


def test_legs_on_the_ground_say_what_torque_they_want() -> None:
    zero = np.zeros(12)
    untold, told = LegCommand(zero, zero, zero), LegCommand(zero, zero, zero, zero)
    contract = ContractCheck("lower_body", "mine.py:Mine")
    standing = CheckedLowerBody(JointHold(), contract, on_ground=True)
    assert standing.check(told) is told
    with pytest.raises(ModuleFault, match="lower_body: mine.py:Mine failed: tau is None, .* on the ground"):
        standing.check(untold)
    assert CheckedLowerBody(JointHold(), contract).check(untold) is untold


def test_legs_on_the_ground_without_a_torque_go_to_the_fallback(tmp_path: Path) -> None:
    robot = {"support": "ground", "world": "open"}
    use = tmp_path / "untold.py"
    use.write_text("from golem.capabilities.legs.hold import JointHold\nclass Untold(JointHold):\n    pass\n")
    legs = {"lower_body": Choice(f"{use}:Untold"), "fallback": Choice("wbc")}
    choices = {"robot": Choice("mujoco", robot), **legs}
    running, twin = build(Stack(choices, profile="ideal"), seed=0)
    try:
        running.executor.run(0.01)
        fault = status(running).fault
        assert fault is not None and "Untold failed: tau is None" in fault
        assert status(running).controller == "wbc"
    finally:
        twin.close()


def test_options_of_the_base_layer_reach_it() -> None:
    parts = {"locomotion": {"trim": False, "timeout": 0.2}}
    running, twin = build(Stack(parts=parts, profile="ideal"), seed=0)
    twin.close()
    config = running.legs._locomotion.config
    assert config == LocomotionConfig(trim=None, timeout=0.2)


def test_a_fallback_that_does_not_exist_is_refused_when_the_stack_is_built() -> None:
    with pytest.raises(ConfigError, match="Unknown lower_body implementation 'hold_on'.*Did you mean 'hold'"):
        build(Stack({"fallback": Choice("hold_on")}), seed=0)


@pytest.mark.parametrize(
    ("twist", "applied", "clamped", "reason"),
    [
        (Twist(math.nan), Twist(), False, "not finite"),
        (Twist(0.5, math.inf), Twist(), False, "not finite"),
        (Twist(1e12, -1e12, 0.0), Twist(0.8, -0.3, 0.0), True, "outside the envelope"),
    ],
)
def test_a_bad_twist_is_clamped_or_refused_and_reported(
    twist: Twist, applied: Twist, clamped: bool, reason: str, tmp_path: Path
) -> None:
    use = f"{write(tmp_path, 'well')}:Chosen"
    with hanging(lower_body=Choice(use)) as running:
        assert running.execute(Drive(twist, 1.5), None, timeout=5.0).success
        end = status(running)
        assert (end.applied, end.clamped, end.fault) == (applied, clamped, None)
        assert end.commanded == (twist if clamped else Twist())
        assert reason in end.reason
        assert running.safety is not None and running.safety.state is GateState.ACTIVE
