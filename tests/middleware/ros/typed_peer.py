"""The endpoints of a service in another implementation: cyclonedds' own IDL classes, the header as a part of the type.

No `from __future__ import annotations` here: cyclonedds reads the annotations. There is no uint8 among them, at which
Cyclone 0.10 peers would crash.
"""

from dataclasses import dataclass
from typing import Any

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct, types
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic


@dataclass
class Request(IdlStruct, typename="std_srvs.srv.dds_.SetBool_Request_"):
    guid: types.uint64
    seq: types.int64
    data: bool


@dataclass
class Response(IdlStruct, typename="std_srvs.srv.dds_.SetBool_Response_"):
    guid: types.uint64
    seq: types.int64
    success: bool
    message: str


class Endpoints:
    """A writer of one of the two topics of the service `/set`, and a reader of the other."""

    def __init__(self, domain: int, server: bool) -> None:
        participant = DomainParticipant(domain)
        reliable = Policy.Reliability.Reliable(1_000_000_000)
        qos = Qos(reliable, Policy.DataRepresentation(use_cdrv0_representation=True))
        topics: list[Any] = [Topic(participant, "rq/setRequest", Request), Topic(participant, "rr/setReply", Response)]
        out, back = reversed(topics) if server else topics
        self.writer, self.reader = DataWriter(participant, out, qos), DataReader(participant, back, qos)

    def matched(self) -> bool:
        return bool(self.writer.get_matched_subscriptions() and self.reader.get_matched_publications())
