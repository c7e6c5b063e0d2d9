"""Between the bus of a stack and Nav2: goals to its action NavigateToPose, twists of its controller back."""

from __future__ import annotations

from collections.abc import Callable

from golem.interfaces import ros_convert as convert
from golem.interfaces import topics
from golem.interfaces.nav_payloads import Nav2Goal, Nav2Reply, Nav2State, Nav2Twist
from golem.middleware.bus import Bus, News
from golem.middleware.ros import codec
from golem.middleware.ros.action_client import ClientGoal
from golem.middleware.ros.future import Future
from golem.middleware.ros.goals import GoalStatus
from golem.middleware.ros.msgs import geometry_msgs
from golem.middleware.ros.node import RosNode
from golem.runtime.executor import Node
from golem.types import TICK

ACTION, TYPE = "/navigate_to_pose", "nav2_msgs/action/NavigateToPose"
VELOCITY = "/cmd_vel"
ENDED: dict[GoalStatus, Nav2State] = {
    GoalStatus.SUCCEEDED: "succeeded",
    GoalStatus.ABORTED: "aborted",
    GoalStatus.CANCELED: "canceled",
}


class Nav2Bridge(Node):
    """Passes goals on as soon as Nav2 is there, and cancels them when the skill has no use for them any more."""

    period = TICK

    def __init__(self, bus: Bus, node: RosNode, now: Callable[[], float]) -> None:
        """Speak for `bus` through `node`; `now` is robot time [s]."""
        self._bus, self._now = bus, now
        self._client = node.action_client(ACTION, TYPE)
        self._goals = News(bus, topics.NAV2_GOAL)
        self._pursued = News(bus, topics.NAV_GOAL)
        self._frame = "map"
        self._waiting: Nav2Goal | None = None
        self._number = 0
        self._answer: Future[ClientGoal] | None = None
        self._active: ClientGoal | None = None
        self._said: Nav2Reply | None = None
        node.subscription(VELOCITY, "geometry_msgs/msg/Twist", self._take)

    def step(self, t: float) -> None:
        pursued = self._pursued.read()
        if pursued is not None:
            self._frame = pursued.frame
            if pursued.pose is None:
                self._drop()
        goal = self._goals.read()
        if goal is not None:
            self._drop()
            self._waiting, self._number = goal, goal.number
        if self._waiting is not None:
            if self._client.ready():
                self._send(self._waiting)
                self._waiting = None
            else:
                self._tell("absent")
        if self._active is not None:
            # A Nav2 that died tells no end, and one that was started again does not know the goal.
            state = ENDED.get(self._active.status, "active" if self._client.ready() else "absent")
            self._tell(state)
            if state != "active":
                self._active = None

    def _send(self, goal: Nav2Goal) -> None:
        pose = geometry_msgs.PoseStamped(convert.header(self._now(), self._frame), convert.pose(goal.pose.matrix()))
        self._answer = self._client.send_goal(codec.action(TYPE).Goal(pose, ""))
        self._answer.then(lambda answer: self._answered(goal.number, answer))

    def _answered(self, number: int, answer: Future[ClientGoal]) -> None:
        try:
            given = answer.result()
        except Exception:  # whatever became of the call: the goal is not pursued
            given = None
        if given is not None and given.accepted and number != self._number:
            given.cancel()
        elif number == self._number:
            self._active = given if given is not None and given.accepted else None
            self._tell("active" if self._active is not None else "rejected")

    def _drop(self) -> None:
        if self._active is not None:
            self._active.cancel()
        self._active, self._waiting = None, None
        self._number = 0

    def _tell(self, state: Nav2State) -> None:
        reply = Nav2Reply(self._number, state)
        if reply != self._said:
            self._said = reply
            self._bus.publish(topics.NAV2_REPLY, reply, self._now())

    def _take(self, message: geometry_msgs.Twist) -> None:
        if self._active is not None:
            now = self._now()
            self._bus.publish(topics.NAV2_TWIST, Nav2Twist(now, convert.to_twist(message)), now)
