"""The twin as a process: the simulated robot, its sensors and its on-board computer, paced by the wall clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from golem.interfaces import public, topics
from golem.middleware.bus import Bus
from golem.middleware.dds.base import Participant
from golem.middleware.ros.msgs.std_srvs import Trigger_Response
from golem.middleware.ros.node import RosNode
from golem.middleware.wire.api import request_topic, response_topic
from golem.middleware.wire.rpc import RpcServer
from golem.robots.base import HasGantry, Robot
from golem.robots.unitree import motion_switcher
from golem.runtime import nodes
from golem.runtime.executor import Executor, Phase, Placed, in_order
from golem.runtime.live.bridge import incoming, outgoing
from golem.runtime.live.motor_bridge import CommandIn
from golem.runtime.live.node_setup import log_line
from golem.runtime.live.onboard_bridge import AnswersOut, CallsIn
from golem.runtime.live.render_worker import RenderWorker, image_topics
from golem.runtime.live.robot_out import describe, encoders, images_wanted, lidar_wanted
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.live.sim_sync import PATIENCE
from golem.runtime.live.unanswered_calls import UnansweredCalls
from golem.runtime.node_groups import ModuleFactory, RobotNodes
from golem.runtime.onboard_nodes import stack_loco_api
from golem.stack import Stack

FOREVER = 1e9
"""A time nobody sees [s]."""
JUMP = 1.0
"""How far back the stamp of one state goes when somebody asks for a jump of the clock [s]."""


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
        self.commands = CommandIn(bus, endpoints, tell, patience)
        exposed = (
            None if render_worker is not None else lambda camera: partial(images_wanted, endpoints, camera)
        )
        side = RobotNodes(bus, stack, robot, exposed, partial(lidar_wanted, endpoints))
        placed: list[Placed] = [
            (Phase.RECEIVE, endpoints),
            (Phase.RECEIVE, self.commands),
            *side.nodes,
            *outgoing(bus, endpoints, encoders(bus)),
        ]
        for service in (motion_switcher.SERVICE, stack_loco_api(stack).service):
            requests, responses = request_topic(service), response_topic(service)
            server = RpcServer(endpoints.reader(f"/{requests}"), endpoints.writer(f"/{responses}"))
            placed.append((Phase.RECEIVE, CallsIn(bus, service, server)))
            placed.append((Phase.SEND, AnswersOut(bus, service, server)))
        if render_worker is not None:
            placed.append((Phase.EXPOSE, render_worker))
        if stack.legs_on_board is None:
            placed.append((Phase.SERVE, UnansweredCalls(bus, stack_loco_api(stack), tell)))
        else:
            estimator = nodes.EstimatorNode(bus, *ModuleFactory(stack).make("estimator"))
            placed.append((Phase.ESTIMATE, estimator))
        incoming(bus, endpoints, lambda: self.executor.t, tell)
        jump = partial(self._jump, bus, endpoints)
        endpoints.serve({"/elastic_band/release": self._release, "/lowstate/jump": jump})
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

    def _jump(self, bus: Bus, endpoints: RoleEndpoints, request: Any) -> Trigger_Response:
        state = bus.latest(topics.LOW_STATE)
        if state is None or state.t < JUMP:
            return Trigger_Response(False, "The robot's time has just begun.")
        endpoints.send("/lowstate", replace(state, t=state.t - JUMP))
        return Trigger_Response(True, f"One state was stamped {JUMP:g} s early.")
