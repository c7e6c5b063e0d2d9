"""Shows a stack in lock-step as its processes would on a domain: to a bag or to viewers, without DDS.

The nodes are those of the processes; their domain is inside this one, and its time is the robot's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from pathlib import Path

from golem.interfaces import topics
from golem.interfaces.recorded import public_topics
from golem.interfaces.rows import Role
from golem.middleware.bags.base import Sink
from golem.middleware.bags.recorder import PERIOD, Recorder
from golem.middleware.bus import Bus, News
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.node import RosNode
from golem.middleware.wire.convert import MODE_MACHINE, encode_low_command
from golem.robots.base import Robot
from golem.runtime.executor import Executor, Node, Phase
from golem.runtime.live import robot_out, stack_streams
from golem.runtime.live.bridge import outgoing
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.live.safety_status import StatusReports
from golem.runtime.lockstep import LockstepRunner
from golem.types import TICK


class StatusOut(Node):
    """Sends the verdicts of the gate: at every change, and regularly."""

    period = TICK

    def __init__(self, bus: Bus, endpoints: RoleEndpoints) -> None:
        self._news, self._reports = News(bus, topics.SAFETY), StatusReports(endpoints)

    def step(self, t: float) -> None:
        status = self._news.read()
        if status is not None:
            self._reports.add(status)


class Broadcast:
    """Passes what is public of a running stack to a sink; to be called after every tick."""

    def __init__(self, running: LockstepRunner, robot: Robot, sink: Sink, choose: Callable[[Recorder], None]) -> None:
        """Show `running`, whose robot is `robot`, to `sink`; `choose` is asked time and again for which topics."""
        self._executor, self._choose = running.executor, choose
        domain = LocalDomain(clock=self._time)
        self._recorder = Recorder(domain.participant(), sink, wall=self._time)
        self._choose(self._recorder)
        self._polled = 0.0
        # A bus of its own: what is due on the stack's is its executor's business.
        self._follower = Executor(Bus(), _nodes(running.bus, robot, domain))

    def __call__(self) -> None:
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
    def endpoints(role: Role) -> RoleEndpoints:
        participant = domain.participant()
        return RoleEndpoints(role, participant, RosNode(participant, role))

    body, safety, stack = endpoints("robot"), endpoints("safety"), endpoints("stack")
    robot_out.describe(body, robot.calibration)
    command = partial(encode_low_command, mode_machine=MODE_MACHINE)
    placed = [
        *outgoing(bus, body, robot_out.encoders(bus)),
        *outgoing(bus, safety, {"/lowcmd": command}, without=("/safety/status",)),
        *outgoing(bus, stack, stack_streams.encoders(bus, lambda: MODE_MACHINE)),
        (Phase.SEND, StatusOut(bus, safety)),
    ]
    return [node for _, node in placed]


@contextmanager
def broadcast(
    running: LockstepRunner, robot: Robot, bag: Path | None = None, foxglove: int | None = None
) -> Iterator[Callable[[], None]]:
    """Yield what is to be called after every tick: it records a stack in lock-step to `bag`, and shows it on a port.

    Raises MissingExtra: the extra `record` or `foxglove` is not installed; OutputError: the bag cannot be written;
    ConfigError: the port is taken.
    """
    with ExitStack() as stack:
        casts: list[Broadcast] = []

        def add(sink: Sink, choose: Callable[[Recorder], None]) -> None:
            casts.append(Broadcast(running, robot, sink, choose))
            stack.callback(casts[-1].close)

        if bag is not None:
            from golem.middleware.bags.writer import BagWriter

            every, writer = public_topics(), BagWriter(bag)
            stack.callback(lambda: print(f"{writer}.", flush=True))
            add(stack.enter_context(closing(writer)), lambda recorder: recorder.add(every))
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
