"""`golem skill`: gives the robot on a domain a goal, prints what it says, and cancels on Ctrl-C."""

from __future__ import annotations

import json
import threading
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field, fields
from typing import Any

import tyro
from tyro.conf import OmitArgPrefixes

from golem.errors import ConfigError, GolemError, unknown_name
from golem.interfaces import public
from golem.interfaces import ros_convert as convert
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.interrupt import interrupted
from golem.middleware.ros.action_client import ClientGoal
from golem.middleware.ros.future import Future, RosError
from golem.middleware.ros.goals import GoalStatus
from golem.middleware.ros.msgs.golem_interfaces import RunSkill_Goal
from golem.middleware.ros.msgs.std_srvs import Trigger_Request
from golem.middleware.ros.node import RosNode
from golem.runtime.goal_parser import HELP, parse_goal
from golem.runtime.live.node_setup import ANSWER, SEARCH, find, log_line, member, until
from golem.runtime.live.operator import ask
from golem.runtime.live.skill_messages import RUN, read_list
from golem.runtime.skill_table import SkillTable
from golem.skills.base import REFUSED
from golem.skills.spec import SkillSpec
from golem.stack import Choice, Stack, load_stack

DONE, FAILED, BAD_INPUT, CANCELED = 0, 1, 2, 130
"""Exit codes."""
Specs = Mapping[str, SkillSpec]
"""What is known of skills, by name."""


