"""The stack as a process: everything that decides what the robot does, on the robot's own clock.

Each state that arrives makes the clock tick. A slow robot thus slows the stack and not the physics; a robot that was
restarted finds a stack that was built anew.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from golem.capabilities.legs.locomotion import LocomotionConfig
from golem.errors import ConfigError
from golem.interfaces import public, topics
from golem.middleware.bus import Bus
from golem.middleware.dds.base import Participant, Sample
from golem.middleware.ros.msgs.std_srvs import Trigger_Response
from golem.middleware.ros.node import RosNode
from golem.middleware.ros.waitset import WaitSet
from golem.middleware.wire import convert
from golem.middleware.wire.api import RpcClient, request_topic, response_topic
from golem.middleware.wire.struct_layout import WireError
from golem.robots.sensors.calibration import calibrations
from golem.runtime.executor import Executor, Node, Phase, Placed, in_order
from golem.runtime.live import stack_streams as out
from golem.runtime.live.bridge import RejectedMessages, incoming, outgoing
from golem.runtime.live.clock import RobotClock
from golem.runtime.live.nav2_bridge import Nav2Bridge
from golem.runtime.live.node_setup import log_line
from golem.runtime.live.onboard_bridge import AnswersIn, CallsOut, Identities
from golem.runtime.live.robot_out import describe, encoders
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.live.sim_sync import CATCH_UP, SILENCE
from golem.runtime.live.skill_action_server import SkillActionServer
from golem.runtime.live.skill_messages import list_message
from golem.runtime.live.stack_streams import ArmSdk, CameraIn, GateIn, OnePerTick, RemoteGantry
from golem.runtime.node_groups import StackNodes, hears_lidar
from golem.runtime.nodes import moving
from golem.runtime.onboard_nodes import stack_loco_api
from golem.runtime.skill_table import SkillTable
from golem.stack import Stack
from golem.types import SIDES, Array, Twist

_LEGS = LocomotionConfig()
LET_GO = 2.0 * _LEGS.timeout
"""Silence after which a velocity is of a new intention [s]: twice the longest time in which one has to be repeated."""
STILL = _LEGS.dead_band
"""Size of (vx, vy, wz) below which nobody is asked to move [m/s, rad/s]: sticks are never quite at rest."""


class Velocities:
    """Passes velocities on, unless whoever sends them began while the robot was not to be driven.

    A joystick that is held while the robot is stopped, or a planner that runs on, would else set it in motion the
    moment it is released. They have to let go first: send less than `STILL`, or nothing for `LET_GO`. Who sends is not
    told apart: where two do, one of them lets go for both.
    """

    def __init__(self, bus: Bus, now: Callable[[], float], closed: Callable[[], bool]) -> None:
        """Publish on `bus`, at time `now()` [s], what comes while not `closed()`."""
        self._bus, self._now, self._closed = bus, now, closed
        self._heard = -LET_GO
        self._held = False
        self._twist = Twist()

    def rise(self, command: Twist) -> None:
        """Pass the height of `command` on, with the velocity that came last if it still counts; or not."""
        if not self._closed():
            t = self._now()
            twist = self._twist if 0.0 <= t - self._heard <= _LEGS.timeout and not self._held else Twist()
            self._twist = replace(twist, height=command.height)
            self._bus.publish(topics.TWIST, self._twist, t)

    def take(self, twist: Twist) -> None:
        """Pass `twist` on, at the height that was told last, or not."""
        t, still = self._now(), math.hypot(twist.vx, twist.vy, twist.wz) < STILL  # false for nan
        # A robot that was restarted begins its time anew.
        if still or not 0.0 <= t - self._heard <= LET_GO:
            self._held = False
        self._heard = t
        closed = self._closed()
        self._held |= closed and not still
        self._twist = replace(twist, height=None if closed else self._twist.height)
        if not (closed or self._held):
            self._bus.publish(topics.TWIST, self._twist, t)


BLIND = 3.0
"""Time from the gate's activation on after which an estimator that has found no floor is worth a word [s]: one that
loses it is stopped, one that never had it is not, since a robot that hangs has its feet in the air."""


class LegsMonitor(Node):
    """Tells of the fallback that took the legs, and of legs without a base estimate."""

    period = 0.1

    def __init__(self, bus: Bus, tell: Callable[[str], None]) -> None:
        self._bus, self._tell = bus, tell
        self._fault: str | None = None
        self._blind_since: float | None = None

    def step(self, t: float) -> None:
        legs = self._bus.latest(topics.LEG_STATUS)
        if legs is not None and legs.fault is not None and legs.fault != self._fault:
            self._fault = legs.fault
            self._tell(f"{legs.fault}. '{legs.controller}' has the legs now, and stands until a new twist comes.")
        base = self._bus.latest(topics.BASE)
        if not moving(self._bus):
            self._blind_since = t
        elif base is not None and not base.stale:
            self._blind_since = None
        if self._blind_since is not None and t - self._blind_since > BLIND:
            self._blind_since = None
            self._tell(
                "The estimator has found no foot on the floor since the gate was activated: do not put the robot's "
                "weight on its feet."
            )


IMU_BACKLOG = 40
"""Samples of the LiDAR's IMU that may wait for their ticks: 0.2 s."""
SHOWN = ("/clock", "/joint_states", "/tf", "/tf_static", "/robot_description")
"""What of the robot's surface follows from its state, and is not the vendor's to publish."""


