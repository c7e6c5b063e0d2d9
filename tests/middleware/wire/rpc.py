"""Servers and clients of remote calls on endpoints of their own, and calls that wait for their answer."""

from __future__ import annotations

import math
import time

from golem.middleware.dds.base import CALLS, Participant
from golem.middleware.wire import api
from golem.middleware.wire.api import ApiRequest, Response, RpcClient, RpcServer, request_topic, response_topic

POLL = 0.0005


def serve(participant: Participant, service: str) -> RpcServer:
    """Join a domain as the server of `service`."""
    # The writer first: a client that sees the reader calls at once.
    responses = participant.writer(f"rt/{response_topic(service)}", api.RESPONSE, CALLS)
    return RpcServer(participant.reader(f"rt/{request_topic(service)}", api.REQUEST, CALLS), responses)


def reach(participant: Participant, service: str) -> RpcClient:
    """Join a domain as a client of `service`."""
    responses = participant.reader(f"rt/{response_topic(service)}", api.RESPONSE, CALLS)
    return RpcClient(participant.writer(f"rt/{request_topic(service)}", api.REQUEST, CALLS), responses)


def call(
    client: RpcClient, api_id: int, parameter: str = "{}", timeout: float = 5.0, again: float = math.inf
) -> Response:
    """Call and return the answer; after `timeout` seconds there is none.

    A server that was just found may not know its client yet, and answer nobody: the call is sent `again` so often [s].
    """
    start, number = time.monotonic(), time.monotonic_ns()
    due = start
    while time.monotonic() < start + timeout:
        if client.connected and time.monotonic() >= due:
            client.send(ApiRequest(number, api_id, parameter))
            due = time.monotonic() + again
        for response in client.take():
            if (response.id, response.api_id) == (number, api_id):
                return response
        time.sleep(POLL)
    raise AssertionError("no answer" if client.connected else "nobody offers the service")
