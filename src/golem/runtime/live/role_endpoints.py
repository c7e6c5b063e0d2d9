"""What one process offers and reads on the domain, created from the table of public streams and from nothing else."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

from golem.interfaces import public
from golem.interfaces.rows import Role, TopicRow
from golem.middleware.dds.base import Participant, Qos, Reader, Sample, Writer
from golem.middleware.ros import names
from golem.middleware.ros.action_server import ActionHandler, ActionServer
from golem.middleware.ros.codec import dds_name
from golem.middleware.ros.message import CodecError
from golem.middleware.ros.node import RosNode
from golem.middleware.ros.pubsub import Publisher, Subscription
from golem.middleware.ros.waitset import Inbox, WaitSet
from golem.middleware.wire.struct_layout import WireError
from golem.runtime.executor import Node
from golem.types import TICK


class RoleEndpoints(Node):
    """The endpoints of one role's `rows`; as a node of an executor it handles what has arrived, once per tick."""

    period = TICK

    def __init__(
        self, role: Role, participant: Participant, node: RosNode, only: Collection[str] | None = None
    ) -> None:
        """Publish every topic of `role`, or `only` some: the vendor's own by `participant`, all others by `node`."""
        self.role, self.node = role, node
        self._participant = participant
        self._arrived = WaitSet()
        offered = (row for row in public.TOPICS if row.by == role and (only is None or row.name in only))
        self.rows: dict[str, TopicRow] = {row.name: row for row in offered}
        self._publishers: dict[str, Publisher] = {}
        self._writers: dict[str, Writer] = {}
        for name, row in self.rows.items():
            if row.vendor:
                self._writers[name] = participant.writer(names.topic(name), dds_name(row.type), row.qos)
            else:
                self._publishers[name] = node.publisher(name, row.type, row.qos)

    def step(self, t: float) -> None:
        self.node.poll()
        self._arrived.poll()

    def publish(self, topic: str, message: Any) -> None:
        """Send a message, or the payload of one of the vendor's."""
        if topic in self._writers:
            self._writers[topic].write(message)
        else:
            self._publishers[topic].publish(message)

    def send(self, topic: str, value: Any, encode: Callable[[Any], Any] | None = None) -> None:
        """Send a value by table or `encode`, unless on demand and unheard. Raises ValueError: neither says how."""
        row = self.rows[topic]
        encode = encode or row.encode
        if encode is None:
            raise ValueError(f"the table does not say how to send {topic}, nor does the process")
        if not row.on_demand or self.heard(topic):
            message = encode(value)
            if message is not None:
                self.publish(topic, message)

    def writer(self, topic: str) -> Writer:
        """Return the writer of one of the vendor's topics."""
        return self._writers[topic]

    def heard(self, *topics: str) -> bool:
        """Return whether anybody listens to one of the topics."""
        return any((self._writers.get(topic) or self._publishers[topic]).matched() > 0 for topic in topics)

    def listen(
        self, topic: str, take: Callable[[Any], None], refuse: Callable[[Exception], None] = lambda error: None
    ) -> None:
        """Give the values of a topic to `take`, as the table reads them, when what has arrived is handled.

        Why a message is none is told to `refuse`. Raises ValueError: the table does not let this role read it, or does
        not say how.
        """
        row = self._read(topic)
        decode = row.decode
        if decode is None:
            raise ValueError(f"the table does not say how to read {topic}")

        def handle(message: Any) -> None:
            try:
                value = decode(message)
            except (CodecError, WireError) as error:
                refuse(error)
                return
            take(value)

        if row.vendor:
            self.receive(topic, self._arrived, lambda sample: handle(sample.payload))
        else:
            self.subscribe(topic, handle)

    def subscribe(self, topic: str, callback: Callable[[Any], None]) -> Subscription:
        """Give the messages of a topic to `callback`, when the node is polled; one that it cannot read is dropped.

        What users send is read best effort: a joystick may offer no more.
        """
        row = self._read(topic)
        qos = replace(row.qos, reliable=False) if row.by == "user" else row.qos

        def take(message: Any) -> None:
            with suppress(CodecError):
                callback(message)

        return self.node.subscription(row.name, row.type, take, qos)

    def reader(self, topic: str, qos: Qos | None = None) -> Reader:
        """Return a reader of one of the vendor's topics, with another `qos` than the table's if one is given."""
        row = self._read(topic)
        return self._participant.reader(names.topic(row.name), dds_name(row.type), qos or row.qos)

    def receive(self, topic: str, waitset: WaitSet, handle: Callable[[Sample], None]) -> Inbox:
        """Give the samples of one of the vendor's topics to `handle`, when `waitset` is polled."""
        row = self._read(topic)
        inbox = Inbox(waitset, handle, row.qos)
        inbox.open(self._participant, names.topic(row.name), dds_name(row.type), row.qos, "")
        return inbox

    def serve(self, services: Mapping[str, Callable[[Any], Any]]) -> None:
        """Offer every service of the role; `services` says what answers each."""
        rows = {row.name: row for row in public.SERVICES if row.by == self.role}
        _same(rows, services)
        for name, callback in services.items():
            self.node.service(name, rows[name].type, callback)

    def act(self, handlers: Mapping[str, ActionHandler]) -> dict[str, ActionServer]:
        """Offer every action of the role; `handlers` says who decides about the goals of each."""
        rows = {row.name: row for row in public.ACTIONS if row.by == self.role}
        _same(rows, handlers)
        return {name: self.node.action_server(name, rows[name].type, handler) for name, handler in handlers.items()}

    def _read(self, topic: str) -> TopicRow:
        row = public.topic(topic)
        if self.role not in row.to:
            raise ValueError(f"the table does not let '{self.role}' read {topic}")
        return row


def _same(rows: Mapping[str, object], given: Mapping[str, object]) -> None:
    if rows.keys() != given.keys():
        raise ValueError(f"the table has {sorted(rows)}, the process {sorted(given)}")