class StackProcess:
    """A stack on the domain, without its loop.

    Attributes:
        states: what to wait on between two steps.
        side: the stack, once a robot has reported.
        restarts: how often the robot was restarted since.
        refused: states that were damaged.
    """

    def __init__(
        self,
        stack: Stack,
        participant: Participant,
        node: RosNode,
        *,
        real: bool = False,
        pools: Mapping[str, ThreadPoolExecutor] | None = None,
        clock: Callable[[], float] = time.monotonic,
        tell: Callable[[str], None] = log_line,
        who: Callable[[bytes], str] = bytes.hex,
    ) -> None:
        """Join the domain; the modules are built when the robot reports.

        Args:
            real: whether the robot is none of ours. Nobody then calls to let a band go, the wall clock holds leg
                controllers to their period, and joints and frames are shown by this process, since none of the
                robot's does.
            pools: where modules run beside the clock; see `StackNodes`.
            clock: this process's own [s].
            tell: says a line to a person; beside a real robot one that is never held up.
            who: names the process of an endpoint by the first 12 bytes of its guid.

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
        self._calibrated = stack.part("calibration").load()
        self._calibration: dict[str, Array] = {name: np.eye(4) for name in public.CAMERAS}
        self._endpoints = endpoints = RoleEndpoints("stack", participant, node)
        self.side: StackNodes | None = None
        self.restarts, self.refused = 0, RejectedMessages("states of the robot", tell)
        self._executor: Executor | None = None
        self._bridge: Nav2Bridge | None = None
        self._mode_machine = 0
        self._pools = pools
        self._gantry = RemoteGantry(node) if stack.on_ground and not real else None
        self._gate = GateIn(self._bus, clock)
        self._cameras = [CameraIn(self._bus, endpoints, name) for name in public.CAMERAS]
        self._service = stack_loco_api(stack).service
        requests, responses = request_topic(self._service), response_topic(self._service)
        self._calls = RpcClient(endpoints.writer(f"/{requests}"), endpoints.reader(f"/{responses}"))
        self._skills = SkillActionServer(endpoints, tell, who)
        endpoints.publish("/skill/list", list_message(SkillTable(stack).specs.values()))
        services = {k: v for s in SIDES for k, v in out.hand_services(self._bus, s, self._now).items()}
        endpoints.serve({**services, "/skill/take_over": lambda _: self._take_over()})
        unheard = () if hears_lidar(stack) else public.LIDAR

        def closed() -> bool:
            return self._skills.busy() or not moving(self._bus)

        velocities, self._arms = Velocities(self._bus, self._now, closed), ArmSdk(self._bus, closed, tell)
        self._lidar_imu = OnePerTick(self._bus, topics.LIDAR_IMU, IMU_BACKLOG)
        takers = {"/cmd_vel": velocities.take, "/wirelesscontroller": velocities.take, "/cmd_height": velocities.rise}
        takers |= {"/safety/status": self._gate.take, "/livox/imu": self._lidar_imu.take}
        incoming(self._bus, endpoints, self._now, tell, takers, without=("/lowstate", *unheard))
        endpoints.subscribe("/tf_static", lambda message: self._calibration.update(calibrations(message)))
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

    def _take_over(self) -> Trigger_Response:
        name = self._skills.take_over()
        return Trigger_Response(True, f"The lease for skills was that of {name or 'nobody'}.")

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
        if self._robot.restarted or self._executor is None:
            self.restarts += self._robot.restarted
            self._executor = self._build(state.t)
        state = replace(state, q=state.q - self._calibrated.joint_offset)
        self._bus.publish(topics.LOW_STATE, state, state.t)
        self._executor.advance(state.t, CATCH_UP)
        self._heard = self._clock()

    def _nav2(self, bus: Bus) -> list[Placed]:
        """Return what speaks to Nav2, where the navigator leaves the way to it."""
        if self._stack.choice("navigator").use != "nav2":
            return []
        if self._bridge is None:
            self._bridge = Nav2Bridge(bus, self._node, self._now)
        return [(Phase.RECEIVE, self._bridge)]

    def _build(self, t: float) -> Executor:
        """Build every module anew, for a robot whose time begins anew at `t` [s]."""
        bus, endpoints = self._bus, self._endpoints
        bus.clear()
        for camera in self._cameras:
            camera.close()
        if self._gantry is not None:
            self._gantry.renew()
        if self.side is not None:
            self.side.memory.close()
        epoch = time.time() - t
        known, mount = self._calibrated.merged(self._calibration), self._calibrated.mount
        side = StackNodes(bus, self._stack, known, mount, self._gantry, 0.0, self._pools, self._real, epoch)
        self.side = side
        side.legs.realtime, side.running.live = self._real, True
        self._skills.attach(side)
        service, identities = self._service, Identities()
        placed: list[Placed] = [
            (Phase.RECEIVE, endpoints),
            (Phase.RECEIVE, self._gate),
            (Phase.RECEIVE, self._lidar_imu),
            (Phase.RECEIVE, AnswersIn(bus, service, self._calls, identities)),
            *self._nav2(bus),
            *side.nodes,
            *outgoing(
                bus, endpoints, out.encoders(bus, lambda: self._mode_machine, self._calibrated.joint_offset, self._arms)
            ),
            (Phase.SEND, CallsOut(bus, service, self._calls, identities)),
            (Phase.SEND, self._skills),
            (Phase.SEND, LegsMonitor(bus, self._tell)),
            *((Phase.SEND, camera) for camera in self._cameras),
        ]
        if self._drivers is not None:
            placed += outgoing(bus, self._drivers, encoders(bus))
        return Executor(bus, in_order(placed), t)
