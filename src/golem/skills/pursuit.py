"""Pursues a goal with one skill, for another or on its own: timeouts and cancellation reach the inner one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from golem.errors import ModuleFault
from golem.skills.base import FAULT, TIMEOUT, Routine, Skill, SkillCancelled, SkillResult
from golem.skills.runner import LACKS, SLOT, SkillRun
from golem.skills.spec import as_goal

if TYPE_CHECKING:
    from golem.skills.context import Context

CLEANUP = 10.0
"""Time a cancelled skill gets to leave the robot in a state that is safe to stay in [s] [own]."""


async def call(context: Context, name: str, goal: object, timeout: float | None) -> SkillResult:
    """Pursue `goal` with the skill of the stack called `name`, for the skill that runs; see `Context.run`."""
    skill = context.modules.skill(name)
    goal = as_goal(name, skill.Goal, goal)
    run, cancelled, result = await _pursue(context, name, skill, goal, timeout)
    if isinstance(run.error, LACKS):
        raise run.error
    if cancelled:
        raise SkillCancelled
    return result


async def pursue(
    context: Context, name: str, routine: Routine[Context, Any], goal: object, timeout: float | None
) -> SkillResult:
    """Pursue `goal` with `routine`, called `name`, which no other skill calls, and return how that ended.

    A `timeout` of None is what a skill itself allows [s]. What the routine raises that no skill should goes further.
    """
    run, _, result = await _pursue(context, name, routine, goal, timeout)
    if run.error is not None:
        raise run.error
    return result


async def _pursue(
    context: Context, name: str, routine: Routine[Context, Any], goal: object, timeout: float | None
) -> tuple[SkillRun, bool, SkillResult]:
    """Return the run, whether it was cancelled from above, and how it ended."""
    allowed = cast("Skill[Context, Any]", routine).timeout(goal) if timeout is None else timeout
    if not allowed > 0.0:
        raise ModuleFault(SLOT, name, f"its timeout is {allowed}, not a positive time")
    caller, context.skill = context.skill, name
    run, end = SkillRun(name, routine.run(context, goal)), context.t + allowed
    late = cancelled = False
    try:
        run.step()
        while run.result is None:
            try:
                await context.tick()
            except SkillCancelled:
                end, cancelled = end if run.cancelled else context.t + CLEANUP, True
                run.cancel()
                continue
            if context.t < end:
                run.step()
            elif run.cancelled:
                run.fail(SLOT, f"The skill '{name}' did not end within {CLEANUP:g} s of its cancellation.")
            else:
                end, late = context.t + CLEANUP, True
                run.cancel()
        result = run.result
        if run.failure is not None:
            context.say(result.stage, result.reason, failed=True)
    finally:
        run.close()
        context.skill = caller
    if late and result.stage != FAULT:
        result = SkillResult(False, TIMEOUT, None, f"Not done after {allowed:g} s of robot time.", result.timings)
    return run, cancelled, result
