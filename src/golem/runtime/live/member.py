"""Membership of a domain as a process of GOLEM, and who else is there."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager

from golem.middleware.dds import discovery
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.dds.participant import CycloneParticipant
from golem.middleware.ros.base import ActionClient, Client, Node
from golem.middleware.ros.future import RosError
from golem.middleware.ros.graph import PARTICIPANT_USER_DATA
from golem.middleware.ros.node import DdsNode

DISCOVERY = 0.3
"""Time that whoever is on the domain already gets to be seen [s]."""
SEARCH = 5.0
"""How long is looked for whoever offers something [s]."""
ANSWER = 30.0
"""How long is waited for an answer of somebody who is there, but may be starting on a busy machine [s]."""


@contextmanager
def member(name: str, dds: DdsConfig) -> Iterator[tuple[CycloneParticipant, DdsNode]]:
    """Join a domain as the process called `name`.

    Raises:
        MissingExtra: cyclonedds is not installed.
        ConfigError, DdsError: the domain cannot be joined.
    """
    with closing(connect(dds, f"{PARTICIPANT_USER_DATA}golem={name};")) as participant:
        with closing(DdsNode(participant, name)) as node:
            yield participant, node


def owner(participant: CycloneParticipant, guid: bytes) -> str:
    """Return who has the endpoint with `guid` (16 bytes), for a person."""
    for found in discovery.members(participant):
        if found.guid[:12] == guid[:12]:
            name = found.user_data.partition("golem=")[2].partition(";")[0]
            process = found.process or guid.hex()
            return f"golem {name}, {process}" if name else process
    return guid.hex()


def until(node: Node, condition: Callable[[], bool], timeout: float) -> bool:
    """Spin `node` until `condition()` is true; return False if `timeout` [s] passed first."""
    end = node.now() + timeout
    while not condition():
        if node.now() > end:
            return False
        node.spin_once(0.02)
    return True


def find(node: Node, name: str, client: Client | ActionClient, remedy: str) -> None:
    """Wait until somebody offers what `client` asks for.

    Raises:
        RosError: nobody offers `name`; `remedy` says what the user can do.
    """
    if not until(node, client.ready, SEARCH):
        raise RosError(f"Nobody offers '{name}'; {remedy}.")


def say(text: str) -> None:
    """Print a line at once, also into a pipe."""
    print(text, flush=True)
