"""`golem run`: one stack file, one episode."""

from __future__ import annotations

import os
import re
import sys
import webbrowser
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Annotated, get_type_hints

import tyro
from tyro.conf import Positional, arg

from golem import registry
from golem.dashboard.live import LiveView
from golem.errors import ConfigError
from golem.evaluation.base import TrialOutcome
from golem.evaluation.harness.ladder import LadderConfig, find_trial, prepare
from golem.evaluation.harness.records import trial_name
from golem.evaluation.harness.trials import run_trial
from golem.interfaces import topics
from golem.middleware.bus import News
from golem.robots.base import Robot
from golem.robots.mujoco.config import World
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.goal_parser import parse_goal
from golem.runtime.lockstep import LockstepRunner, build
from golem.runtime.skill_table import SkillTable
from golem.skills.base import SkillResult
from golem.stack import Stack, load_stack

FOXGLOVE_PORT = 8765
"""Where Foxglove looks first."""


def no_display() -> bool:
    """Return whether this machine has no screen to open a browser on."""
    return sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


@dataclass(frozen=True)
class RunConfig:
    """Run a stack file: the robot pursues one goal of a skill, or stands and does what you ask for in the live view.

    The goal follows the options: golem run stand --skill walk --x 1. Its fields: golem run --skill walk --help.
    """

    stack: Annotated[str, Positional, arg(metavar="[STACK]")] = "tether"
    """Path of a stack file, or the name of a shipped one."""
    skill: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="")] = None
    """Skill of the stack to run once. Default: pick where the robot hangs; where it stands you operate it."""
    operate: bool = False
    """Drive, push and start skills in the live view until Ctrl-C; the default where the robot stands on its feet."""
    world: Annotated[World | None, arg(metavar="NAME", help_behavior_hint="")] = None
    """World of the twin: pack, plant, ioniq5, ioniq5_plant, kitchen, counter, robocasa, open, slope, step, rubble,
    furnished or corridor; default: the stack file's."""
    profile: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="")] = None
    """Realism profile: ideal, bench or field; default: the stack file's."""
    seed: int = 0
    """Seed of the episode."""
    view: bool = False
    """Show a skill live in the browser, paced by the wall clock; operating always does."""
    port: int = 8080
    """Port of the live view; whoever gives one, or an address, is shown a skill there."""
    host: str = "127.0.0.1"
    """Address that it listens on; 0.0.0.0 lets other machines in that know the token in the printed address."""
    record: Annotated[Path | None, arg(metavar="PATH", help_behavior_hint="")] = None
    """Write everything public of a skill into a bag, a new folder of this name."""
    foxglove: bool = False
    """Serve a skill to Foxglove on port 8765, paced by the wall clock."""


OPTIONS = get_type_hints(RunConfig)
"""Type of each option of `golem run`, by its name."""


def read_run(words: list[str]) -> tuple[RunConfig, list[str]]:
    """Return what the words after `golem run` say: the options, and what is left for the skill's goal.

    The goal's words stand behind `--skill NAME`, options of `golem run` among them or before.
    """
    at = next((i for i, word in enumerate(words) if word.partition("=")[0] == "--skill"), len(words))
    end = at + (1 if "=" in "".join(words[at : at + 1]) else 2)
    own, goal = words[:end], []
    rest = iter(words[end:])
    for word in rest:
        name = word.partition("=")[0].removeprefix("--no-").removeprefix("--")
        if not word.startswith("--") or name not in OPTIONS:
            goal.append(word)
        elif "=" in word or OPTIONS[name] is bool:
            own.append(word)
        else:
            own += [word, *islice(rest, 1)]
    return tyro.cli(RunConfig, prog="golem run", args=own), goal


def run_stack(config: RunConfig, goal_words: Sequence[str] = ()) -> SkillResult:
    """Run the episode and print what happens; `goal_words` say the skill's goal, see `parse_goal`.

    Raises:
        ConfigError: the stack file, the goal or an option is wrong.
        ModuleFault: a module broke its contract.
    """
    stack = load_stack(config.stack, profile=config.profile)
    if config.world is not None:
        stack = stack.with_options("robot", world=config.world)
    legs = stack.choice("lower_body").use
    if stack.on_ground and not getattr(registry.load("lower_body", legs), "balances", True):
        print(f"lower_body: {legs} does not balance, and the robot is on its feet: it will fall.", flush=True)
    if config.operate and config.skill is not None:
        raise ConfigError("--operate lets you start skills by hand; give it or --skill, not both.")
    if config.operate or (config.skill is None and stack.on_ground):
        if config.record is not None or config.foxglove:
            raise ConfigError(
                "--record and --foxglove are for a skill: add --skill pick. A robot that is operated lives on a "
                "domain: golem twin, and beside it golem record or golem view."
            )
        return _operate(config, stack)
    name, skills = config.skill or "pick", SkillTable(stack)
    prog = f"golem run {config.stack} --skill {name}"
    goal = skills.goal(name, parse_goal(skills.spec(name), list(goal_words), prog, OPTIONS))
    running, robot = build(stack, config.seed)
    with ExitStack() as closing:
        closing.callback(robot.close)
        watch = Narrator(running, closing.enter_context(on_air(running, robot, config.record, config.foxglove)))
        if config.view or (config.port, config.host) != (RunConfig.port, RunConfig.host):
            view = closing.enter_context(LiveView(running, shown(running, robot), config.port, config.host))
            print(f"Live view: {view.url}   (Ctrl-C ends it)")
            result = view.run(name, goal, watch=watch)
        else:
            result = running.execute(name, goal, realtime=config.foxglove, watch=watch)
    print(f"{'Done' if result.success else 'Failed'} after {running.executor.t:.1f} s of robot time: {result.reason}")
    _show_trace(result)
    return result


