"""The public topics as a bag holds them."""

from __future__ import annotations

from collections.abc import Collection

from golem.interfaces import public
from golem.middleware.bags.base import BagTopic
from golem.middleware.bags.recorder import topic

COMPRESSED = "sensor_msgs/msg/CompressedImage"


def public_topics(chosen: Collection[str] = ()) -> list[BagTopic]:
    """Return the public topics among `chosen`; default: all, images as they are. Raises MissingExtra: as `topic`."""
    rows = {row.name: row for row in public.TOPICS}
    wanted = chosen or [name for name, row in rows.items() if row.type != COMPRESSED]
    return [topic(name, rows[name].type, rows[name].qos) for name in dict.fromkeys(wanted) if name in rows]
