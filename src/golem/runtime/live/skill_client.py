"""`golem skill`: gives the robot on a domain a goal, prints what it says, and cancels on Ctrl-C."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

import tyro
from tyro.conf import OmitArgPrefixes, Positional

from golem.errors import ConfigError, unknown_name
from golem.interfaces import public
from golem.interfaces import ros_convert as convert
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.interrupt import interrupted
from golem.middleware.ros.base import ClientGoal, RosNode
from golem.middleware.ros.future import Future, RosError
from golem.middleware.ros.goals import GoalStatus
from golem.middleware.ros.msgs import golem_interfaces
from golem.middleware.ros.msgs.geometry_msgs import PoseStamped
from golem.robots.model.spatial import rotation_rpy, transform
from golem.runtime.live.node_setup import ANSWER, find, log_line, member
from golem.types import Side

DONE, FAILED, CANCELED = 0, 1, 130
"""Exit codes."""


@dataclass(frozen=True)
class PickErrand:
    """Find an object, grasp it, pull it straight out and drop it in a container."""

    label: Positional[str] = "screw"
    """Class of the object."""
    arm: Side = "right"
    """Which arm."""
    container: str = "tray"
    """Class of what it is dropped into."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)

    @property
    def goal(self) -> golem_interfaces.Pick_Goal:
        """The action's goal."""
        return golem_interfaces.Pick_Goal(self.label, self.container, self.arm)


@dataclass(frozen=True)
class WalkErrand:
    """Walk to a pose and stand there."""

    x: Positional[float]
    """Where to [m]."""
    y: Positional[float] = 0.0
    """Where to [m]."""
    yaw: Positional[float] = 0.0
    """Which way to look there [rad]."""
    frame: Literal["base_link", "odom"] = "base_link"
    """What the pose is given in: base_link, where the robot stands now, or odom."""
    timeout: float = 60.0
    """Time after which the robot gives up [s]."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)

    @property
    def goal(self) -> golem_interfaces.Walk_Goal:
        """The action's goal."""
        if not all(map(math.isfinite, (self.x, self.y, self.yaw, self.timeout))):
            raise ConfigError("A place to walk to has finite coordinates.")
        T = transform((self.x, self.y, 0.0), rotation_rpy(0.0, 0.0, self.yaw))
        pose = PoseStamped(convert.header(0.0, self.frame), convert.pose(T))
        return golem_interfaces.Walk_Goal(pose, convert.duration(self.timeout))


@dataclass(frozen=True)
class StandErrand:
    """Stand for a while."""

    seconds: Positional[float] = 60.0
    """How long [s]."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)

    @property
    def goal(self) -> golem_interfaces.Stand_Goal:
        """The action's goal."""
        return golem_interfaces.Stand_Goal(convert.duration(self.seconds))


Errand = PickErrand | WalkErrand | StandErrand
ERRANDS: dict[str, tuple[str, type[Errand]]] = {
    "pick": ("/skill/pick", PickErrand),
    "grasp": ("/skill/pick", PickErrand),  # what the paper calls the same
    "walk": ("/skill/walk", WalkErrand),
    "stand": ("/skill/stand", StandErrand),
}
"""Action and options by the word on the command line."""


def read_errand(words: list[str]) -> tuple[str, Errand] | None:
    """Return the action and the errand that the words of a command line ask for; None where they ask for help.

    Raises:
        ConfigError: there is no such skill.
    """
    if words[:1] in (["-h"], ["--help"]):
        log_line("usage: golem skill NAME [options]     (golem skill NAME --help tells the options)\n")
        for name, (action, kind) in ERRANDS.items():
            log_line(f"  {name:8s} {action:12s} {kind.__doc__}")
        return None
    if not words:
        raise ConfigError(f"Say which skill: {', '.join(ERRANDS)}.")
    if words[0] not in ERRANDS:
        raise unknown_name("skill", words[0], ERRANDS)
    action, kind = ERRANDS[words[0]]
    return action, tyro.cli(kind, prog=f"golem skill {words[0]}", args=words[1:])


def run_errand(errand: tuple[str, Errand]) -> int:
    """Pursue an errand to its end and return the exit code.

    Raises:
        RosError: no stack is there, or it went away.
    """
    action, what = errand
    goal = what.goal
    with interrupted() as stop, member("skill", what.dds) as (_, node):
        pursued = propose(node, action, goal, f"start a stack with: {what.dds.command('up STACK')}")
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
    log_line(f"{GoalStatus(outcome.status).name.lower()}: {ended.reason}")
    for timing in ended.timings:
        log_line(f"  {timing.name} {timing.seconds:.1f} s")
    if outcome.status is GoalStatus.SUCCEEDED:
        return DONE
    return CANCELED if outcome.status is GoalStatus.CANCELED else FAILED


def propose(node: RosNode, action: str, goal: Any, remedy: str) -> ClientGoal:
    """Give `goal` to an action whose feedback is printed, and return it once it was accepted.

    Raises:
        RosError: nobody offers the action, it does not answer, or it rejects the goal; `remedy` says what to do.
    """
    kind = next(row.type for row in public.ACTIONS if row.name == action)
    client = node.action_client(action, kind)
    find(node, action, client, remedy)
    said: list[str] = []

    def feedback(message: Any) -> None:
        f = message.feedback
        if f.text not in said[-1:]:
            said.append(f.text)
            log_line(f"{convert.seconds(f.stamp):7.2f} s  {f.stage:9s} {f.text}")

    sent: Future[ClientGoal] = client.send_goal(goal, feedback)
    pursued = node.wait(sent, ANSWER)
    if not pursued.accepted:
        raise RosError(f"'{action}' rejected the goal.")
    return pursued
