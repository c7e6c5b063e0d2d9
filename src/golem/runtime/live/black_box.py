"""The black box of the safety process: what it heard and said before and after each stop, as a bag.

The frames are kept as they came, so that what the gate refused to read is in it, too. A stop within the time after
another belongs to the same bag.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

from golem.errors import GolemError
from golem.interfaces import public
from golem.interfaces.payloads import GateStatus
from golem.interfaces.ros_convert import gate_status
from golem.middleware.bags.base import BagMessage
from golem.middleware.bags.recorder import topic
from golem.middleware.bags.writer import BagWriter
from golem.middleware.dds.base import Payload
from golem.middleware.ros import codec
from golem.middleware.ros.message import NANO

BEFORE, AFTER = 5.0, 2.0
"""Time before a stop, and after it, that is kept [s]."""
STATUS = "/safety/status"
RECORDED = ("/lowstate", "/safety/lowcmd_in", "/lowcmd", STATUS)
"""What is kept."""

Write = Callable[[Callable[[], None]], None]


def beside(write: Callable[[], None]) -> None:
    """Run `write` on a thread of its own: the gate must not wait for a disk."""
    threading.Thread(target=write, name="black box").start()


class BlackBox:
    """Keeps the frames of the last seconds, and writes a folder once a stop is long enough ago; see `written`."""

    def __init__(self, folder: Path, tell: Callable[[str], None], run: Write = beside) -> None:
        """Write bags into `folder`, and `tell` where each is; `run` runs what writes one."""
        self._folder, self._tell, self._run = folder, tell, run
        self._topics = {name: topic(name, public.topic(name).type, public.topic(name).qos) for name in RECORDED}
        self._frames: deque[tuple[float, str, Payload]] = deque()
        self._stop: tuple[float, GateStatus] | None = None
        self.written: list[Path] = []

    def add(self, name: str, payload: Payload, now: float) -> None:
        """Keep a frame of topic `name` that came or went at `now` [s]."""
        self._frames.append((now, name, payload))

    def judge(self, before: GateStatus, status: GateStatus) -> None:
        """Keep a verdict, forget what is too old, and write when it is time."""
        now, frames = status.t, self._frames
        if (before.state, before.reason) != (status.state, status.reason):
            self.add(STATUS, codec.serialize(gate_status(status)), now)
            if status.stopped and not before.stopped and self._stop is None:
                self._stop = (now, status)
        if self._stop is None:
            while frames and frames[0][0] < now - BEFORE:
                frames.popleft()
        elif now - self._stop[0] >= AFTER:
            self.flush()

    def flush(self) -> None:
        """Write what is kept if there was a stop, as at the end of the process."""
        if self._stop is None:
            return
        (_, status), frames = self._stop, list(self._frames)
        self._stop = None
        self._run(lambda: self._write(frames, status))

    def _write(self, frames: list[tuple[float, str, Payload]], status: GateStatus) -> None:
        name = f"{time.strftime('%Y_%m_%d-%H_%M_%S')}_{status.reason or status.state}"
        folder = self._folder / name
        for number in range(2, 1000):
            if not folder.exists():
                break
            folder = self._folder / f"{name}_{number}"
        try:
            bag = BagWriter(folder, custom={"stop": status.why})
            for at, topic_name, payload in frames:
                stamp = round(at * NANO)
                bag.write(BagMessage(self._topics[topic_name], stamp, stamp, payload))
            bag.close()
        except GolemError as error:
            self._tell(f"The black box of this stop was not written: {error}")
            return
        self.written.append(folder)
        self._tell(f"Black box of the stop ({status.why}): {folder}; golem black-box {folder} shows it.")
