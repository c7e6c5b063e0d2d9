"""The twin as a process: the simulated robot, its sensors and its on-board computer, paced by the wall clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from golem.interfaces import public, topics
from golem.interfaces.unitree_api import LocoApi
from golem.middleware.bus import Bus, News
from golem.middleware.dds.base import Participant, Sample
from golem.middleware.ros.msgs.std_srvs import Trigger_Response
from golem.middleware.ros.node import RosNode
from golem.middleware.ros.waitset import WaitSet
from golem.middleware.wire.api import RpcServer, request_topic, response_topic
from golem.middleware.wire.convert import answered, decode_low_command
from golem.middleware.wire.struct_layout import WireError
from golem.robots.base import HasGantry, Robot
from golem.robots.unitree import loco_service
from golem.runtime import nodes
from golem.runtime.executor import FOREVER, Executor, Node, Phase, Placed, in_order
from golem.runtime.live.bridge import RejectedMessages, incoming, outgoing
from golem.runtime.live.node_setup import log_line
from golem.runtime.live.onboard_bridge import AnswersOut, CallsIn
from golem.runtime.live.render_worker import RenderWorker, image_topics
from golem.runtime.live.robot_out import describe, encoders, images_wanted, lidar_wanted
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.live.sim_sync import LAG, PATIENCE
from golem.runtime.node_groups import ModuleFactory, RobotNodes
from golem.runtime.onboard_nodes import stack_loco_api
from golem.stack import Stack
from golem.types import TICK


class CommandIn(Node):
    """Takes what the motors are told, as the robot does: what is damaged or for another machine is `refused`.

    The robot's time stands still while an active stack is more than `LAG` behind it: see `golem.runtime.live.sim_sync`.
    """

    period = TICK

    def __init__(
        self, bus: Bus, endpoints: RoleEndpoints, tell: Callable[[str], None], patience: float = PATIENCE
    ) -> None:
        """Bring commands to `bus`; `tell` what is refused; wait for one up to `patience` [s] by the wall clock."""
        self._bus, self._patience = bus, patience
        self._t = 0.0
        self._answered = self._given_up = 0.0
        self.refused = RejectedMessages("motor commands", tell)
        self._waitset = WaitSet()
        self._inbox = endpoints.receive("/lowcmd", self._waitset, self._take)

    def step(self, t: float) -> None:
        self._t = t
        self._waitset.poll()
        end = time.monotonic() + self._patience
        while self._late():
            left = end - time.monotonic()
            if left <= 0.0:
                self._given_up = self._answered
                return
            self._waitset.wait(left)
            self._waitset.poll()

    def _late(self) -> bool:
        """Return whether whoever has answered states, and was not given up since, has yet to answer one long past."""
        answered = self._answered
        return answered not in (0.0, self._given_up) and self._t - answered > LAG + TICK / 2.0

    def _take(self, sample: Sample) -> None:
        try:
            command = decode_low_command(sample.payload, self._t)
            self._answered = answered(sample.payload)
        except WireError as error:
            self.refused.add(error)
            return
        self._bus.publish(topics.LOW_CMD, command, self._t)


class UnansweredCalls(Node):
    """Reads the calls to the loco service of a robot that has no such service, and says so at the first."""

    period = TICK

    def __init__(self, bus: Bus, api: LocoApi, tell: Callable[[str], None]) -> None:
        self._news, self._api, self._tell = News(bus, topics.api_request(api.service)), api, tell
        self._reported = False

    def step(self, t: float) -> None:
        call = self._news.read()
        if call is None or self._reported:
            return
        self._reported = True
        self._tell(
            f"A LocoClient calls {self._api.function(call.api_id)} of the service '{self._api.service}'. "
            "Nobody answers it: this robot has no legs on board. "
            "They come with this line in the stack file: lower_body: {use: vendor}."
        )


class Twin:
    """A robot on the domain; `commands` takes the motors' command."""

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
        """Put a robot on the domain. Raises ConfigError, ModuleFault: about the on-board legs.

        Its images are made by `render_worker`; None renders here, which holds everything else up meanwhile. Its time
        stands still for `patience` at most for a stack that is behind [s]. `tell` says a line to a person.
        """
        bus = Bus()
        images = image_topics()
        only = None if render_worker is None else {row.name for row in public.TOPICS} - images
        endpoints = RoleEndpoints("robot", participant, node, only)
        self._robot = robot
        self.commands = CommandIn(bus, endpoints, tell, patience)
        exposed = None if render_worker is not None else lambda camera: partial(images_wanted, endpoints, camera)
        side = RobotNodes(bus, stack, robot, exposed, partial(lidar_wanted, endpoints))
        placed: list[Placed] = [(Phase.RECEIVE, endpoints), (Phase.RECEIVE, self.commands), *side.nodes]
        placed += outgoing(bus, endpoints, encoders(bus))
        for service in (loco_service.SERVICE, stack_loco_api(stack).service):
            requests, responses = request_topic(service), response_topic(service)
            server = RpcServer(endpoints.reader(f"/{requests}"), endpoints.writer(f"/{responses}"))
            placed.append((Phase.RECEIVE, CallsIn(bus, service, server)))
            placed.append((Phase.SEND, AnswersOut(bus, service, server)))
        if render_worker is not None:
            placed.append((Phase.EXPOSE, render_worker))
        if stack.legs_on_board is None:
            placed.append((Phase.SERVE, UnansweredCalls(bus, stack_loco_api(stack), tell)))
        else:
            placed.append((Phase.ESTIMATE, nodes.EstimatorNode(bus, *ModuleFactory(stack).make("estimator"))))
        incoming(bus, endpoints, lambda: self.executor.t, tell)
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
