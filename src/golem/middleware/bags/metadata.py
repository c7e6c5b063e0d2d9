"""metadata.yaml, rosbag2's table of contents of a bag.

Version 8 of the format: the newest whose QoS is a string, which rosbag2 reads from Humble on (it knows no greatest
version, and skips keys it does not know; ros2/rosbag2 rosbag2_storage/include/rosbag2_storage/yaml.hpp). Version 9,
of Jazzy on, makes Humble fail with "bad conversion" (ros2/rosbag2#2013).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import yaml

from golem.errors import ConfigError
from golem.middleware.bags.base import BagTopic
from golem.middleware.dds.base import DEFAULT, Qos
from golem.options import read_yaml

VERSION = 8
FOREVER = {"sec": 9223372036, "nsec": 854775807}
"""RMW_DURATION_INFINITE."""
KEEP_LAST, KEEP_ALL = 1, 2
RELIABLE, BEST_EFFORT = 1, 2
TRANSIENT_LOCAL, VOLATILE = 1, 2
AUTOMATIC = 1
"""Values of rmw's QoS enumerations (ros2/rmw rmw/include/rmw/types.h)."""


@dataclass
class Contents:
    """What is in one file of a bag: log times [ns], meaningless without a message, and messages per topic."""

    first: int = 0
    last: int = 0
    counts: dict[BagTopic, int] = field(default_factory=dict)

    @property
    def messages(self) -> int:
        """How many messages there are."""
        return sum(self.counts.values())

    def add(self, topic: BagTopic, log_time: int) -> None:
        """Account for one message."""
        self.merge(Contents(log_time, log_time, {topic: 1}))

    def merge(self, other: Contents) -> None:
        """Account for all messages of another file."""
        if not other.counts:
            return
        empty = not self.counts
        self.first = other.first if empty else min(self.first, other.first)
        self.last = other.last if empty else max(self.last, other.last)
        for topic, count in other.counts.items():
            self.counts[topic] = self.counts.get(topic, 0) + count


def offered_qos(qos: Qos) -> str:
    """Return the QoS profile of a topic's writer as rosbag2 stores it."""
    profile = {
        "history": KEEP_ALL if qos.depth is None else KEEP_LAST,
        "depth": qos.depth or 0,
        "reliability": RELIABLE if qos.reliable else BEST_EFFORT,
        "durability": TRANSIENT_LOCAL if qos.transient_local else VOLATILE,
        "deadline": FOREVER,
        "lifespan": FOREVER,
        "liveliness": AUTOMATIC,
        "liveliness_lease_duration": FOREVER,
        "avoid_ros_namespace_conventions": False,
    }
    return dump([profile]).strip()


def parse_qos(text: str) -> Qos:
    """Return the QoS of a topic's first writer from what rosbag2 stored; the default where it says nothing usable."""
    try:
        profile = cast("Any", read_yaml(text, "QoS") or [{}])[0]
        history, reliability, durability = (profile[k] for k in ("history", "reliability", "durability"))
        depth = int(profile.get("depth") or 0)
        kept = None if history in (KEEP_ALL, "keep_all") else max(depth, 1)
        return Qos(reliability in (RELIABLE, "reliable"), durability in (TRANSIENT_LOCAL, "transient_local"), kept)
    except (ConfigError, LookupError, TypeError, ValueError, AttributeError):
        return DEFAULT


def dump(value: object) -> str:
    """Return plain YAML: without aliases, in the order of the keys."""
    return yaml.dump(value, Dumper=_Plain, sort_keys=False)


def information(files: Mapping[str, Contents], custom: Mapping[str, str]) -> dict[str, Any]:
    """Return rosbag2's BagMetadata of the contents of `files`, in order, and what else is said, `custom`."""
    whole = Contents()
    for contents in files.values():
        whole.merge(contents)
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        **_span(whole),
        "message_count": whole.messages,
        "topics_with_message_count": _topics(whole),
        "compression_format": "",  # of whole files or messages; MCAP compresses its chunks by itself
        "compression_mode": "",
        "relative_file_paths": list(files),
        "files": [{"path": name, **_span(c), "message_count": c.messages} for name, c in files.items()],
        "custom_data": dict(custom),
        "ros_distro": "",
    }


def _topics(contents: Contents) -> Sequence[dict[str, Any]]:
    return [
        {
            "topic_metadata": {
                "name": topic.name,
                "type": topic.kind,
                "serialization_format": "cdr",
                "offered_qos_profiles": offered_qos(topic.qos),
                "type_description_hash": topic.type_hash,
            },
            "message_count": count,
        }
        for topic, count in contents.counts.items()
    ]


def _span(contents: Contents) -> dict[str, Any]:
    return {
        "duration": {"nanoseconds": contents.last - contents.first},
        "starting_time": {"nanoseconds_since_epoch": contents.first},
    }


class _Plain(yaml.SafeDumper):
    """Writes no aliases, which are legal YAML but nothing that a person wants to read."""

    def ignore_aliases(self, data: object) -> bool:
        return True
