"""What there is one of on a domain, and who has what there."""

from __future__ import annotations

import time
from collections.abc import Iterable

from golem.errors import ConfigError
from golem.middleware.dds import discovery
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.dds.participant import CycloneParticipant
from golem.middleware.ros import names
from golem.middleware.ros.node_endpoints import PARTICIPANT_USER_DATA

DISCOVERY = 0.3
"""Time that whoever is on the domain already gets to be seen [s]."""
SOLE = {"/lowstate": "a robot", "/clock": "a clock", "/lowcmd": "a safety gate", "/safety/lowcmd_in": "a stack"}
"""Topics that one process alone may write, and what that process is."""
ANYBODYS = ("/lowstate", "/clock")
"""Those of them that others' programs may write, too."""
LAUNCH = "launch"
"""Name of the process that starts, and restarts, the others."""


def identity(name: str) -> str:
    """Return the user data of the participant of GOLEM's process called `name`, for ROS and for `owner`."""
    return f"{PARTICIPANT_USER_DATA}golem={name};"


def owner(participant: CycloneParticipant, guid: bytes) -> str:
    """Return who has the endpoint with `guid` (16 bytes), for a person; one of ours begins with "golem"."""
    for found in discovery.members(participant):
        if found.guid[:12] == guid[:12]:
            name, process = _name(found), found.process or guid.hex()
            return f"golem {name}, {process}" if name else process
    return guid.hex()


def launcher(participant: CycloneParticipant) -> str:
    """Return which process launched, or is launching, a robot on the domain; empty where none did."""
    found = next((m for m in discovery.others(participant) if _name(m) == LAUNCH), None)
    return "" if found is None else f"golem {LAUNCH}, {found.process or found.guid.hex()}"


def refuse_second(participant: CycloneParticipant, dds: DdsConfig, *topics: str) -> None:
    """Take `DISCOVERY` to look whether anybody writes one of `topics`, of `SOLE`, before a second one does.

    For a robot in motion a second writer is a reason to stop, and so to fall. A robot, and a clock, may be anybody's;
    of gates and stacks only ours count, since a robot's own controller may have a writer of the motors' command, which
    it does not use: what to make of that is the gate's business. Raises ConfigError: somebody does.
    """
    time.sleep(DISCOVERY)
    _refuse_writers(participant, dds, topics)


def refuse_second_launch(participant: CycloneParticipant, dds: DdsConfig) -> None:
    """Look, for `DISCOVERY`, whether a robot, its gate or its stack is on the domain. Raises ConfigError: one is."""
    time.sleep(DISCOVERY)
    first = launcher(participant)
    if first:
        raise ConfigError(f"There is a launched robot on {dds} already: {first}; end it, or choose another domain.")
    _refuse_writers(participant, dds, SOLE)


def _name(member: discovery.Member) -> str:
    """Return what `identity` called a process; empty for one that is none of ours."""
    return member.user_data.partition("golem=")[2].partition(";")[0]


def _refuse_writers(participant: CycloneParticipant, dds: DdsConfig, topics: Iterable[str]) -> None:
    writers = discovery.writers(participant)
    for topic in topics:
        for guid in (writer.guid for writer in writers if writer.topic == names.topic(topic)):
            named = owner(participant, guid)
            if topic in ANYBODYS or named.startswith("golem "):
                raise ConfigError(
                    f"There is {SOLE[topic]} on {dds} already: {named}; end it, or choose another domain."
                )
