"""A skill ends in a result, however it ends."""

from __future__ import annotations

import re
from collections.abc import Coroutine
from typing import Any

import pytest

from golem.errors import ConfigError, MissingSystemLibrary, ModuleFault
from golem.skills.base import SkillCancelled, SkillResult, StageFailed, Tick
from golem.skills.runner import SkillRun

DONE = SkillResult(True, "done", None, "Done.")
STEPS = 4


class Walk:
    """A skill of four ticks that writes down what happens to it."""

    def __init__(self, cleanup_ticks: int = 0) -> None:
        self.log: list[str] = []
        self.cleanup_ticks = cleanup_ticks

    async def run(self) -> SkillResult:
        try:
            for i in range(STEPS):
                self.log.append(str(i))
                await Tick()
        except SkillCancelled:
            for _ in range(self.cleanup_ticks):
                self.log.append("c")
                await Tick()
            raise
        finally:
            self.log.append("end")
        return DONE


def test_a_skill_advances_one_await_per_step() -> None:
    walk = Walk()
    run = SkillRun("walk", walk.run())
    assert walk.log == []
    for i in range(STEPS):
        run.step()
        assert (walk.log[-1], run.result) == (str(i), None)
    run.step()
    assert run.result is DONE


def test_after_its_end_nothing_happens_any_more() -> None:
    walk = Walk()
    run = SkillRun("walk", walk.run())
    for _ in range(STEPS + 3):
        run.step()
    run.cancel()
    assert run.result is DONE
    assert walk.log.count("end") == 1


@pytest.mark.parametrize("awaits", range(1, STEPS + 1))
def test_a_skill_can_be_cancelled_at_any_await(awaits: int) -> None:
    walk = Walk()
    run = SkillRun("walk", walk.run())
    for _ in range(awaits):
        run.step()
    run.cancel()
    assert run.result == SkillResult(False, "cancelled", None, "The skill was cancelled.")
    assert walk.log == [*map(str, range(awaits)), "end"]


def test_a_skill_can_be_cancelled_before_it_starts() -> None:
    walk = Walk()
    run = SkillRun("walk", walk.run())
    run.cancel()
    assert run.result is not None and run.result.stage == "cancelled"
    assert walk.log == []


def test_cleaning_up_may_take_ticks() -> None:
    walk = Walk(cleanup_ticks=2)
    run = SkillRun("walk", walk.run())
    run.step()
    run.cancel()
    assert run.result is None
    run.step()
    assert run.result is None
    run.step()
    assert run.result is not None and run.result.stage == "cancelled"
    assert walk.log == ["0", "c", "c", "end"]


async def _raises(error: BaseException) -> SkillResult:
    await Tick()
    raise error


async def _returns(value: Any) -> SkillResult:
    await Tick()
    return value


def ended(coroutine: Coroutine[None, None, SkillResult]) -> SkillResult:
    """Return the result of a skill called `mine`."""
    run = SkillRun("mine", coroutine)
    for _ in range(3):
        run.step()
    assert run.result is not None
    return run.result


def test_what_a_skill_raises_becomes_a_result_that_names_it() -> None:
    result = ended(_raises(ZeroDivisionError("by zero")))
    assert (result.success, result.stage, result.slot) == (False, "fault", "skill")
    assert re.fullmatch(r"Module skill: mine failed: ZeroDivisionError: by zero \(test_runner.py:\d+\)", result.reason)


def test_what_a_module_raises_under_a_skill_is_blamed_on_the_module() -> None:
    result = ended(_raises(ModuleFault("grasp_method", "mine.py:G", "it returned NaN")))
    assert (result.stage, result.slot) == ("fault", "grasp_method")
    assert result.reason == "Module grasp_method: mine.py:G failed: it returned NaN"


def test_a_stage_that_failed_keeps_its_stage_and_slot() -> None:
    result = ended(_raises(StageFailed("grasp", "hand", "Nothing held.")))
    assert result == SkillResult(False, "grasp", "hand", "Nothing held.")


@pytest.mark.parametrize("error", [SystemExit(1), GeneratorExit(), RecursionError("deep"), MemoryError()])
def test_whatever_a_skill_raises_is_kept_from_its_runner(error: BaseException) -> None:
    run = SkillRun("mine", _raises(error))
    run.step()
    run.step()
    assert run.result is not None and run.result.stage == "fault" and run.error is error


def test_an_interrupt_is_nobodys_result() -> None:
    with pytest.raises(KeyboardInterrupt):
        ended(_raises(KeyboardInterrupt()))


def test_what_the_machine_lacks_is_kept_for_whoever_can_mend_it() -> None:
    run = SkillRun("mine", _raises(MissingSystemLibrary("no EGL")))
    run.step()
    run.step()
    assert run.result is not None and run.result.reason == "no EGL"
    assert isinstance(run.error, MissingSystemLibrary)


def test_a_goal_that_is_refused_is_no_fault() -> None:
    result = ended(_raises(ConfigError("No such place.")))
    assert result == SkillResult(False, "refused", None, "No such place.")


def test_a_skill_that_never_lets_go_is_ended_all_the_same() -> None:
    async def clings() -> SkillResult:
        for _ in range(3):
            try:
                await Tick()
            except BaseException:
                pass
        return DONE

    run = SkillRun("clings", clings())
    run.step()
    run.fail("localizer", "It saw nothing.")
    assert run.result == SkillResult(False, "fault", "localizer", "It saw nothing.")


@pytest.mark.parametrize(
    "arguments", [(1, "done", None, ""), (True, None, None, ""), (True, "done", 3, ""), (True, "done", None, None)]
)
def test_a_result_of_other_types_is_refused_where_it_is_made(arguments: tuple[Any, ...]) -> None:
    with pytest.raises(TypeError, match="of a result is a"):
        SkillResult(*arguments)
    with pytest.raises(TypeError, match="timing 'x'"):
        SkillResult(True, "done", None, "", {"x": float("nan")})


@pytest.mark.parametrize("value", [None, True, (True, "done")])
def test_a_skill_that_returns_something_else_is_at_fault(value: object) -> None:
    result = ended(_returns(value))
    assert (result.success, result.slot) == (False, "skill")
    assert f"it returned {type(value).__name__}, not SkillResult" in result.reason


def test_a_skill_that_is_no_coroutine_is_at_fault() -> None:
    result = ended(DONE)  # pyright: ignore[reportArgumentType]
    assert (result.success, result.slot) == (False, "skill")
    assert "'async def'" in result.reason


def test_a_skill_may_turn_its_cancellation_into_a_result_of_its_own() -> None:
    async def stubborn() -> SkillResult:
        try:
            await Tick()
        except SkillCancelled:
            return DONE
        raise AssertionError

    run = SkillRun("stubborn", stubborn())
    run.step()
    run.cancel()
    assert run.result is DONE
