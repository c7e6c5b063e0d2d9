"""One skill runs another: results, feedback, cancellation and time limits go where they belong."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest
from tests.skills.conftest import modules

from golem.errors import MissingExtra, unknown_name
from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.robots.model.pinocchio_model import Kinematics
from golem.skills.base import Skill, SkillCancelled, SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.pursuit import CLEANUP, pursue
from golem.skills.runner import SkillRun

PERIOD = 0.01


@dataclass(frozen=True)
class Count:
    """How far to count."""

    to: int = 3


@dataclass(frozen=True)
class Found:
    """What counting leads to."""

    number: int


class Counter:
    """Count the ticks."""

    Goal = Count

    def __init__(self) -> None:
        self.log: list[str] = []
        self.cleanup = 0

    def timeout(self, goal: Count) -> float:
        """Allow a second."""
        return 1.0

    async def run(self, context: Context, goal: Count) -> SkillResult:
        """Count."""
        try:
            for i in range(goal.to):
                context.say("count", str(i))
                await context.tick()
        except SkillCancelled:
            for _ in range(self.cleanup):
                self.log.append("cleanup")
                await context.tick()
            raise
        finally:
            self.log.append("end")
        return SkillResult(True, "done", None, "Counted.", {"count": goal.to * PERIOD}, Found(goal.to))


class Caller:
    """Lets another skill count, and says how that went."""

    Goal = Count

    def __init__(self, call: Callable[[Context], Any]) -> None:
        self.call = call
        self.cancelled = False

    def timeout(self, goal: Count) -> float:
        """Allow half a minute."""
        return 30.0

    async def run(self, context: Context, goal: Count) -> SkillResult:
        """Call it."""
        context.say("call", "Calling.")
        try:
            inner = await self.call(context)
        except SkillCancelled:
            self.cancelled = True
            raise
        context.say("called", inner.stage)
        return SkillResult(inner.success, inner.stage, inner.slot, inner.reason, value=inner.value)


class Bench:
    """A context whose stack has the skill `counter`, and a clock."""

    def __init__(self, counter: Any = None) -> None:
        self.counter = counter or Counter()
        table = {"counter": self.counter}
        self.bus = Bus()

        def skill(name: str) -> Skill[Context, Any]:
            if name not in table:
                raise unknown_name("skill", name, table)
            return table[name]

        self.context = Context(self.bus, Kinematics(), PERIOD, modules(skill=skill))
        self.said: list[tuple[str, str, str]] = []
        self.ticks = 0

    def begin(self, call: Callable[[Context], Any]) -> tuple[Caller, SkillRun]:
        caller = Caller(call)
        return caller, SkillRun("caller", pursue(self.context, "caller", caller, Count(), None))

    def run(self, run: SkillRun, ticks: int = 5000) -> SkillResult | None:
        for _ in range(ticks):
            if run.result is not None:
                break
            self.ticks += 1
            self.context.refresh(self.ticks * PERIOD)
            run.step()
            said = self.bus.latest(topics.FEEDBACK)
            if said is not None and self.said[-1:] != [(said.skill, said.stage, said.text)]:
                self.said.append((said.skill, said.stage, said.text))
        return run.result


def test_a_skill_gets_the_result_and_the_value_of_the_one_it_calls() -> None:
    bench = Bench()
    _, run = bench.begin(lambda context: context.run("counter", Count(2)))
    result = bench.run(run)
    assert result is not None and result.success and result.value == Found(2)
    assert bench.said == [("counter", "count", "0"), ("counter", "count", "1"), ("caller", "called", "done")]


def test_what_a_caller_minds_ends_the_skill_that_it_called() -> None:
    bench, looks = Bench(), list[float]()

    def check() -> None:
        looks.append(bench.context.t)
        if bench.context.t > 3.5 * PERIOD:
            raise StageFailed("carry", "grasp_method", "It fell.")

    async def call(context: Context) -> SkillResult:
        with context.minding(check):
            return await context.run("counter", Count(50))

    _, run = bench.begin(call)
    result = bench.run(run)
    assert result is not None and (result.stage, result.slot, result.reason) == ("carry", "grasp_method", "It fell.")
    assert bench.counter.log == ["end"] and set(looks) == {PERIOD * k for k in (2, 3, 4)}


def test_a_goal_may_be_given_by_its_fields() -> None:
    bench = Bench()
    _, run = bench.begin(lambda context: context.run("counter", {"to": 2}))
    result = bench.run(run)
    assert result is not None and result.value == Found(2)


def test_a_cancellation_reaches_the_inner_skill_first_which_may_clean_up() -> None:
    bench = Bench()
    bench.counter.cleanup = 3
    caller, run = bench.begin(lambda context: context.run("counter", Count(1000), timeout=60.0))
    bench.run(run, 5)
    run.cancel()
    assert run.result is None and not caller.cancelled and bench.counter.log == ["cleanup"]
    result = bench.run(run)
    assert result is not None and result.stage == "cancelled" and caller.cancelled
    assert bench.counter.log == ["cleanup"] * 3 + ["end"]


def test_a_caller_is_cancelled_also_when_the_inner_skill_ends_as_if_nothing_were() -> None:
    class Stubborn(Counter):
        async def run(self, context: Context, goal: Count) -> SkillResult:
            try:
                await context.sleep(10.0)
            except SkillCancelled:
                pass
            return SkillResult(True, "done", None, "Done all the same.")

    bench = Bench(Stubborn())
    caller, run = bench.begin(lambda context: context.run("counter", Count(), timeout=60.0))
    bench.run(run, 5)
    run.cancel()
    assert caller.cancelled and run.result is not None and run.result.stage == "cancelled"


def test_an_inner_skill_that_takes_too_long_is_cancelled_and_its_caller_goes_on() -> None:
    bench = Bench()
    caller, run = bench.begin(lambda context: context.run("counter", Count(1000)))
    result = bench.run(run)
    assert result is not None and (result.stage, result.reason) == ("timeout", "Not done after 1 s of robot time.")
    assert bench.context.t == pytest.approx(1.0, abs=0.03) and not caller.cancelled
    assert bench.counter.log == ["end"] and bench.context.skill == ""


def test_the_caller_may_allow_more_or_less_time() -> None:
    bench = Bench()
    _, run = bench.begin(lambda context: context.run("counter", Count(1000), timeout=0.1))
    result = bench.run(run)
    assert result is not None and result.stage == "timeout"
    assert bench.context.t == pytest.approx(0.1, abs=0.03)


def test_a_skill_that_does_not_let_go_is_ended_when_its_time_to_clean_up_is_over() -> None:
    class Clings(Counter):
        async def run(self, context: Context, goal: Count) -> SkillResult:
            while True:
                try:
                    await context.tick()
                except SkillCancelled:
                    self.log.append("no")

    bench = Bench(Clings())
    _, run = bench.begin(lambda context: context.run("counter", Count()))
    result = bench.run(run)
    assert result is not None and result.stage == "fault" and "'counter' did not end" in result.reason
    assert bench.context.t == pytest.approx(1.0 + CLEANUP, abs=0.03)


def test_what_an_inner_skill_raises_is_its_result_and_names_it() -> None:
    class Breaks(Counter):
        async def run(self, context: Context, goal: Count) -> SkillResult:
            await context.tick()
            raise ZeroDivisionError("by zero")

    bench = Bench(Breaks())
    _, run = bench.begin(lambda context: context.run("counter", Count()))
    result = bench.run(run)
    assert result is not None and result.stage == "fault"
    assert "Module skill: counter failed: ZeroDivisionError: by zero (test_pursuit.py" in result.reason
    assert bench.said[-1] == ("caller", "called", "fault") and run.error is None


def test_what_the_machine_lacks_goes_through_every_caller() -> None:
    class Lacks(Counter):
        async def run(self, context: Context, goal: Count) -> SkillResult:
            raise MissingExtra("torch", "train")

    bench = Bench(Lacks())
    _, run = bench.begin(lambda context: context.run("counter", Count()))
    bench.run(run)
    assert isinstance(run.error, MissingExtra)


@pytest.mark.parametrize(
    ("name", "goal", "words"),
    [
        ("countr", Count(), "Unknown skill 'countr'; valid: counter. Did you mean 'counter'?"),
        ("counter", Found(1), "The skill 'counter' takes a Count, not a Found."),
        ("counter", Count(2**70), "is a finite number"),
        ("counter", {"too": 1}, "Unknown goal field of counter 'too'; valid: to. Did you mean 'to'?"),
    ],
)
def test_a_call_without_sense_is_refused(name: str, goal: Any, words: str) -> None:
    bench = Bench()
    _, run = bench.begin(lambda context: context.run(name, goal))
    result = bench.run(run)
    assert result is not None and result.stage == "refused" and words in result.reason


@pytest.mark.parametrize("allowed", [0.0, -1.0, math.nan])
def test_a_skill_that_allows_itself_no_time_is_at_fault(allowed: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Counter, "timeout", lambda *_: allowed)
    bench = Bench()
    run = SkillRun("counter", pursue(bench.context, "counter", bench.counter, Count(), None))
    result = bench.run(run)
    assert result is not None and result.stage == "fault" and "its timeout is" in result.reason
