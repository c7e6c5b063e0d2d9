"""Membership of a domain as a process of GOLEM, and who else is there."""

from __future__ import annotations

import gc
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from queue import SimpleQueue

from golem.middleware.dds import discovery
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.dds.participant import CycloneParticipant
from golem.middleware.ros.action_client import ActionClient
from golem.middleware.ros.callback_guard import log_error
from golem.middleware.ros.future import RosError
from golem.middleware.ros.node import RosNode
from golem.middleware.ros.service import Client
from golem.runtime.live.exclusive_writers import identity

SEARCH = 5.0
"""How long is looked for whoever offers something [s]."""
ANSWER = 30.0
"""How long is waited for an answer of somebody who is there, but may be starting on a busy machine [s]."""


@contextmanager
def member(
    name: str, dds: DdsConfig, log: Callable[[str], None] = log_error
) -> Iterator[tuple[CycloneParticipant, RosNode]]:
    """Join a domain as the process called `name`; what callbacks of its node raise is said by `log`.

    Raises:
        MissingExtra: cyclonedds is not installed.
        ConfigError, DdsError: the domain cannot be joined.
    """
    with closing(connect(dds, identity(name))) as participant:
        with closing(RosNode(participant, name, distro=dds.distro, log=log)) as node:
            yield participant, node


def company(participant: CycloneParticipant, dds: DdsConfig) -> str:
    """Return how many others are on the domain, and where there is nobody, what to look at."""
    others = len(discovery.others(participant))
    if others:
        return "one other is there" if others == 1 else f"{others} others are there"
    if dds.interface == "lo":
        return "nobody else is there"
    return (
        "nobody else is there: look at the cable and the address of the interface, and where multicast does not pass, "
        "name the other machine with --peers ADDRESS"
    )


def until(node: RosNode, condition: Callable[[], bool], timeout: float) -> bool:
    """Spin `node` until `condition()` is true; return False if `timeout` [s] passed first."""
    end = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > end:
            return False
        node.spin_once(0.02)
    return True


def find(node: RosNode, name: str, client: Client | ActionClient, remedy: str) -> None:
    """Wait until somebody offers what `client` asks for. Raises RosError: nobody does; `remedy` says what to do."""
    if not until(node, client.ready, SEARCH):
        raise RosError(f"Nobody offers '{name}'; {remedy}.")


def settle() -> None:
    """Take what lives by now from the garbage collector: going through it, rarely as that is, takes 50 ms and more."""
    gc.collect()
    gc.freeze()


def log_line(text: str) -> None:
    """Print a line at once, also into a pipe, and whole, whichever thread says another."""
    print(f"{text}\n", end="", flush=True)


class AsyncLogger:
    """Says lines on a thread of its own: a terminal that is held up, or gone, does not hold up who has them said."""

    def __init__(self) -> None:
        self._lines: SimpleQueue[str | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._tell, name="teller", daemon=True)
        self._thread.start()

    def __call__(self, text: str) -> None:
        self._lines.put(text)

    def close(self) -> None:
        """Say what is left, unless that takes a second."""
        self._lines.put(None)
        self._thread.join(1.0)

    def _tell(self) -> None:
        while (text := self._lines.get()) is not None:
            with suppress(OSError):
                log_line(text)
