"""There is one robot on a domain, and who has what there."""

from __future__ import annotations

import time

from golem.errors import ConfigError
from golem.middleware.dds import discovery
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.dds.participant import CycloneParticipant
from golem.middleware.ros import names

DISCOVERY = 0.3
"""Time that whoever is on the domain already gets to be seen [s]."""
STATES = names.topic("/lowstate")


def owner(participant: CycloneParticipant, guid: bytes) -> str:
    """Return who has the endpoint with `guid` (16 bytes), for a person."""
    for found in discovery.members(participant):
        if found.guid[:12] == guid[:12]:
            name = found.user_data.partition("golem=")[2].partition(";")[0]
            process = found.process or guid.hex()
            return f"golem {name}, {process}" if name else process
    return guid.hex()


def refuse_second_robot(participant: CycloneParticipant, dds: DdsConfig) -> None:
    """Take `DISCOVERY` to look whether a robot is on the domain, before another is put there.

    Raises:
        ConfigError: one is.
    """
    time.sleep(DISCOVERY)
    others = [e for e in discovery.writers(participant) if e.topic == STATES]
    if others:
        raise ConfigError(
            f"There is a robot on {dds} already: {owner(participant, others[0].guid)}; "
            "end it, or choose another domain."
        )
