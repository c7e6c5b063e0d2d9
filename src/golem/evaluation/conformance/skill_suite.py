"""What a skill promises: see `golem.skills.base`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from golem.errors import ConfigError
from golem.evaluation.conformance.base import Candidate, Inapplicable, check, gate
from golem.evaluation.conformance.impurities import unnoticed
from golem.evaluation.conformance.still_robot import StillRobot
from golem.evaluation.conformance.suite import Suite
from golem.interfaces import topics
from golem.interfaces.payloads import Feedback
from golem.middleware.bus import News
from golem.runtime.contract_check import ContractCheck
from golem.runtime.lockstep import LockstepRunner
from golem.skills.base import FAULT, Routine, Skill, SkillResult
from golem.skills.pursuit import CLEANUP
from golem.skills.spec import read_goal, schema_of
from golem.stack import Choice, Stack
from golem.types import TICK

UNTIL_CANCELLED = 1.0
"""Time after which a skill that still runs is cancelled [s]."""
STACK = Stack({"lower_body": Choice("almi"), "grasp_method": Choice("centroid")})


class SkillAnswer(NamedTuple):
    """What became of one goal: the result, the feedback, and the time from the cancellation to the end [s]."""

    result: SkillResult | None
    feedback: list[Feedback]
    cleanup: float | None

    @property
    def endless(self) -> bool:
        """Whether it went on after it was cancelled until it was given up."""
        return self.cleanup is not None and self.cleanup > CLEANUP - 0.1


class SkillSuite(Suite):
    """The one input is a goal; a skill pursues it on a robot without physics, and is cancelled after a while."""

    slot, contracts, forgets = "skill", (Routine, Skill), False

    def inputs(self) -> Sequence[None]:
        """Return one goal: the default one, or one of simple values."""
        return [None]

    def stale(self) -> Sequence[None]:
        """Return the goal twice."""
        return [None, None]

    def call(self, module: Skill[Any, Any], given: None) -> SkillAnswer:
        """Pursue the goal in a stack of its own."""
        with unnoticed():
            running = LockstepRunner(STACK, StillRobot())
        feedback, seen = News(running.bus, topics.FEEDBACK), list[Feedback]()

        def look() -> bool:
            news = feedback.read()
            if news is not None:
                seen.append(news)
            return run.result is not None

        running.executor.run(2 * TICK)
        run = running.start(module, goal_for(module), math.inf)
        running.executor.run(running.executor.t + UNTIL_CANCELLED, look)
        cancelled = None if run.result is not None else running.executor.t
        if cancelled is not None:
            running.cancel()
            running.executor.run(running.executor.t + CLEANUP, look)
        return SkillAnswer(run.result, seen, None if cancelled is None else running.executor.t - cancelled)

    def judge(self, contract: ContractCheck, answer: SkillAnswer) -> None:
        if answer.result is None or answer.endless:
            return
        contract.kind("the result", answer.result, SkillResult)
        if answer.result.stage == FAULT and answer.result.slot == "skill":
            reason = answer.result.reason.partition(" failed: ")[2] or answer.result.reason
            fault = contract.fault(reason)
            fault.trace = answer.result.trace
            raise fault
        if answer.result.success and answer.result.slot is not None:
            raise contract.fault(f"it succeeds, and holds {answer.result.slot} responsible for a failure")

    @gate
    def declares_sound_numbers(self, candidate: Candidate) -> None:
        """Its goal is a dataclass of plain values, and the time it may take is positive."""
        module, contract = candidate.make(), candidate.contract
        try:
            schema_of(module.Goal)
        except TypeError as error:
            raise candidate.fault(f"its 'Goal' is unsuitable: {error}") from error
        allowed = contract.number("timeout", contract.call(module.timeout, goal_for(module)))
        if allowed <= 0.0:
            raise candidate.fault(f"its timeout is {allowed:g} s, not a positive time")

    @check
    def can_be_cancelled(self, candidate: Candidate) -> None:
        """Cancelled, it ends in time, and its result does not claim a success that it did not have."""
        answer: SkillAnswer = self.answers_of(candidate)[0]
        if answer.cleanup is None:
            raise Inapplicable(f"it ends within {UNTIL_CANCELLED:g} s")
        if answer.result is None or answer.endless:
            raise candidate.fault(f"it still runs {CLEANUP:g} s after it was cancelled")

    @check
    def gives_reasons(self, candidate: Candidate) -> None:
        """A result says in a sentence how it ended."""
        answer: SkillAnswer = self.answers_of(candidate)[0]
        if answer.result is not None and not answer.result.reason.strip():
            raise candidate.fault("its result gives no reason")


def goal_for(module: Any) -> Any:
    """Return a goal: defaults where there are any, else simple values. Raises Inapplicable: the skill refuses it."""
    schema = schema_of(module.Goal)
    fields = {name: _simple(schema["properties"][name]) for name in schema["required"]}
    try:
        return read_goal("the candidate", module.Goal, fields)
    except ConfigError as refusal:
        raise Inapplicable(f"it refuses the goal {fields}: {refusal}") from refusal


def _simple(schema: Mapping[str, Any]) -> object:
    if "enum" in schema:
        return schema["enum"][0]
    if "anyOf" in schema:
        return None
    if schema.get("type") == "object":
        return {name: _simple(schema["properties"][name]) for name in schema["required"]}
    items = [_simple(each) for each in schema.get("prefixItems", ())]
    simple = {"number": 0.5, "integer": 1, "boolean": False, "string": "screw", "array": items}
    return simple[schema["type"]]
