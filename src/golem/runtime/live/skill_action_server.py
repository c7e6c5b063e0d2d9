"""The skills of a stack as actions: one goal at a time, with feedback, a result, and a way to cancel it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from golem.errors import GolemError
from golem.interfaces import ros_convert as convert
from golem.interfaces import topics
from golem.interfaces.payloads import Feedback, GateState
from golem.middleware.bus import News
from golem.middleware.ros.base import ServerGoal
from golem.middleware.ros.goals import GoalStatus
from golem.middleware.ros.msgs import golem_interfaces
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.live.safety_status import describe_status
from golem.runtime.node_groups import StackNodes
from golem.skills.base import Skill, SkillResult
from golem.skills.pick import TIMEOUT, Pick, PickGoal
from golem.skills.runner import SkillRun
from golem.skills.walk import Stand, StandGoal, Walk, WalkGoal
from golem.types import SIDES, TICK

MARGIN = 10.0
"""Time a skill gets on top of what its goal allows it [s]: it ends by itself unless it hangs."""
SILENT = "The robot has fallen silent."
REFUSED = "refused"
"""Stage of the result of a goal that was never begun."""


@dataclass(frozen=True)
class ActionSpec:
    """One skill as an action.

    Attributes:
        make: builds the skill from the stack's modules.
        goal: reads the action's goal; raises `GolemError` for one that makes no sense.
        allowance: robot time it may take [s], by its goal.
        result, feedback: the action's messages around GOLEM's own.
    """

    make: Callable[[StackNodes], Skill[Any, Any]]
    goal: Callable[[Any], Any]
    allowance: Callable[[Any], float]
    result: Callable[[golem_interfaces.SkillResult], Any]
    feedback: Callable[[golem_interfaces.SkillFeedback], Any]


def _pick_goal(message: golem_interfaces.Pick_Goal) -> PickGoal:
    for side in SIDES:
        if message.side == side and message.label and message.container:
            return PickGoal(message.label, message.container, side)
    raise GolemError("A pick names a label, a container, and the side 'left' or 'right'.")


def _walk_goal(message: golem_interfaces.Walk_Goal) -> WalkGoal:
    frames = {"odom": "odom", "base_link": "base"}
    frame = message.pose.header.frame_id
    if frame not in frames:
        raise GolemError(
            f"The frame '{frame}' is not known to the stack; give the pose in odom or base_link."
        )
    T = convert.matrix(message.pose.pose)
    yaw = math.atan2(T[1, 0], T[0, 0])
    timeout = convert.seconds(message.timeout) or WalkGoal.timeout
    return WalkGoal(float(T[0, 3]), float(T[1, 3]), yaw, frames[frame], timeout)  # pyright: ignore[reportArgumentType]


def _stand_goal(message: golem_interfaces.Stand_Goal) -> StandGoal:
    return StandGoal(max(0.0, convert.seconds(message.duration)))


OFFERS: dict[str, ActionSpec] = {
    "/skill/pick": ActionSpec(
        lambda stack: Pick(stack.method),
        _pick_goal,
        lambda goal: TIMEOUT,
        golem_interfaces.Pick_Result,
        golem_interfaces.Pick_Feedback,
    ),
    "/skill/walk": ActionSpec(
        lambda stack: Walk(stack.navigator),
        _walk_goal,
        lambda goal: goal.timeout + MARGIN,
        golem_interfaces.Walk_Result,
        golem_interfaces.Walk_Feedback,
    ),
    "/skill/stand": ActionSpec(
        lambda stack: Stand(),
        _stand_goal,
        lambda goal: goal.seconds + MARGIN,
        golem_interfaces.Stand_Result,
        golem_interfaces.Stand_Feedback,
    ),
}
"""Every skill by the name of its action."""


class SkillActionServer:
    """Pursues the goals of all skill actions, one at a time, with the stack that is attached.

    A goal that cannot be begun is accepted and aborted at once: its result then says why, which a rejection cannot.
    """

    period = TICK

    def __init__(self, endpoints: RoleEndpoints) -> None:
        """Offer the actions on `surface`."""
        self._stack: StackNodes | None = None
        self._t = 0.0
        self._silent = False
        self._pursuit: ActiveGoal | None = None
        endpoints.act({name: Handler(self, offer) for name, offer in OFFERS.items()})

    def attach(self, stack: StackNodes, t: float) -> None:
        """Work with `stack` from `t` [s] of its robot on; what was pursued with another has failed."""
        if self._pursuit is not None:
            anew = SkillResult(False, "robot", "robot", "The robot was started anew.")
            self._pursuit.run.fail("robot", anew.reason)
            self._give_up(anew)
        self._stack, self._t = stack, t

    def hear(self, silent: bool) -> None:
        """Note whether the robot is silent: its clock, by which everything here goes, then stands still."""
        if silent and not self._silent and self._pursuit is not None:
            self._pursuit.run.cancel()
            self._give_up(SkillResult(False, "robot", "robot", SILENT))
        self._silent = silent

    def busy(self) -> bool:
        """Return whether a goal is pursued."""
        return self._pursuit is not None

    def begin(self, offer: ActionSpec, goal: ServerGoal) -> None:
        """Pursue a goal, or say in its result why not."""
        goal.execute()
        stack = self._stack
        safety = None if stack is None else stack.safety
        try:
            if stack is None or safety is None:
                raise GolemError("The robot does not report yet.")
            if self._silent:
                raise GolemError(SILENT)
            if self._pursuit is not None:
                raise GolemError("Another skill is running; cancel it first.")
            if safety.state is not GateState.ACTIVE:
                raise GolemError(
                    f"The safety gate is {describe_status(safety)}; activate it first: golem safety activate."
                )
            wanted = offer.goal(goal.request)
            run = stack.start(offer.make(stack), wanted)
        except GolemError as error:
            goal.abort(offer.result(result_message(SkillResult(False, REFUSED, None, str(error)))))
            return
        news = News(stack.bus, topics.FEEDBACK)
        self._pursuit = ActiveGoal(offer, goal, run, self._t + offer.allowance(wanted), news)

    def cancel(self, goal: ServerGoal) -> bool:
        """Cancel the skill that pursues `goal`; it may take a while to leave the robot safe."""
        pursuit = self._pursuit
        if pursuit is None or pursuit.goal.id != goal.id:
            return False
        pursuit.run.cancel()
        return True

    def step(self, t: float) -> None:
        """Pass feedback on, and end what has ended."""
        self._t = t
        pursuit, stack = self._pursuit, self._stack
        if pursuit is None or stack is None:
            return
        feedback = pursuit.news.read()
        if feedback is not None:
            pursuit.goal.feedback(pursuit.offer.feedback(feedback_message(feedback)))
        safety = stack.safety
        if pursuit.run.result is not None:
            self._give_up(pursuit.run.result)
        elif safety is not None and safety.state is not GateState.ACTIVE:
            pursuit.run.cancel()
            self._give_up(
                SkillResult(False, "safety", "safety", f"The safety gate is {describe_status(safety)}.")
            )
        elif t >= pursuit.deadline:
            pursuit.run.cancel()
            self._give_up(SkillResult(False, "timeout", None, "It took longer than its goal allows."))

    def _give_up(self, result: SkillResult) -> None:
        """End the goal that is pursued, if one is, with `result`."""
        pursuit, self._pursuit = self._pursuit, None
        if pursuit is None:
            return
        message = pursuit.offer.result(result_message(result))
        if pursuit.goal.status is GoalStatus.CANCELING and result.stage == "cancelled":
            pursuit.goal.canceled(message)
        elif result.success:
            pursuit.goal.succeed(message)
        else:
            pursuit.goal.abort(message)


@dataclass
class ActiveGoal:
    """A goal in pursuit: what was offered, the goal, the skill, until when, and what it says."""

    offer: ActionSpec
    goal: ServerGoal
    run: SkillRun
    deadline: float
    news: News[Feedback]


@dataclass(frozen=True)
class Handler:
    """Decides about the goals of one action; see `ActionHandler`."""

    skills: SkillActionServer
    offer: ActionSpec

    def decide(self, request: Any) -> bool:
        """Take every goal on; see `SkillActionServer`."""
        return True

    def accepted(self, goal: ServerGoal) -> None:
        """Begin it."""
        self.skills.begin(self.offer, goal)

    def cancel(self, goal: ServerGoal) -> bool:
        """Cancel it."""
        return self.skills.cancel(goal)


def result_message(result: SkillResult) -> golem_interfaces.SkillResult:
    """Return how a skill ended."""
    timings = [golem_interfaces.Timing(name, float(s)) for name, s in result.timings.items()]
    return golem_interfaces.SkillResult(
        result.success, result.stage, result.slot or "", result.reason, timings
    )


def feedback_message(feedback: Feedback) -> golem_interfaces.SkillFeedback:
    """Return what a running skill says; of its data what is numbers."""
    data: list[golem_interfaces.NamedValues] = []
    for name, value in feedback.data.items():
        try:
            numbers = np.atleast_1d(np.asarray(value, np.float64)).ravel()
        except (TypeError, ValueError):
            continue
        data.append(golem_interfaces.NamedValues(name, numbers))
    return golem_interfaces.SkillFeedback(
        convert.time(feedback.t), feedback.skill, feedback.stage, feedback.text, data
    )
