"""Tells the ROS graph which node owns which endpoint, so that `ros2 node list` and `ros2 node info` show it.

Every participant publishes one rmw_dds_common/msg/ParticipantEntitiesInfo on `ros_discovery_info`. Gids have 24 bytes
in Humble and 16 from Iron on (rmw_dds_common 2.0.0), under the same type name: a peer of the other kind cannot read
them. Topics, services and actions do not depend on it.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from typing import Any

import numpy as np

from golem.middleware.dds.base import LATCHED, DdsError, Participant
from golem.middleware.ros import names
from golem.middleware.ros.codec import codec, dds_name

PARTICIPANT_USER_DATA = "enclave=/;"
"""USER_DATA by which ROS knows a participant as one of its own (ros2/rmw_cyclonedds, rmw_node.cpp)."""
INFO = "rmw_dds_common/msg/ParticipantEntitiesInfo"
"""Type of what is published."""


class DiscoveryInfo:
    """Announces one node, the only one of its participant."""

    def __init__(self, participant: Participant, namespace: str, name: str, distro: str) -> None:
        """Announce node `name` in `namespace`, without endpoints yet.

        Args:
            distro: `"humble"` for peers of that distribution, `"jazzy"` for all since.

        Raises:
            ConfigError: there is no such distro.
        """
        self._codec = codec(distro)
        self._info, self._node, self._gid = (
            self._codec.message(f"rmw_dds_common/msg/{kind}")
            for kind in ("ParticipantEntitiesInfo", "NodeEntitiesInfo", "Gid")
        )
        self._participant, self._namespace, self._name = participant, namespace, name
        user_data = f"typehash={self._codec.type_hash(INFO)};"
        self._writer = participant.writer(names.DISCOVERY_INFO, dds_name(INFO), LATCHED, user_data)
        self.announce((), ())

    def announce(self, readers: Iterable[bytes], writers: Iterable[bytes]) -> None:
        """Publish the guids (16 bytes each) of the node's readers and writers."""
        gids = [self._pad(guid) for guid in readers], [self._pad(guid) for guid in writers]
        self._publish([self._node(self._namespace, self._name, *gids)])

    def close(self) -> None:
        """Withdraw the node."""
        with suppress(DdsError):  # the participant may have left already, and its node with it
            self._publish([])
        self._writer.close()

    def _publish(self, nodes: list[Any]) -> None:
        info = self._info(self._pad(self._participant.guid), nodes)
        self._writer.write(self._codec.serialize(info))

    def _pad(self, guid: bytes) -> Any:
        gid = self._gid()
        gid.data = np.frombuffer(guid.ljust(len(gid.data), b"\0"), np.uint8)
        return gid
