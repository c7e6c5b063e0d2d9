"""The writers and readers of one node: made with what ROS peers expect of them, and announced to the graph."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any, NamedTuple, Protocol

import numpy as np

from golem.middleware.dds.base import LATCHED, DdsError, Participant, Qos, Sample, Writer
from golem.middleware.ros import codec, names
from golem.middleware.ros.callback_guard import CallbackGuard
from golem.middleware.ros.future import RosError
from golem.middleware.ros.waitset import Inbox, WaitSet
from golem.middleware.rtps.service_link import ServiceEndpoint, ServiceLink, ServiceWriter

PARTICIPANT_USER_DATA = "enclave=/;"
"""USER_DATA by which ROS knows a participant as one of its own (ros2/rmw_cyclonedds, rmw_node.cpp)."""
INFO = "rmw_dds_common/msg/ParticipantEntitiesInfo"
"""Type of what is published."""


class DiscoveryInfo:
    """Announces one node, the only one of its participant, for `ros2 node list` and `ros2 node info`.

    Gids have 24 bytes in Humble and 16 from Iron on (rmw_dds_common 2.0.0), under the same type name: a peer of the
    other kind cannot read them. Topics, services and actions do not depend on it.
    """

    def __init__(self, participant: Participant, namespace: str, name: str, distro: str) -> None:
        """Announce node `name` in `namespace`, without endpoints yet. Raises ConfigError: there is no such distro.

        Args:
            distro: `"humble"` for peers of that distribution, `"jazzy"` for all since.
        """
        self._codec = codec.codec(distro)
        self._info, self._node, self._gid = (
            self._codec.message(f"rmw_dds_common/msg/{kind}")
            for kind in ("ParticipantEntitiesInfo", "NodeEntitiesInfo", "Gid")
        )
        self._participant, self._namespace, self._name = participant, namespace, name
        user_data = f"typehash={self._codec.type_hash(INFO)};"
        self._writer = participant.writer(names.DISCOVERY_INFO, codec.dds_name(INFO), LATCHED, user_data)
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
        self._writer.write(self._codec.serialize(self._info(self._pad(self._participant.guid), nodes)))

    def _pad(self, guid: bytes) -> Any:
        gid = self._gid()
        gid.data = np.frombuffer(guid.ljust(len(gid.data), b"\0"), np.uint8)
        return gid


class Attended(Protocol):
    """Something to be looked after whenever its node is polled."""

    def keep(self) -> None:
        """Do what is due."""

    def close(self) -> None:
        """Stop."""


class Linked(NamedTuple):
    """The endpoints by which one service answers clients of Fast DDS.

    Attributes:
        writer: sends replies.
        inbox: takes requests.
        second_reader, second_writer: never used; see `NodeEndpoints.linked`.
    """

    writer: ServiceWriter
    inbox: Inbox
    second_reader: ServiceEndpoint
    second_writer: Writer


class NodeEndpoints:
    """Makes and closes a node's endpoints; samples go through `waitset`, callbacks are called by `guard`."""

    def __init__(self, participant: Participant, info: DiscoveryInfo, guard: CallbackGuard) -> None:
        """Make endpoints of `participant` and announce them by `info`; call users' callbacks by `guard`."""
        self.waitset, self.guard = WaitSet(), guard
        self._participant, self._info = participant, info
        self._link = _link(participant, guard)
        self._open: list[Inbox | Writer] = []
        self._attended: list[Attended] = []
        self._number = itertools.count(1)
        self._closed = False

    def identity(self) -> str:
        """Return an id for a new client or server: hex bytes joined by dots, unique on the domain.

        It is made as rmw_cyclonedds makes its own (`get_unique_csid`); peers only compare it.
        """
        number = next(self._number)
        return ".".join(f"{byte:x}" for byte in self._participant.guid[:12] + number.to_bytes(4, "big"))

    def writer(self, topic: str, type: str, qos: Qos, owner: str = "") -> Writer:
        """Create a writer. Raises RosError: the node is closed.

        Args:
            topic: name on the wire.
            type: ROS name of its type.
            qos: what it offers.
            owner: `clientid=...;` or `serviceid=...;` of the client or server it belongs to.
        """
        self._check()
        writer = self._participant.writer(topic, codec.dds_name(type), qos, owner + _hash(type))
        self._add(writer)
        return writer

    def inbox(self, topic: str, type: str, qos: Qos, handle: Callable[[Sample], None], owner: str = "") -> Inbox:
        """Create a reader whose samples go to `handle` when the node is spun; see `writer` for the rest."""
        self._check()
        inbox = self._inbox(topic, handle, qos)
        inbox.open(self._participant, topic, codec.dds_name(type), qos, owner + _hash(type))
        self._add(inbox)
        return inbox

    def linked(
        self, reply: str, request: str, type: str, qos: Qos, handle: Callable[[Sample], None], owner: str
    ) -> Linked | None:
        """Create the endpoints by which clients of Fast DDS are served; None where there is no network.

        Such a client takes a server to be there once it has found as many writers of replies as readers of requests.
        A writer more of the transport and a reader more of the link see to it that it has found the link by then.

        Args:
            reply: name of the topic on the wire.
            request: name of the topic on the wire.
            type: ROS name of the service's type.
            qos: how many requests are kept.
            handle: is given the samples when the node is spun.
            owner: `serviceid=...;` of the server.
        """
        if self._link is None:
            return None
        sent, taken = f"{type}_Response", f"{type}_Request"
        writer = self._link.writer(reply, codec.dds_name(sent), _hash(sent))
        inbox = self._inbox(request, handle, qos)
        inbox.open(self._link, request, codec.dds_name(taken), qos, _hash(taken))
        second = self._link.second_reader(request, codec.dds_name(taken), _hash(taken))
        return Linked(
            writer, inbox, second, self._participant.writer(reply, codec.dds_name(sent), qos, owner + _hash(sent))
        )

    def close(self, *endpoints: Inbox | Writer) -> None:
        """Close some endpoints; those that are closed already stay so."""
        for endpoint in endpoints:
            if endpoint in self._open:
                self._open.remove(endpoint)
                endpoint.close()
        if not self._closed:
            self._announce()

    def attend(self, what: Attended) -> None:
        """Look after `what` at every poll, and close it with the node."""
        self._attended.append(what)

    def dismiss(self, what: Attended) -> None:
        """Look after `what` no more."""
        if what in self._attended:
            self._attended.remove(what)

    def poll(self) -> int:
        """Handle the samples that have arrived, return how many, and look after what needs it."""
        handled = self.waitset.poll()
        for what in list(self._attended):
            self.guard.call(type(what).__name__, what.keep)
        return handled

    def close_all(self) -> None:
        """Close every endpoint, withdraw the node, and make no more."""
        if not self._closed:
            self._closed = True
            self._info.close()
            for what in list(self._attended):
                what.close()
            self.close(*self._open)
            if self._link is not None:
                self._link.close()

    def _inbox(self, topic: str, handle: Callable[[Sample], None], qos: Qos) -> Inbox:
        return Inbox(self.waitset, lambda sample: self.guard.call(f"Topic '{topic}'", handle, sample), qos)

    def _check(self) -> None:
        if self._closed:
            raise RosError("The node is closed; create another one.")

    def _add(self, endpoint: Inbox | Writer) -> None:
        self._open.append(endpoint)
        self._announce()

    def _announce(self) -> None:
        readers = [e.guid for e in self._open if isinstance(e, Inbox)]
        self._info.announce(readers, [e.guid for e in self._open if not isinstance(e, Inbox)])


def _hash(type: str) -> str:
    return f"typehash={codec.type_hash(type)};"


def _link(participant: Participant, guard: CallbackGuard) -> ServiceLink | None:
    """Return the link to clients of Fast DDS, where there is a network on which it can be."""
    if participant.network is None:
        return None
    try:
        return ServiceLink(participant.network.domain, participant.network.address)
    except OSError as error:
        guard.log(f"Services do without clients of Fast DDS: its discovery cannot be listened to ({error}).")
        return None
