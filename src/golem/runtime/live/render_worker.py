"""Images of the twin, made in a process of their own: rendering one takes longer than a whole lot of ticks.

The twin hands over snapshots; a second robot that was built alike is put into each moment and photographed there, and
its images go to the domain from that process. One exposure at a time: where rendering is slow, there are fewer.
"""

from __future__ import annotations

import math
import multiprocessing
import signal
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import closing
from multiprocessing.connection import Connection

from golem.errors import GolemError
from golem.interfaces import public, topics
from golem.interfaces.payloads import Exposure
from golem.middleware.bus import Bus
from golem.middleware.dds.domain import DdsConfig
from golem.robots.base import Restorable
from golem.runtime.executor import Node, Placed
from golem.runtime.live.bridge import outgoing
from golem.runtime.live.node_setup import member
from golem.runtime.live.robot_out import images_wanted
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.live.sim_sync import PATIENCE
from golem.runtime.lockstep import build_robot
from golem.stack import Stack
from golem.types import TICK

GRACE = 3.0
"""Time the process gets to end by itself [s]."""


def image_topics() -> set[str]:
    """Return the names of all images' topics."""
    return {public.image(camera, what) for camera in public.CAMERAS for what in public.IMAGES}


class RenderWorker(Node):
    """The twin's end: hands a snapshot over when a camera is due and the darkroom free.

    Once an exposure takes longer than its camera has until the next, the robot's time waits: see `live.sim_sync`.
    """

    period = TICK

    def __init__(self, stack: Stack, seed: int, robot: Restorable, dds: DdsConfig) -> None:
        """Start the process, for the robot of `stack`; its images go to the domain of `dds`."""
        self._robot = robot
        self._periods = {name: 1.0 / info.rate for name, info in robot.cameras.items()}
        self._due = dict.fromkeys(self._periods, 0.0)
        self._waiting: deque[str] = deque()
        # Not forked: the transport's threads would be missing in the child.
        context = multiprocessing.get_context("spawn")
        self._link, theirs = context.Pipe()
        self._process = context.Process(target=_work, args=(stack, seed, dds, theirs), daemon=True)
        self._process.start()
        theirs.close()
        self._free, self._deadline = False, math.inf

    def step(self, t: float) -> None:
        """Hand over what is due. Raises GolemError: the process has died."""
        for name, due in self._due.items():
            if t >= due - 1e-9:
                self._due[name] = due + self._periods[name]
                if name not in self._waiting:
                    self._waiting.append(name)
        try:
            late = t > self._deadline
            if self._link.poll(PATIENCE if late else 0.0):
                self._link.recv_bytes()
                self._free, self._deadline = True, math.inf
            elif late:
                self._deadline = math.inf
            if self._free and self._waiting:
                name = self._waiting.popleft()
                self._free, self._deadline = False, t + self._periods[name]
                self._link.send((name, t, self._robot.save_state()))
        except (EOFError, OSError) as error:
            code = self._process.exitcode
            raise GolemError(f"The process that renders the cameras has died (exit code {code}).") from error

    def wait(self, stop: Callable[[], bool]) -> None:
        """Wait until the process is ready, or `stop()`: building its world takes seconds that no image shall take."""
        while not (self._link.poll(0.1) or stop()) and self._process.is_alive():
            continue

    def close(self) -> None:
        """End the process; calling it again does nothing."""
        self._link.close()
        self._process.join(GRACE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def _work(stack: Stack, seed: int, dds: DdsConfig, link: Connection) -> None:
    # Ctrl-C is for the twin, which then hangs up.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    with member("cameras", dds) as (participant, node), closing(build_robot(stack, seed)) as robot:
        bus = Bus()
        endpoints = RoleEndpoints("robot", participant, node, image_topics())
        streams = outgoing(bus, endpoints)
        for name in robot.cameras:
            robot.capture(name)  # the first image takes a second
        try:
            while True:
                link.send_bytes(b"free")
                expose(robot, endpoints, bus, streams, *link.recv())
        except (EOFError, OSError):
            return


def expose(
    robot: Restorable,
    endpoints: RoleEndpoints,
    bus: Bus,
    streams: Iterable[Placed],
    name: str,
    t: float,
    save_state: bytes,
) -> None:
    """Send the images of one moment, `save_state` at `t` [s], if anybody wants them; `robot` is one that recalls."""
    if images_wanted(endpoints, name):
        robot.restore_state(save_state)
        rgb, depth = robot.capture(name)
        bus.publish(topics.exposures(name), Exposure(t, robot.cameras[name], rgb, depth), t)
        for _, stream in streams:
            stream.step(t)
