"""The twin as a process: the simulated robot, its sensors and its on-board computer, paced by the wall clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from golem.middleware import public
from golem.middleware.bus import Bus
from golem.middleware.dds.base import Participant
from golem.middleware.ros.base import Node
from golem.middleware.ros.msgs.std_srvs import Trigger_Response
from golem.middleware.unitree_api import request_topic, response_topic
from golem.middleware.wire.rpc import RpcServer
from golem.robots.base import Banded, Robot
from golem.robots.onboard import motion_switcher
from golem.runtime import nodes
from golem.runtime.executor import Executor, Phase, Placed, in_order
from golem.runtime.live.darkroom import Darkroom, image_topics
from golem.runtime.live.member import say
from golem.runtime.live.motors import CommandIn, StateOut
from golem.runtime.live.onboard import AnswersOut, CallsIn, LegsOut
from golem.runtime.live.pace import PATIENCE
from golem.runtime.live.robot_out import (
    CameraOut,
    ClockOut,
    FramesOut,
    HandOut,
    JointsOut,
    describe,
    take_hand_commands,
)
from golem.runtime.live.surface import Poll, Surface
from golem.runtime.sides import RobotSide, Workshop
from golem.stack import Stack
from golem.types import SIDES

FOREVER = 1e9
"""A time nobody sees [s]."""


class Twin:
    """A robot on the domain.

    Attributes:
        executor: its clock.
        commands: what takes the motors' command.
    """

    def __init__(
        self,
        stack: Stack,
        robot: Robot,
        participant: Participant,
        node: Node,
        darkroom: Darkroom | None = None,
        patience: float = PATIENCE,
        tell: Callable[[str], None] = say,
    ) -> None:
        """Put a robot on the domain.

        Args:
            stack: what it was built for.
            robot: the robot.
            participant: member of the domain.
            node: its ROS node.
            darkroom: where its images are made; None is here, which holds everything else up for as long as it takes.
            patience: how long its time stands still at most for a stack that is behind [s].
            tell: says a line to a person.

        Raises:
            ConfigError, ModuleFault: about the on-board legs.
        """
        bus = Bus()
        images = image_topics()
        only = None if darkroom is None else {row.name for row in public.TOPICS} - images
        surface = Surface("robot", participant, node, only)
        self._robot = robot
        cameras = {name: CameraOut(bus, surface, name) for name in robot.cameras} if darkroom is None else {}
        self.commands = CommandIn(bus, surface, tell, patience)
        side = RobotSide(bus, stack, robot, (lambda c: cameras[c].wanted) if darkroom is None else None)
        placed: list[Placed] = [
            (Phase.RECEIVE, Poll(node)),
            (Phase.RECEIVE, self.commands),
            *side.nodes,
            # As soon as it is measured: whoever answers has the whole tick for it.
            (Phase.ESTIMATE, StateOut(bus, surface)),
            (Phase.ESTIMATE, ClockOut(surface)),
            (Phase.SEND, JointsOut(bus, surface)),
            (Phase.SEND, FramesOut(bus, surface)),
            (Phase.SEND, LegsOut(bus, surface.writer("/onboard/lowcmd"))),
            *((Phase.SEND, camera) for camera in cameras.values()),
            *((Phase.SEND, HandOut(bus, surface, hand)) for hand in SIDES),
        ]
        for service in (motion_switcher.SERVICE, stack.loco_api.service):
            requests, responses = request_topic(service), response_topic(service)
            server = RpcServer(surface.reader(f"/{requests}"), surface.writer(f"/{responses}"))
            placed.append((Phase.RECEIVE, CallsIn(bus, service, server)))
            placed.append((Phase.SEND, AnswersOut(bus, service, server)))
        if darkroom is not None:
            placed.append((Phase.EXPOSE, darkroom))
        if stack.legs_on_board is not None:
            estimator = nodes.EstimatorNode(bus, *Workshop(stack).make("estimator"))
            placed.append((Phase.ESTIMATE, estimator))
        for hand in SIDES:
            take_hand_commands(bus, surface, hand)
        surface.serve({"/elastic_band/release": self._release})
        describe(surface, robot.calibration)
        self.executor = Executor(bus, in_order(placed))

    def run(self, stop: Callable[[], bool]) -> None:
        """Let the robot's time pass with the wall clock until `stop()`; a machine too slow for it falls behind."""
        self.executor.run(FOREVER, stop, realtime=True)

    def _release(self, request: Any) -> Trigger_Response:
        robot = self._robot
        if not isinstance(robot, Banded) or not robot.banded:
            return Trigger_Response(False, "There is no band to let go: this robot hangs, or stands already.")
        robot.release()
        return Trigger_Response(True, "The band is let go.")
