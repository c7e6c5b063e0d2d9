"""`golem run`: one stack file, one episode."""

from __future__ import annotations

from dataclasses import dataclass

from tyro.conf import Positional

from golem.dashboard.live import LiveView
from golem.errors import ConfigError
from golem.middleware import topics
from golem.middleware.bus import News
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.assembly import Running, build
from golem.skills.base import Feedback, SkillResult
from golem.skills.pick import TIMEOUT, Pick, PickGoal
from golem.stack import load_stack


@dataclass(frozen=True)
class RunConfig:
    """Run a stack file once: the robot picks one screw, in lock-step or with the live view."""

    stack: Positional[str] = "tether"
    """Path of a stack file, or the name of a shipped one."""
    profile: str | None = None
    """Realism profile: ideal, bench or field; default: the stack file's."""
    seed: int = 0
    """Seed of the episode."""
    view: bool = False
    """Show it live in the browser, paced by the wall clock."""
    port: int = 8080
    """Port of the live view."""


def run_stack(config: RunConfig) -> SkillResult:
    """Run the episode and print what happens.

    Raises:
        ConfigError: the stack file or an option is wrong.
        ModuleFault: a module broke its contract.
    """
    running, robot = build(load_stack(config.stack, profile=config.profile), config.seed)
    narrator = Narrator(running)
    try:
        if config.view:
            if not isinstance(robot, MujocoRobot):
                raise ConfigError(f"--view shows the twin; robot: {running.stack.robot.use} is not 'mujoco'.")
            with LiveView(running, robot, config.port) as view:
                print(f"Live view: {view.url}   (Ctrl-C ends it)")
                result = view.run(Pick(running.method), PickGoal(), watch=narrator)
        else:
            result = running.execute(Pick(running.method), PickGoal(), TIMEOUT, watch=narrator)
    finally:
        robot.close()
    print(
        f"{'Done' if result.success else 'Failed'} after {running.executor.t:.1f} s of robot time: {result.reason}"
    )
    return result


class Narrator:
    """Prints each new stage of the running skill once."""

    def __init__(self, running: Running) -> None:
        """Listen to the skill of `running`."""
        self._news = News(running.bus, topics.FEEDBACK, Feedback)
        self._stage = ""

    def __call__(self) -> None:
        """Look for news."""
        feedback = self._news.read()
        if feedback is not None and (feedback.stage != self._stage or feedback.data.get("failed")):
            self._stage = feedback.stage
            print(f"{feedback.t:7.2f} s  {feedback.stage:9s} {feedback.text}")
