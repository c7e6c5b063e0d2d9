"""Another process: a node that offers a service and an action on a DDS domain until its standard input is closed."""

from __future__ import annotations

import select
import sys
from typing import Any

from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.ros.action_server import ServerGoal
from golem.middleware.ros.codec import action, service
from golem.middleware.ros.goals import GoalStatus
from golem.middleware.ros.msgs.golem_interfaces import SkillFeedback, SkillResult
from golem.middleware.ros.node import RosNode
from golem.middleware.ros.node_endpoints import PARTICIPANT_USER_DATA

PICK, SET_BOOL = "golem_interfaces/action/Pick", "std_srvs/srv/SetBool"
STAGES = ("detect", "approach", "grasp", "pull")


class Picking:
    """Pretends to pick: one stage a step; what is called `forever` never ends."""

    def __init__(self) -> None:
        self.goals: dict[bytes, tuple[ServerGoal, int]] = {}
        self.type = action(PICK)

    def decide(self, request: Any) -> bool:
        return bool(request.label)

    def accepted(self, goal: ServerGoal) -> None:
        goal.execute()
        self.goals[goal.id] = goal, 0

    def cancel(self, goal: ServerGoal) -> bool:
        return True

    def step(self) -> None:
        for goal, stage in list(self.goals.values()):
            if goal.status is GoalStatus.CANCELING:
                goal.canceled(self.type.Result(SkillResult(stage="cancelled")))
            elif stage < len(STAGES):
                goal.feedback(self.type.Feedback(SkillFeedback(stage=STAGES[stage])))
                self.goals[goal.id] = goal, stage + 1
            elif goal.request.label != "forever":
                goal.succeed(self.type.Result(SkillResult(success=True, stage="done")))
            if not goal.status.active:
                del self.goals[goal.id]


def main() -> None:
    participant = connect(DdsConfig(domain=int(sys.argv[1])), PARTICIPANT_USER_DATA)
    node = RosNode(participant, "peer")
    answer = service(SET_BOOL).Response
    node.service("set", SET_BOOL, lambda request: answer(request.data, "from another process"))
    picking = Picking()
    node.action_server("pick", PICK, picking)
    print("ready", flush=True)
    while not select.select([sys.stdin], [], [], 0)[0]:
        node.spin_once(0.005)
        picking.step()
    node.close()
    participant.close()


if __name__ == "__main__":
    main()
