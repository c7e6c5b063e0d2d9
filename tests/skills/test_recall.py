"""Looking so that something is remembered, and asking where it is."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from golem.capabilities.memory.object_map import ObjectMap
from golem.errors import ConfigError
from golem.evaluation.conformance.memory_suite import look
from golem.interfaces import topics
from golem.interfaces.memory_payloads import MemoryStatus
from golem.middleware.bus import Bus
from golem.robots.model.pinocchio_model import Kinematics
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.skills.recall import Recall, RecallGoal
from golem.skills.remember import Remember, RememberGoal
from golem.skills.runner import SkillRun

from .conftest import PERIOD, modules


def pursue(context: Context, skill: Any, goal: Any, each: Any = lambda context: None) -> SkillResult:
    run = SkillRun("test", skill.run(context, goal))
    while run.result is None:
        context.refresh(context.t + PERIOD)
        each(context)
        run.step()
    return run.result


@pytest.fixture
def memory() -> ObjectMap:
    return ObjectMap()


@pytest.fixture
def context(memory: ObjectMap) -> Context:
    c = Context(Bus(), Kinematics(), PERIOD, modules(memory=memory))
    c.bus.publish(topics.MEMORY_STATUS, MemoryStatus(0.0, "map", 100.0, 0), 0.0)
    return c


def test_the_place_comes_with_its_frame_and_age(context: Context, memory: ObjectMap) -> None:
    memory.observe(look(98.0))
    result = pursue(context, Recall(), RecallGoal("the cup"))
    assert result.success and result.value.frame == "map"
    (place,) = result.value.places
    assert (place.label, place.evidence) == ("mug", "seen")
    assert place.last_seen == pytest.approx(2.0, abs=0.1)
    assert (place.x, place.y, place.z) == pytest.approx((0.4, 0.0, -0.2), abs=0.002)
    assert re.fullmatch(r"The mug is at \(0.40, -?0.00, -0.20\) in map, seen 2 s ago.", result.reason)


def test_a_time_is_asked_for_by_how_long_ago_it_is(context: Context, memory: ObjectMap) -> None:
    memory.observe(look(50.0))
    assert pursue(context, Recall(), RecallGoal("mug", "at", ago=10.0)).value.places
    assert not pursue(context, Recall(), RecallGoal("mug", "at", ago=70.0)).value.places


def test_that_nothing_is_remembered_is_an_answer(context: Context) -> None:
    result = pursue(context, Recall(), RecallGoal("submarine"))
    assert result.success and result.reason == "Nothing is remembered of 'submarine'."


def test_a_memory_that_does_not_report_is_named() -> None:
    context = Context(Bus(), Kinematics(), PERIOD, modules())
    result = pursue(context, Recall(), RecallGoal("mug"))
    assert not result.success and result.slot == "memory"


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        (lambda: RecallGoal(" "), "empty"),
        (lambda: RecallGoal("x" * 501), "501 characters"),
        (lambda: RecallGoal("mug", "soon"), "Unknown time .soon."),  # type: ignore[arg-type]
        (lambda: RecallGoal("mug", "at", ago=float("nan")), "finite"),
        (lambda: RecallGoal("mug", limit=0), "at least one"),
        (lambda: RememberGoal(()), "at least one kind"),
        (lambda: RememberGoal(("mug", " ")), "at least one kind"),
        (lambda: RememberGoal(("mug",), 0.0), "at most an hour"),
    ],
)
def test_a_goal_without_sense_is_refused(goal: Any, why: str) -> None:
    with pytest.raises(ConfigError, match=why):
        goal()


def test_it_looks_and_tells_what_it_remembers(context: Context, memory: ObjectMap) -> None:
    def sees(c: Context) -> None:
        request = c.bus.latest(topics.detection_request("head"))
        status = c.bus.latest(topics.MEMORY_STATUS)
        assert status is not None
        if request is not None and request.labels and memory.last < 100.0:
            assert request.labels == ("mug", "bowl")
            memory.observe(look(100.0 + c.t))
            c.publish(topics.MEMORY_STATUS, MemoryStatus(c.t, "map", 100.0, status.looks + 1))

    result = pursue(context, Remember(), RememberGoal(("mug", "bowl"), 1.0), sees)
    assert result.success and [place.label for place in result.value.places] == ["mug"]
    assert result.reason.startswith("1 looks; The mug is at (0.40, ")
    request = context.bus.latest(topics.detection_request("head"))
    assert request is not None and not request.labels  # nothing is rendered unasked afterwards


def test_looks_that_the_memory_refuses_fail_it(context: Context) -> None:
    def full(c: Context) -> None:
        c.publish(topics.MEMORY_STATUS, MemoryStatus(c.t, "map", 100.0, 0, "the disk is full"))

    result = pursue(context, Remember(), RememberGoal(("mug",), 0.5), full)
    assert not result.success and result.slot == "memory" and "the disk is full" in result.reason
    assert np.isfinite(context.t)
