"""`golem topics`: what is on a domain, who sends it, how often and how much."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from tyro.conf import OmitArgPrefixes

from golem.errors import ConfigError
from golem.middleware.dds import discovery
from golem.middleware.dds.base import Qos, Reader
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.dds.participant import CycloneParticipant
from golem.middleware.ros import names
from golem.runtime.live.exclusive_writers import DISCOVERY, owner
from golem.runtime.live.node_setup import log_line, member

EAR = Qos(reliable=False, depth=None)
"""Matches every writer, and misses nothing that arrives."""


@dataclass(frozen=True)
class TopicStatsConfig:
    """List what is on a domain, with rates and bytes."""

    seconds: float = 2.0
    """How long to listen."""
    all: bool = False
    """Also the requests and replies of services and actions, and the topics that ROS 2 uses internally."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


@dataclass
class Row:
    """What is known of one topic.

    Attributes:
        name: in ROS, where it has one there.
        type_name: on the wire.
        writers: who writes it.
        readers: how many read it.
        rate: samples per second, by the wall clock.
        size: bytes per second.
    """

    name: str
    type_name: str
    writers: list[str]
    readers: int
    rate: float
    size: float


def run_topic_stats(config: TopicStatsConfig) -> None:
    """Listen, and print a table. Raises ConfigError: an option is wrong; DdsError: the domain cannot be joined."""
    if not 0.0 < config.seconds < 3600.0:
        raise ConfigError(f"Listening takes a positive time in seconds, not {config.seconds:g}.")
    with member("topics", config.dds) as (participant, _):
        rows = survey(participant, config.seconds, config.all)
    if not rows:
        log_line(f"Nobody is on {config.dds}.")
        return
    width = max(len(row.name) for row in rows)
    log_line(f"{'topic':{width}}  {'Hz':>7}  {'kB/s':>8}  readers  type; writers")
    for row in rows:
        who = "; ".join(row.writers) or "no writer"
        log_line(
            f"{row.name:{width}}  {row.rate:7.1f}  {row.size / 1e3:8.1f}  {row.readers:7d}  {row.type_name}; {who}"
        )


def survey(participant: CycloneParticipant, seconds: float, everything: bool = False) -> list[Row]:
    """Return a row for each topic of the domain, after listening for some seconds; `participant` itself counts not."""
    time.sleep(DISCOVERY)
    every = (discovery.writers(participant), discovery.readers(participant))
    writers, readers = ([e for e in found if e.participant != participant.guid] for found in every)
    topics = {(e.topic, e.type_name) for e in (*writers, *readers) if everything or _is_topic(e.topic)}
    ears: dict[tuple[str, str], Reader] = {}
    known: set[str] = set()
    read = {e.topic for e in readers}
    for topic, type_name in sorted(topics):
        # Of two types of one name the first is listened to; and nobody shall make images for us alone.
        if topic not in known and (topic in read or not type_name.startswith("sensor_msgs::msg::dds_::")):
            known.add(topic)
            ears[topic, type_name] = participant.reader(topic, type_name, EAR)
    counts: dict[tuple[str, str], tuple[int, int]] = {key: (0, 0) for key in ears}
    began = time.monotonic()
    took = 0.0
    while took < seconds:
        time.sleep(0.05)
        for key, ear in ears.items():
            samples = [s for s in ear.take(1024) if s.alive]
            n, size = counts[key]
            counts[key] = n + len(samples), size + sum(len(s.payload) for s in samples)
        took = time.monotonic() - began
    rows: list[Row] = []
    for key in sorted(topics):
        n, size = counts.get(key, (0, 0))
        by = sorted({owner(participant, e.guid) for e in writers if (e.topic, e.type_name) == key})
        to = sum((e.topic, e.type_name) == key for e in readers)
        rows.append(Row(names.from_wire(key[0])[1], key[1], by, to, n / took, size / took))
    return rows


def _is_topic(wire: str) -> bool:
    kind, name = names.from_wire(wire)
    return kind == "topic" and "/_action/" not in name
