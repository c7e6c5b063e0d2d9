"""The public topics of a robot as topics of a bag."""

from __future__ import annotations

from collections.abc import Iterable

from golem.errors import unknown_name
from golem.middleware import public
from golem.middleware.dds.base import DEFAULT, Qos
from golem.middleware.record.base import Topic
from golem.middleware.ros import codec

COMPRESSED = "sensor_msgs/msg/CompressedImage"


def topic(name: str, kind: str, qos: Qos = DEFAULT) -> Topic:
    """Return the topic called `name` of messages of type `kind`, whose writers offer `qos`.

    Raises:
        ConfigError: there is no such type.
        MissingExtra: rosbags, which knows the types, is not installed.
    """
    return Topic(name, kind, codec.definition(kind), qos, codec.type_hash(kind))


def public_topics(chosen: Iterable[str] = ()) -> list[Topic]:
    """Return the public topics called `chosen`; default: all, but images in one form only: as they are.

    Raises:
        ConfigError: there is no such topic.
        MissingExtra: as for `topic`.
    """
    rows = {row.name: row for row in public.TOPICS}
    names = list(chosen) or [name for name, row in rows.items() if row.type != COMPRESSED]
    for name in names:
        if name not in rows:
            raise unknown_name("topic", name, rows)
    return [topic(name, rows[name].type, rows[name].qos) for name in dict.fromkeys(names)]
