"""Membership of a domain as a process of GOLEM, and who else is there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager

from golem.middleware.dds import discovery
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.dds.participant import CycloneParticipant
from golem.middleware.ros.graph import PARTICIPANT_USER_DATA
from golem.middleware.ros.node import DdsNode

DISCOVERY = 0.3
"""Time that whoever is on the domain already gets to be seen [s]."""


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


def say(text: str) -> None:
    """Print a line at once, also into a pipe."""
    print(text, flush=True)
