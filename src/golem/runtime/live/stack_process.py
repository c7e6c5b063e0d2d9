"""The stack as a process: everything that decides what the robot does, on the robot's own clock.

Each state that arrives makes the clock tick. A slow robot thus slows the stack and not the physics; a robot that was
started anew finds a stack that was built anew.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from golem.errors import ConfigError
from golem.interfaces import public, topics
from golem.middleware.bus import Bus
from golem.middleware.dds.base import Participant, Sample
from golem.middleware.ros.base import RosNode
from golem.middleware.ros.waitset import WaitSet
from golem.middleware.wire import convert
from golem.middleware.wire.api import request_topic, response_topic
from golem.middleware.wire.rpc import RpcClient
from golem.middleware.wire.struct_layout import WireError
from golem.runtime.executor import Executor, Phase, Placed, in_order
from golem.runtime.live import stack_out as out
from golem.runtime.live.clock import RobotClock
from golem.runtime.live.legs_monitor import LegsMonitor
from golem.runtime.live.motor_bridge import RequestOut
from golem.runtime.live.node_setup import log_line
from golem.runtime.live.onboard_bridge import AnswersIn, CallsOut, Identities, LegsIn
from golem.runtime.live.rejected import RejectedMessages
from golem.runtime.live.robot_out import ClockOut, FramesOut, JointsOut, describe
from golem.runtime.live.role_endpoints import Poll, RoleEndpoints
from golem.runtime.live.sim_sync import CATCH_UP, SILENCE
from golem.runtime.live.skill_action_server import SkillActionServer
from golem.runtime.live.stack_in import CameraIn, GateIn, RemoteGantry, listen
from golem.runtime.node_groups import StackNodes
from golem.stack import Stack
from golem.types import SIDES, Array

SHOWN = ("/clock", "/joint_states", "/tf", "/tf_static", "/robot_description")
"""What of the robot's surface follows from its state, and is not the vendor's to publish."""


class StackProcess:
    """A stack on the domain, without its loop.

    Attributes:
        states: what to wait on between two steps.
        side: the stack, once a robot has reported.
        restarts: how often the robot was started anew since.
        refused: states that were damaged.
    """

    def __init__(
        self,
        stack: Stack,
        participant: Participant,
        node: RosNode,
        *,
        real: bool = False,
        pool: ThreadPoolExecutor | None = None,
        clock: Callable[[], float] = time.monotonic,
        tell: Callable[[str], None] = log_line,
    ) -> None:
        """Join the domain; the modules are built when the robot reports.

        Args:
            stack: which modules.
            participant: member of the domain.
            node: its ROS node.
            real: whether the robot is none of ours. Nobody then calls to let a band go, the wall clock holds leg
                controllers to their period, and joints and frames are shown by this process, since none of the
                robot's does.
            pool: where the localizer runs; see `LocalizerNode`.
            clock: this process's own [s].
            tell: says a line to a person; beside a real robot one that is never held up.

        Raises:
            ConfigError: the legs of a real robot would be its own controller's, which commands the motors itself.
        """
        if real and stack.legs_on_board is not None:
            raise ConfigError(
                "With lower_body 'vendor' the real robot moves its legs itself, and nobody else may command its motors "
                "meanwhile: run it on a twin, or choose another lower_body."
            )
        self._stack, self._node, self._real, self._tell = stack, node, real, tell
        self._bus = Bus()
        self._clock = clock
        self._heard = clock()
        self._calibration: dict[str, Array] = {name: np.eye(4) for name in public.CAMERAS}
        self._endpoints = endpoints = RoleEndpoints("stack", participant, node)
        self.side: StackNodes | None = None
        self.restarts, self.refused = 0, RejectedMessages("states of the robot", tell)
        self._executor: Executor | None = None
        self._mode_machine = 0
        self._pool = pool
        self._gantry = RemoteGantry(node) if stack.on_ground and not real else None
        self._gate = GateIn(self._bus, endpoints, clock)
        self._cameras = [CameraIn(self._bus, endpoints, name) for name in public.CAMERAS]
        service = stack.loco_api.service
        requests, responses = request_topic(service), response_topic(service)
        self._calls = RpcClient(endpoints.writer(f"/{requests}"), endpoints.reader(f"/{responses}"))
        self._onboard = endpoints.reader("/onboard/lowcmd")
        self._skills = SkillActionServer(endpoints)
        endpoints.serve({k: v for s in SIDES for k, v in out.hand_services(self._bus, s, self._now).items()})
        listen(self._bus, endpoints, self._calibration, self._now, self._skills.busy)
        self._drivers = RoleEndpoints("robot", participant, node, only=SHOWN) if real else None
        if self._drivers is not None:
            describe(self._drivers, {})
        self.states = WaitSet()
        self._robot = RobotClock(clock, endpoints.receive("/lowstate", self.states, self._state).writers)

    def step(self) -> None:
        """Take the states that have come, and tick for each of them; where none did, answer whoever asks."""
        before = self._robot.t
        self.states.poll()
        if self._robot.t == before:
            self._node.poll()
        self._skills.hear(silent=self._clock() - self._heard > SILENCE)

    def _now(self) -> float:
        return max(self._robot.t, 0.0)

    def _state(self, sample: Sample) -> None:
        try:
            state = convert.decode_low_state(sample.payload)
        except WireError as error:
            self.refused.add(error)
            return
        if not self._robot.advances(state.t, sample.writer):
            return
        self._mode_machine = convert.mode_machine(sample.payload)
        if self._robot.anew or self._executor is None:
            self.restarts += self._robot.anew
            self._executor = self._build(state.t)
        self._bus.publish(topics.LOW_STATE, state, state.t)
        self._executor.advance(state.t, CATCH_UP)
        self._heard = self._clock()

    def _build(self, t: float) -> Executor:
        """Build every module anew, for a robot whose time begins anew at `t` [s]."""
        bus, endpoints = self._bus, self._endpoints
        bus.clear()
        for camera in self._cameras:
            camera.close()
        if self._gantry is not None:
            self._gantry.renew()
        side = self.side = StackNodes(
            bus, self._stack, self._calibration, self._gantry, 0.0, self._pool, self._real
        )
        side.legs.realtime = self._real
        self._skills.attach(side, t)
        service, identities = self._stack.loco_api.service, Identities()
        placed: list[Placed] = [
            (Phase.RECEIVE, Poll(self._node)),
            (Phase.RECEIVE, self._gate),
            (Phase.RECEIVE, AnswersIn(bus, service, self._calls, identities)),
            (Phase.RECEIVE, LegsIn(bus, self._onboard, self._tell)),
            *side.nodes,
            # Before anything else is sent: it is what the robot waits for.
            (Phase.PROTECT, RequestOut(bus, endpoints, lambda: self._mode_machine)),
            (Phase.SEND, out.BaseOut(bus, endpoints)),
            (Phase.SEND, out.OdometryOut(bus, endpoints)),
            (Phase.SEND, out.LegsOut(bus, endpoints)),
            (Phase.SEND, CallsOut(bus, service, self._calls, identities)),
            (Phase.SEND, self._skills),
            (Phase.SEND, LegsMonitor(bus, self._tell)),
            *((Phase.SEND, camera) for camera in self._cameras),
            *((Phase.SEND, out.SightingsOut(bus, endpoints, name)) for name in public.CAMERAS),
            *((Phase.SEND, out.HandCommandOut(bus, endpoints, hand)) for hand in SIDES),
            *((Phase.SEND, out.HandStatusOut(bus, endpoints, hand)) for hand in SIDES),
        ]
        if self._drivers is not None:
            placed.append((Phase.SEND, ClockOut(self._drivers)))
            placed.append((Phase.SEND, JointsOut(bus, self._drivers)))
            placed.append((Phase.SEND, FramesOut(bus, self._drivers)))
        return Executor(bus, in_order(placed), t)