@dataclass(frozen=True)
class SkillClientConfig:
    """Where the robot is, and who says what its goals consist of."""

    stack: str | None = None
    """Stack file to take the skills from; by default the stack on the domain is asked for them."""
    take_over: bool = False
    """Take the lease for skills from another client that has it, and is still there."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


OPTIONS = [f.name for kind in (SkillClientConfig, DdsConfig) for f in fields(kind) if f.name != "dds"]
"""What no field of a goal can be called here."""


def read_words(words: list[str]) -> tuple[SkillClientConfig, list[str]]:
    """Return the options among `words`, and the rest of them: a skill and its goal."""
    return tyro.cli(SkillClientConfig, prog="golem skill", args=words, return_unknown_args=True)


def run_skill(words: list[str]) -> int:
    """Do what the words after `golem skill` say, and return the exit code.

    Raises:
        ConfigError: there is no such skill.
        RosError: no stack is there, or it went away.
    """
    asked = [word for word in words if word in HELP]
    config, rest = read_words([word for word in words if word not in HELP])
    if asked:
        return _help(config, rest)
    if not rest:
        raise ConfigError("Say which skill; golem skill --help lists them.")
    with interrupted() as stop, member("skill", config.dds) as (_, node):
        remedy = f"on {config.dds}, start a stack with: {config.dds.command('up STACK')}"
        goal = compose(node, config, rest, remedy)
        if config.take_over:
            log_line(ask(node, "/skill/take_over", public.TRIGGER, Trigger_Request(), remedy).message)
        return pursue(node, goal, remedy, stop)


def _help(config: SkillClientConfig, words: list[str]) -> int:
    """Tell the fields of the goal of a skill, or which skills there are."""
    specs = local_skills(config, words)
    if specs is None:
        try:
            with member("skill", config.dds) as (_, node):
                specs = ask_skills(node, "")
        except GolemError as error:
            log_line(f"{error} These are the skills that come with GOLEM.\n")
            specs = SkillTable(Stack()).specs
    if words:
        parse_goal(choose(specs, words[0]), ["--help"], f"golem skill {words[0]}", OPTIONS)
    log_line("usage: golem skill NAME [goal] [options]     (golem skill NAME --help tells the goal)\n")
    for spec in specs.values():
        log_line(f"  {spec.name:10s} {spec.summary}")
    log_line(f"\noptions, besides the goal's: {', '.join('--' + name for name in OPTIONS)}")
    return DONE


def local_skills(config: SkillClientConfig, words: list[str]) -> Specs | None:
    """Return the skills that are defined here: by a stack file, or by the class that `words` begin with; else None.

    Raises ConfigError, ModuleFault: it cannot be loaded.
    """
    if config.stack is not None:
        return SkillTable(load_stack(config.stack)).specs
    if words and ":" in words[0]:
        return SkillTable(Stack(skills={words[0].rpartition(":")[2].lower(): Choice(words[0])})).specs
    return None


def ask_skills(node: RosNode, remedy: str) -> Specs:
    """Return the skills of the stack on the domain. Raises RosError: none is there; GolemError: they cannot be read."""
    row = public.topic("/skill/list")
    listed = node.subscription(row.name, row.type, None, row.qos)
    with closing(listed):
        until(node, lambda: listed.latest() is not None, SEARCH)
        message = listed.latest()
        if message is None:
            raise RosError("; ".join(filter(None, ("No stack tells its skills", remedy))) + ".")
        return read_list(message)


def choose(specs: Specs, name: str) -> SkillSpec:
    """Return the skill called `name`, or implemented by it: `my_skill.py:Mine`. Raises ConfigError: there is none."""
    by_use = [spec for spec in specs.values() if ":" in name and _file(spec.use) == _file(name)]
    if name not in specs and len(by_use) != 1:
        raise unknown_name("skill", name, specs)
    return specs[name] if name in specs else by_use[0]


def _file(use: str) -> str:
    """Return an implementation without the folder of its file, which may be another where the stack runs."""
    return use.rpartition("/")[2]


def compose(node: RosNode, config: SkillClientConfig, words: list[str], remedy: str) -> RunSkill_Goal:
    """Return the goal that `words` say: a skill's name and its goal's fields.

    Raises:
        ConfigError: there is no such skill.
        RosError: no stack is there; `remedy` says what to do.
    """
    name, *rest = words
    offered = ask_skills(node, remedy)
    known = local_skills(config, words) or offered
    goal = parse_goal(choose(known, name), rest, f"golem skill {name}", OPTIONS)
    return RunSkill_Goal(choose(offered, name).name, json.dumps(goal))


def pursue(node: RosNode, goal: RunSkill_Goal, remedy: str, stop: threading.Event) -> int:
    """Give the stack on the domain a goal, print what it says until it ends, and return the exit code.

    Ctrl-C sets `stop`: first to cancel, then to leave. Raises RosError: no stack is there, which `remedy` helps, or it
    went away.
    """
    pursued = propose(node, goal, remedy)
    result, asked = pursued.result(), None
    while not result.done:
        node.spin_once(0.1)
        if not stop.is_set():
            continue
        stop.clear()
        if asked is not None:
            log_line("Leaving without an answer; the robot may still be at it.")
            return CANCELED
        log_line("Canceling; Ctrl-C again leaves at once.")
        asked = pursued.cancel()
    outcome = result.result()
    ended = outcome.result.result
    refused = ended.stage == REFUSED
    log_line(f"{'refused' if refused else GoalStatus(outcome.status).name.lower()}: {ended.reason}")
    for timing in ended.timings:
        log_line(f"  {timing.name} {timing.seconds:.1f} s")
    if outcome.result.value:
        log_line(f"  {outcome.result.value}")
    if outcome.status is GoalStatus.SUCCEEDED:
        return DONE
    if refused:
        return BAD_INPUT
    return CANCELED if outcome.status is GoalStatus.CANCELED else FAILED


def propose(node: RosNode, goal: RunSkill_Goal, remedy: str) -> ClientGoal:
    """Give a goal whose feedback is printed, and return it once it was accepted.

    Raises RosError: nobody offers the action, it does not answer, or it rejects the goal; `remedy` says what to do.
    """
    client = node.action_client(RUN, next(row.type for row in public.ACTIONS if row.name == RUN))
    find(node, RUN, client, remedy)
    said: list[str] = []

    def feedback(message: Any) -> None:
        f = message.feedback
        if f.text not in said[-1:]:
            said.append(f.text)
            log_line(f"{convert.seconds(f.stamp):7.2f} s  {f.stage:9s} {f.text}")

    sent: Future[ClientGoal] = client.send_goal(goal, feedback)
    pursued = node.wait(sent, ANSWER)
    if not pursued.accepted:
        raise RosError(f"'{RUN}' rejected the goal.")
    return pursued
