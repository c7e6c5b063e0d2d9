"""`golem run`: one stack file, one episode."""

from __future__ import annotations

import os
import sys
import webbrowser
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from tyro.conf import Positional

from golem.dashboard.live import LiveView
from golem.errors import ConfigError
from golem.interfaces import topics
from golem.middleware.bus import News
from golem.robots.base import Robot
from golem.robots.mujoco.config import World
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.base import SkillResult
from golem.skills.pick import TIMEOUT, Pick, PickGoal
from golem.stack import Stack, load_stack

FOXGLOVE_PORT = 8765
"""Where Foxglove looks first."""


def no_display() -> bool:
    """Return whether this machine has no screen to open a browser on."""
    return sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


@dataclass(frozen=True)
class RunConfig:
    """Run a stack file: the robot picks one screw, or stands and does what you ask for in the live view."""

    stack: Positional[str] = "tether"
    """Path of a stack file, or the name of a shipped one."""
    task: Literal["pick", "operate"] | None = None
    """pick: one screw, then the run ends. operate: you drive, push and pick in the live view until Ctrl-C. Default:
    operate where the robot stands on its feet, pick where it hangs."""
    world: World | None = None
    """World of the twin: pack, open, slope or rubble; default: the stack file's."""
    profile: str | None = None
    """Realism profile: ideal, bench or field; default: the stack file's."""
    seed: int = 0
    """Seed of the episode."""
    view: bool = False
    """Show a pick live in the browser, paced by the wall clock; operating always does."""
    port: int = 8080
    """Port of the live view."""
    record: Path | None = None
    """Write everything public of a pick into a bag, a new folder of this name."""
    foxglove: bool = False
    """Serve a pick to Foxglove on port 8765, paced by the wall clock."""


def run_stack(config: RunConfig) -> SkillResult:
    """Run the episode and print what happens.

    Raises:
        ConfigError: the stack file or an option is wrong.
        ModuleFault: a module broke its contract.
    """
    stack = load_stack(config.stack, profile=config.profile)
    if config.world is not None:
        robot = replace(stack.robot, options={**stack.robot.options, "world": config.world})
        stack = replace(stack, robot=robot)
    if (config.task or ("operate" if stack.on_ground else "pick")) == "operate":
        if config.record is not None or config.foxglove:
            raise ConfigError(
                "--record and --foxglove are for a pick: add --task pick. A robot that is operated lives on a "
                "domain: golem twin, and beside it golem record or golem view."
            )
        return _operate(config, stack)
    running, robot = build(stack, config.seed)
    narrator = Narrator(running)
    with ExitStack() as closing:
        closing.callback(robot.close)
        show = closing.enter_context(on_air(running, robot, config.record, config.foxglove))

        def watch() -> None:
            narrator()
            show()

        if config.view:
            view = closing.enter_context(LiveView(running, shown(running, robot), config.port))
            print(f"Live view: {view.url}   (Ctrl-C ends it)")
            result = view.run(Pick(running.method), PickGoal(), watch=watch)
        else:
            goal, paced = PickGoal(), config.foxglove
            result = running.execute(Pick(running.method), goal, TIMEOUT, realtime=paced, watch=watch)
    print(
        f"{'Done' if result.success else 'Failed'} after {running.executor.t:.1f} s of robot time: {result.reason}"
    )
    _show_trace(result)
    return result


def _operate(config: RunConfig, stack: Stack) -> SkillResult:
    """Let the operator drive, push and pick in the live view until Ctrl-C."""
    with ExitStack() as closing:
        running, robot = build(stack, config.seed)
        closing.callback(lambda: robot.close())
        view = closing.enter_context(LiveView(running, shown(running, robot), config.port, restarts=True))
        print(f"Open {view.url} to drive, push and pick. Ctrl-C ends it.", flush=True)
        if not no_display():
            webbrowser.open(view.url)
        try:
            while True:
                if view.wait_for_pick():
                    result = view.run(Pick(running.method), PickGoal(), watch=Narrator(running))
                    print(result.reason, flush=True)
                    _show_trace(result)
                else:
                    robot.close()
                    running, robot = build(stack, config.seed)
                    view.attach(running, robot)
        except KeyboardInterrupt:
            print()
    return SkillResult(True, "done", None, "Ended by the operator.")


def _show_trace(result: SkillResult) -> None:
    """Print where a module failed, if one did."""
    if result.trace:
        print(result.trace, file=sys.stderr)


def on_air(
    running: LockstepRunner, robot: Robot, bag: Path | None, foxglove: bool = False
) -> AbstractContextManager[Callable[[], None]]:
    """Record a stack into `bag` and serve it to Foxglove; enters what is to be called after every tick.

    Raises:
        ConfigError, MissingExtra, OutputError: see `broadcast`.
    """
    if bag is None and not foxglove:
        return nullcontext(lambda: None)
    from golem.runtime.live.broadcast import broadcast

    return broadcast(running, robot, bag, FOXGLOVE_PORT if foxglove else None)


def shown(running: LockstepRunner, robot: object) -> MujocoRobot:
    """Return the `robot` of a stack as the twin, which is what a viewer shows.

    Raises:
        ConfigError: it is none.
    """
    if not isinstance(robot, MujocoRobot):
        raise ConfigError(f"The live view shows the twin; robot: {running.stack.robot.use} is not 'mujoco'.")
    return robot


class Narrator:
    """Prints each new stage of the running skill once."""

    def __init__(self, running: LockstepRunner) -> None:
        """Listen to the skill of `running`."""
        self._news = News(running.bus, topics.FEEDBACK)
        self._stage = ""

    def __call__(self) -> None:
        """Look for news."""
        feedback = self._news.read()
        if feedback is not None and (feedback.stage != self._stage or feedback.data.get("failed")):
            self._stage = feedback.stage
            print(f"{feedback.t:7.2f} s  {feedback.stage:9s} {feedback.text}")
