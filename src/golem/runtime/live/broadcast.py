"""Shows a stack in lock-step as its processes would on a domain: to a bag or to viewers, without DDS.

The nodes are those of the processes; their domain is inside this one, and its time is the robot's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

from golem.interfaces import topics
from golem.interfaces.public import Role
from golem.interfaces.recorded import public_topics
from golem.middleware.bags.base import Sink
from golem.middleware.bags.recorder import PERIOD, Recorder
from golem.middleware.bus import Bus, News
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.node import DdsNode
from golem.middleware.wire.convert import MODE_MACHINE, encode_low_command
from golem.robots.base import Robot
from golem.runtime.executor import Executor, Node
from golem.runtime.live import robot_out, stack_out
from golem.runtime.live.motor_bridge import RequestOut, StateOut
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.live.safety_process import REPORT
from golem.runtime.live.safety_status import status_message
from golem.runtime.lockstep import LockstepRunner
from golem.types import SIDES, TICK


class CommandOut:
    """Sends what the gate tells the motors."""

    period = TICK

    def __init__(self, bus: Bus, endpoints: RoleEndpoints) -> None:
        """Send what is on `bus`."""
        self._commands, self._writer = News(bus, topics.LOW_CMD), endpoints.writer("/lowcmd")

    def step(self, t: float) -> None:
        """Send a new command."""
        command = self._commands.read()
        if command is not None:
            self._writer.write(encode_low_command(command, MODE_MACHINE))


class StatusOut:
    """Sends the verdicts of the gate: at every change, and regularly."""

    period = TICK

    def __init__(self, bus: Bus, endpoints: RoleEndpoints) -> None:
        """Publish on `surface` what is on `bus`."""
        self._bus, self._endpoints = bus, endpoints
        self._said: tuple[object, ...] = ()
        self._due = 0.0

    def step(self, t: float) -> None:
        """Send the verdict if it changed, or was not sent for long."""
        status = self._bus.latest(topics.SAFETY)
        if status is None:
            return
        says = (status.state, status.reason, status.detail)
        if says != self._said or t >= self._due:
            self._said, self._due = says, t + REPORT
            self._endpoints.publish("/safety/status", status_message(status))


class Broadcast:
    """Passes what is public of a running stack to a sink; to be called after every tick."""

    def __init__(
        self, running: LockstepRunner, robot: Robot, sink: Sink, choose: Callable[[Recorder], None]
    ) -> None:
        """Show `running`, whose robot is `robot`, to `sink`; `choose` is asked time and again for which topics."""
        self._executor, self._choose = running.executor, choose
        domain = LocalDomain(clock=self._time)
        self._recorder = Recorder(domain.participant(), sink, wall=self._time)
        self._choose(self._recorder)
        self._polled = 0.0
        # A bus of its own: what is due on the stack's is its executor's business.
        self._follower = Executor(Bus(), _nodes(running.bus, robot, domain))

    def __call__(self) -> None:
        """Show what the tick brought that has just passed."""
        if self._executor.t < TICK:
            return  # none has
        t = self._time()
        self._follower.advance(t, maximum=1)
        if t >= self._polled + PERIOD:
            self._polled = t
            self._choose(self._recorder)
            self._recorder.poll()

    def close(self) -> None:
        """Show the last tick, too; the sink stays open."""
        self()
        self._recorder.poll(last=True)
        self._recorder.close()

    def _time(self) -> float:
        return max(0.0, self._executor.t - TICK)


def _nodes(bus: Bus, robot: Robot, domain: LocalDomain) -> list[Node]:
    """Return what makes the robot, its gate and its stack public."""

    def endpoints(role: Role) -> RoleEndpoints:
        participant = domain.participant()
        return RoleEndpoints(role, participant, DdsNode(participant, role))

    body, safety, stack = endpoints("robot"), endpoints("safety"), endpoints("stack")
    robot_out.describe(body, robot.calibration)
    return [
        robot_out.ClockOut(body),
        StateOut(bus, body),
        robot_out.JointsOut(bus, body),
        robot_out.FramesOut(bus, body),
        *(robot_out.CameraOut(bus, body, name) for name in robot.cameras),
        *(robot_out.HandOut(bus, body, side) for side in SIDES),
        stack_out.BaseOut(bus, stack),
        stack_out.OdometryOut(bus, stack),
        stack_out.LegsOut(bus, stack),
        *(stack_out.SightingsOut(bus, stack, name) for name in robot.cameras),
        *(stack_out.HandCommandOut(bus, stack, side) for side in SIDES),
        *(stack_out.HandStatusOut(bus, stack, side) for side in SIDES),
        RequestOut(bus, stack, lambda: MODE_MACHINE),
        CommandOut(bus, safety),
        StatusOut(bus, safety),
    ]


@contextmanager
def broadcast(
    running: LockstepRunner, robot: Robot, bag: Path | None = None, foxglove: int | None = None
) -> Iterator[Callable[[], None]]:
    """Yield what is to be called after every tick, so that a stack in lock-step is recorded and shown.

    Args:
        running: the stack.
        robot: its robot.
        bag: folder of the bag to write, if any.
        foxglove: port on which to serve Foxglove's protocol, if at all.

    Raises:
        MissingExtra: the extra `record` or `foxglove` is not installed.
        OutputError: the bag cannot be written.
        ConfigError: the port is taken.
    """
    with ExitStack() as stack:
        casts: list[Broadcast] = []

        def add(sink: Sink, choose: Callable[[Recorder], None]) -> None:
            casts.append(Broadcast(running, robot, sink, choose))
            stack.callback(casts[-1].close)

        if bag is not None:
            from golem.middleware.bags.writer import BagWriter

            every = public_topics()
            add(stack.enter_context(closing(BagWriter(bag))), lambda recorder: recorder.add(every))
        if foxglove is not None:
            from golem.middleware.bags.foxglove_server import FoxgloveServer, ServerConfig

            offered = public_topics()
            server = stack.enter_context(closing(FoxgloveServer(ServerConfig(port=foxglove))))
            print(f"Foxglove: {server.url}", flush=True)
            add(server, lambda recorder: server.choose(recorder, offered))

        def every_tick() -> None:
            for cast in casts:
                cast()

        yield every_tick