def _operate(config: RunConfig, stack: Stack) -> SkillResult:
    """Let the operator drive, push and start skills in the live view until Ctrl-C."""
    with ExitStack() as closing:
        running, robot = build(stack, config.seed)
        closing.callback(lambda: robot.close())
        view = closing.enter_context(LiveView(running, shown(running, robot), config.port, config.host, restarts=True))
        print(f"Open {view.url} to drive, push and start skills. Ctrl-C ends it.", flush=True)
        if not no_display():
            webbrowser.open(view.url)
        try:
            while True:
                asked = view.wait_for_skill()
                if asked is not None:
                    result = view.run(*asked, watch=Narrator(running))
                    print(result.reason, flush=True)
                    _show_trace(result)
                else:
                    robot.close()
                    running, robot = build(stack, config.seed)
                    view.attach(running, robot)
        except KeyboardInterrupt:
            print()
    return SkillResult(True, "done", None, "Ended by the operator.")


def show_trial(config: LadderConfig) -> TrialOutcome:
    """Run one trial of a ladder in the live view, and say how it ended. Raises ConfigError: a wrong option or trial."""
    config = config.whole()
    request, _ = prepare(config)
    spec, record = find_trial(config, request)
    views: list[LiveView] = []

    def onlooker(running: LockstepRunner, robot: MujocoRobot) -> None:
        views.append(LiveView(running, robot, passive=True))

    print(f"Trial {trial_name(spec)} of rung {spec.rung}, paced by the wall clock.")
    request.rung.onlooker = onlooker
    try:
        outcome = run_trial(request.rung, spec, leaving=(SystemExit,))
    finally:
        for view in views:
            view.close()
    print("A success." if outcome.success else f"Lost in {outcome.stage}, {outcome.module}: {outcome.detail}")
    if outcome.trace:
        print(outcome.trace)
    if record is not None:
        same = (record.success, record.stage, record.detail) == (outcome.success, outcome.stage, outcome.detail)
        print(f"It {'ended as' if same else 'did not end as'} its record in {config.out} says.")
    return outcome


def _show_trace(result: SkillResult) -> None:
    if result.trace is not None:
        print(result.trace, file=sys.stderr)


def on_air(
    running: LockstepRunner, robot: Robot, bag: Path | None, foxglove: bool = False
) -> AbstractContextManager[Callable[[], None]]:
    """Record a stack into `bag` and serve it to Foxglove; enters what is to be called after every tick.

    Raises ConfigError, MissingExtra, OutputError: see `broadcast`.
    """
    if bag is None and not foxglove:
        return nullcontext(lambda: None)
    from golem.runtime.live.broadcast import broadcast

    return broadcast(running, robot, bag, FOXGLOVE_PORT if foxglove else None)


def shown(running: LockstepRunner, robot: object) -> MujocoRobot:
    """Return the `robot` of a stack as the twin, which is what a viewer shows. Raises ConfigError: it is none."""
    if not isinstance(robot, MujocoRobot):
        raise ConfigError(f"The live view shows the twin; robot: {running.stack.choice('robot').use} is not 'mujoco'.")
    return robot


class Narrator:
    """Prints what the running skill says: each new stage, and each sentence that differs in more than its figures."""

    def __init__(self, running: LockstepRunner, *others: Callable[[], None]) -> None:
        """Narrate what `running` does; `others` are called after it each time, in their order."""
        self._news, self._others = News(running.bus, topics.FEEDBACK), others
        self._said = ""

    def __call__(self) -> None:
        feedback = self._news.read()
        said = "" if feedback is None else feedback.stage + re.sub(r"[\d.]+", "", feedback.text)
        if feedback is not None and (said != self._said or feedback.data.get("failed")):
            self._said = said
            print(f"{feedback.t:7.2f} s  {feedback.stage:9s} {feedback.text}", flush=True)
        for look in self._others:
            look()
