"""Topics of a bag, as they are found on a domain."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Protocol

from golem.middleware.bags.base import BagTopic
from golem.middleware.dds.base import DEFAULT, Qos
from golem.middleware.ros import codec, names


class OfferedTopic(Protocol):
    """A writer as discovery describes it: `golem.middleware.dds.discovery.Endpoint`."""

    @property
    def topic(self) -> str:
        """Name of its topic on the wire."""
        ...

    @property
    def type_name(self) -> str:
        """Name of its type on the wire."""
        ...

    @property
    def qos(self) -> Qos:
        """What it offers."""
        ...


def topic(name: str, kind: str, qos: Qos = DEFAULT) -> BagTopic:
    """Return the topic called `name` of messages of type `kind`, whose writers offer `qos`.

    Raises:
        ConfigError: there is no such type.
        MissingExtra: rosbags, which knows the types, is not installed.
    """
    return BagTopic(name, kind, codec.definition(kind), qos, codec.type_hash(kind))


def offered(writers: Iterable[OfferedTopic]) -> list[BagTopic]:
    """Return the topics of `writers` that ROS could read and whose types are known here."""
    known = set(codec.codec().names())
    found: dict[str, BagTopic] = {}
    for writer in writers:
        sort, name = names.from_wire(writer.topic)
        kind = _kind(writer.type_name)
        if sort == "topic" and kind in known and name not in found:
            found[name] = topic(name, kind, writer.qos)
    return list(found.values())


def _kind(type_name: str) -> str:
    """Return the ROS name of a type from that on the wire, `sensor_msgs::msg::dds_::Image_`; empty if it has none."""
    match = re.fullmatch(r"(\w+)::(\w+)::dds_::(\w+)_", type_name)
    return "/".join(match.groups()) if match else ""
