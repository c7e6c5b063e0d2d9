"""The twin as a process: the simulated robot, its sensors and its on-board computer, paced by the wall clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from golem.interfaces import public
from golem.middleware.bus import Bus
from golem.middleware.dds.base import Participant
from golem.middleware.ros.base import RosNode
from golem.middleware.ros.msgs.std_srvs import Trigger_Response
from golem.middleware.wire.api import request_topic, response_topic
from golem.middleware.wire.rpc import RpcServer
from golem.robots.base import HasGantry, Robot
from golem.robots.unitree import motion_switcher
from golem.runtime import nodes
from golem.runtime.executor import Executor, Phase, Placed, in_order
from golem.runtime.live.motor_bridge import CommandIn, StateOut
from golem.runtime.live.node_setup import log_line
from golem.runtime.live.onboard_bridge import AnswersOut, CallsIn, OnboardLegsOut
from golem.runtime.live.render_worker import RenderWorker, image_topics
from golem.runtime.live.robot_out import (
    CameraOut,
    ClockOut,
    FramesOut,
    HandOut,
    JointsOut,
    describe,
    take_hand_commands,
)
from golem.runtime.live.role_endpoints import Poll, RoleEndpoints
from golem.runtime.live.sim_sync import PATIENCE
from golem.runtime.node_groups import ModuleFactory, RobotNodes
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
        node: RosNode,
        render_worker: RenderWorker | None = None,
        patience: float = PATIENCE,
        tell: Callable[[str], None] = log_line,
    ) -> None:
        """Put a robot on the domain.

        Args:
            stack: what it was built for.
            robot: the robot.
            participant: member of the domain.
            node: its ROS node.
            render_worker: where its images are made; None renders here, which holds everything else up meanwhile.
            patience: how long its time stands still at most for a stack that is behind [s].
            tell: says a line to a person.

        Raises:
            ConfigError, ModuleFault: about the on-board legs.
        """
        bus = Bus()
        images = image_topics()
        only = None if render_worker is None else {row.name for row in public.TOPICS} - images
        endpoints = RoleEndpoints("robot", participant, node, only)
        self._robot = robot
        cameras = (
            {name: CameraOut(bus, endpoints, name) for name in robot.cameras} if render_worker is None else {}
        )
        self.commands = CommandIn(bus, endpoints, tell, patience)
        side = RobotNodes(bus, stack, robot, (lambda c: cameras[c].wanted) if render_worker is None else None)
        placed: list[Placed] = [
            (Phase.RECEIVE, Poll(node)),
            (Phase.RECEIVE, self.commands),
            *side.nodes,
            # As soon as it is measured: whoever answers has the whole tick for it.
            (Phase.ESTIMATE, StateOut(bus, endpoints)),
            (Phase.ESTIMATE, ClockOut(endpoints)),
            (Phase.SEND, JointsOut(bus, endpoints)),
            (Phase.SEND, FramesOut(bus, endpoints)),
            (Phase.SEND, OnboardLegsOut(bus, endpoints.writer("/onboard/lowcmd"))),
            *((Phase.SEND, camera) for camera in cameras.values()),
            *((Phase.SEND, HandOut(bus, endpoints, hand)) for hand in SIDES),
        ]
        for service in (motion_switcher.SERVICE, stack.loco_api.service):
            requests, responses = request_topic(service), response_topic(service)
            server = RpcServer(endpoints.reader(f"/{requests}"), endpoints.writer(f"/{responses}"))
            placed.append((Phase.RECEIVE, CallsIn(bus, service, server)))
            placed.append((Phase.SEND, AnswersOut(bus, service, server)))
        if render_worker is not None:
            placed.append((Phase.EXPOSE, render_worker))
        if stack.legs_on_board is not None:
            estimator = nodes.EstimatorNode(bus, *ModuleFactory(stack).make("estimator"))
            placed.append((Phase.ESTIMATE, estimator))
        for hand in SIDES:
            take_hand_commands(bus, endpoints, hand)
        endpoints.serve({"/elastic_band/release": self._release})
        describe(endpoints, robot.calibration)
        self.executor = Executor(bus, in_order(placed))

    def run(self, stop: Callable[[], bool]) -> None:
        """Let the robot's time pass with the wall clock until `stop()`; a machine too slow for it falls behind."""
        self.executor.run(FOREVER, stop, realtime=True)

    def _release(self, request: Any) -> Trigger_Response:
        robot = self._robot
        if not isinstance(robot, HasGantry) or not robot.on_gantry:
            return Trigger_Response(False, "There is no band to let go: this robot hangs, or stands already.")
        robot.release()
        return Trigger_Response(True, "The band is let go.")
