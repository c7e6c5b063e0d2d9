"""Goals, feedback and results of skills as ROS messages, and the list of skills."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any, cast

import numpy as np

from golem.errors import GolemError
from golem.interfaces import public
from golem.interfaces import ros_convert as convert
from golem.interfaces.payloads import Feedback
from golem.middleware.ros import codec
from golem.middleware.ros.msgs import golem_interfaces
from golem.skills.base import SkillResult
from golem.skills.spec import SkillSpec, plain

RUN = "/skill/run"
"""The action that pursues goals of every skill."""
MAX_GOAL = 1 << 16
"""Characters of a goal in JSON [own]: reading megabytes would hold up what balances the robot."""
Fields = dict[str, object]
"""A goal by the names of its fields."""


@dataclass(frozen=True)
class SkillAction:
    """How goals, feedback and results travel by one action.

    Attributes:
        goal: returns the name of the skill and the goal's fields; raises `GolemError` for what is neither.
        feedback, result: return the action's own messages.
    """

    goal: Callable[[Any], tuple[str, Fields]]
    feedback: Callable[[Feedback], Any]
    result: Callable[[SkillResult], Any]


def _run_goal(message: golem_interfaces.RunSkill_Goal) -> tuple[str, Fields]:
    text = message.goal
    if len(text) > MAX_GOAL:
        raise GolemError(f"The goal has {len(text)} characters; at most {MAX_GOAL} are read.")
    try:
        fields: object = json.loads(text) if text else {}
    except (ValueError, RecursionError) as error:
        raise GolemError(f"The goal is no JSON: {error}.") from error
    if not isinstance(fields, dict):
        raise GolemError('The goal is a JSON object of its fields, e.g. {"label": "screw"}.')
    return message.skill, cast(Fields, fields)


def _walk_goal(message: golem_interfaces.Walk_Goal, skill: str = "walk") -> tuple[str, Fields]:
    T, timeout = convert.matrix(message.pose.pose), convert.seconds(message.timeout)
    yaw = math.atan2(T[1, 0], T[0, 0])
    goal: Fields = {"x": float(T[0, 3]), "y": float(T[1, 3]), "yaw": yaw, "frame": message.pose.header.frame_id}
    return skill, goal if timeout == 0.0 else goal | {"timeout": timeout}


GOALS: dict[str, Callable[[Any], tuple[str, Fields]]] = {
    RUN: _run_goal,
    "/skill/pick": lambda message: (
        "pick",
        {"label": message.label, "container": message.container, "side": message.side, "avoid": message.avoid.tolist()},
    ),
    "/skill/walk": _walk_goal,
    "/skill/navigate": partial(_walk_goal, skill="navigate"),
    "/skill/stand": lambda message: ("stand", {"seconds": convert.seconds(message.duration)}),
}
"""What reads the goals of each action; only a skill with an action of its own needs a line here."""


def skill_actions() -> dict[str, SkillAction]:
    """Return every action that pursues goals of skills, by its name."""
    types = {row.name: codec.action(row.type) for row in public.ACTIONS}

    def action(name: str) -> SkillAction:
        kind = types[name]

        def result(ended: SkillResult) -> Any:
            rest = ("" if ended.value is None else json.dumps(plain(ended.value)),) if name == RUN else ()
            return kind.Result(result_message(ended), *rest)

        return SkillAction(GOALS[name], lambda said: kind.Feedback(feedback_message(said)), result)

    return {name: action(name) for name in GOALS}


def result_message(result: SkillResult) -> golem_interfaces.SkillResult:
    """Return how a skill ended."""
    timings = [golem_interfaces.Timing(_text(name), float(s)) for name, s in result.timings.items()]
    stage, slot, reason = map(_text, (result.stage, result.slot or "", result.reason))
    return golem_interfaces.SkillResult(result.success, stage, slot, reason, timings)


def feedback_message(feedback: Feedback) -> golem_interfaces.SkillFeedback:
    """Return what a running skill says; of its data what is numbers."""
    data: list[golem_interfaces.NamedValues] = []
    for name, value in feedback.data.items():
        try:
            numbers = np.atleast_1d(np.asarray(value, np.float64)).ravel()
        except (TypeError, ValueError):
            continue
        data.append(golem_interfaces.NamedValues(_text(name), numbers))
    skill, stage, text = map(_text, (feedback.skill, feedback.stage, feedback.text))
    return golem_interfaces.SkillFeedback(convert.time(feedback.t), skill, stage, text, data)


def _text(text: str) -> str:
    """Return `text` as UTF-8 can have it: a name from somewhere may hold half a character."""
    return text.encode("utf-8", "replace").decode()


def list_message(specs: Iterable[SkillSpec]) -> golem_interfaces.SkillList:
    """Return the skills that a stack offers."""
    said = ((s.name, s.use, s.summary, json.dumps(s.goal), json.dumps(s.result)) for s in specs)
    return golem_interfaces.SkillList([golem_interfaces.SkillDescription(*words) for words in said])


def read_list(message: golem_interfaces.SkillList) -> dict[str, SkillSpec]:
    """Return the skills that a stack offers, by name. Raises GolemError: a goal is described by what is no JSON."""
    try:
        specs = [SkillSpec(s.name, s.use, s.summary, json.loads(s.goal), json.loads(s.result)) for s in message.skills]
    except ValueError as error:
        raise GolemError(f"The list of skills cannot be read: {error}.") from error
    return {spec.name: spec for spec in specs}
