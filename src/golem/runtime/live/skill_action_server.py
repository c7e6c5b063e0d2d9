"""The skills of a stack as actions: one goal at a time, with feedback, a result, and a way to cancel it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from golem.errors import GolemError
from golem.interfaces import topics
from golem.interfaces.payloads import Feedback, GateState
from golem.middleware.bus import News
from golem.middleware.ros.action_server import ServerGoal
from golem.middleware.ros.callback_guard import CallbackGuard, log_error
from golem.middleware.ros.goals import GoalStatus
from golem.runtime.executor import Node
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.live.safety_status import describe_status
from golem.runtime.live.skill_messages import SkillAction, skill_actions
from golem.runtime.node_groups import StackNodes
from golem.skills.base import CANCELLED, FAULT, REFUSED, SkillResult
from golem.skills.runner import SLOT, SkillRun
from golem.types import TICK

SILENT = "The robot has fallen silent."


class SkillActionServer(Node):
    """Pursues the goals of all skill actions, one at a time, with the stack that is attached.

    A goal that cannot be begun is accepted and aborted at once: its result then says why, which a rejection cannot.
    Nothing that a skill does or says, and no goal, raises anything here: this process balances the robot.
    """

    period = TICK

    def __init__(
        self, endpoints: RoleEndpoints, log: Callable[[str], None] = log_error, who: Callable[[bytes], str] = bytes.hex
    ) -> None:
        """Offer the actions on `endpoints`; what a skill raises is logged by `log`, `who` names a client."""
        self._lease: ServerGoal | None = None
        self._who = who
        self._stack: StackNodes | None = None
        self._silent = False
        self._pursuit: ActiveGoal | None = None
        self._guard = CallbackGuard(log)
        endpoints.act({name: Handler(self, action) for name, action in skill_actions().items()})

    def attach(self, stack: StackNodes) -> None:
        """Work with `stack` from now on; what was pursued with another has failed."""
        if self._pursuit is not None:
            self._end(SkillResult(False, "robot", "robot", "The robot was restarted."))
        self._stack = stack

    def hear(self, silent: bool) -> None:
        """Note whether the robot is silent: its clock, by which everything here goes, then stands still."""
        if silent and not self._silent and self._pursuit is not None:
            self._end(SkillResult(False, "robot", "robot", SILENT))
        self._silent = silent

    def busy(self) -> bool:
        """Return whether a goal is pursued."""
        return self._pursuit is not None

    def begin(self, action: SkillAction, goal: ServerGoal) -> None:
        """Pursue a goal, or say in its result why not."""
        goal.execute()
        try:
            stack = self._ready(goal)
            name, fields = action.goal(goal.request)
            run = stack.start(name, fields)
        except Exception as error:  # the goal is a stranger's, and its skill a user's
            reason = self._guard.caught("The goal", error)
            goal.abort(action.result(SkillResult(False, REFUSED, None, reason)))
            return
        self._pursuit = ActiveGoal(action, goal, run, News(stack.bus, topics.FEEDBACK))
        self._lease = goal

    def take_over(self) -> str:
        """Let whoever asks next have the lease for skills; return who had it, or an empty string if nobody did."""
        lease, self._lease = self._lease, None
        return "" if lease is None or not lease.attended() else self._who(lease.client)

    def _ready(self, goal: ServerGoal) -> StackNodes:
        """Return the stack, if the skill of `goal` can begin now; raises `GolemError` otherwise."""
        stack = self._stack
        safety = None if stack is None else stack.safety
        if stack is None or safety is None:
            raise GolemError("The robot does not report yet.")
        if self._silent:
            raise GolemError(SILENT)
        if self._pursuit is not None:
            raise GolemError("Another skill is running; cancel it first.")
        lease = self._lease
        if lease is not None and lease.client != goal.client and lease.attended():
            raise GolemError(
                f"{self._who(lease.client)} has the lease for skills; end it, or: golem skill --take-over ..."
            )
        if safety.state is not GateState.ACTIVE:
            remedy = "golem safety reset && golem safety activate" if safety.stopped else "golem safety activate"
            raise GolemError(f"The safety gate is {describe_status(safety)}; activate it first: {remedy}.")
        return stack

    def cancel(self, goal: ServerGoal) -> bool:
        """Cancel the skill that pursues `goal`; it may take a while to leave the robot safe."""
        pursuit = self._pursuit
        if pursuit is None or pursuit.goal.id != goal.id:
            return False
        pursuit.run.cancel()
        return True

    def step(self, t: float) -> None:
        pursuit, stack = self._pursuit, self._stack
        if pursuit is None or stack is None:
            return
        feedback = pursuit.news.read()
        if feedback is not None:
            self._guard.call("Feedback", lambda: pursuit.goal.feedback(pursuit.action.feedback(feedback)))
        safety = stack.safety
        if pursuit.run.result is not None:
            self._tell(pursuit, pursuit.run.result)
        elif safety is not None and safety.state is not GateState.ACTIVE:
            self._end(SkillResult(False, "safety", "safety", f"The safety gate is {describe_status(safety)}."))

    def _end(self, result: SkillResult) -> None:
        """End the goal that is pursued with `result`, whatever its skill has to say; it may clean up."""
        if self._pursuit is not None:
            self._pursuit.run.cancel()
            self._tell(self._pursuit, result)

    def _tell(self, pursuit: ActiveGoal, result: SkillResult) -> None:
        self._pursuit = None
        if pursuit.run.error is not None:
            self._guard.caught("The skill", pursuit.run.error)
        try:
            message = pursuit.action.result(result)
        except Exception as error:  # what a user's skill found may be no JSON
            result = SkillResult(False, FAULT, SLOT, self._guard.caught("The result", error))
            message = pursuit.action.result(result)
        goal = pursuit.goal
        if goal.status is GoalStatus.CANCELING and result.stage == CANCELLED:
            goal.canceled(message)
        elif result.success:
            goal.succeed(message)
        else:
            goal.abort(message)


@dataclass
class ActiveGoal:
    """A goal in pursuit: the action it came by, the goal, its skill, and what that says."""

    action: SkillAction
    goal: ServerGoal
    run: SkillRun
    news: News[Feedback]


@dataclass(frozen=True)
class Handler:
    """Decides about the goals of one action; see `ActionHandler`."""

    skills: SkillActionServer
    action: SkillAction

    def decide(self, request: Any) -> bool:
        return True

    def accepted(self, goal: ServerGoal) -> None:
        self.skills.begin(self.action, goal)

    def cancel(self, goal: ServerGoal) -> bool:
        return self.skills.cancel(goal)
