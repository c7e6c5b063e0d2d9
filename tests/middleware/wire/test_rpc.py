from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from tests.domains import free_domain
from tests.middleware.wire.rpc import call, reach, serve

from golem.interfaces.unitree_api import OK
from golem.middleware.dds.base import DEFAULT, Participant
from golem.middleware.dds.local import LocalDomain
from golem.middleware.wire import api
from golem.middleware.wire.api import ApiRequest, Response, RpcServer

SERVICE = "loco"


@pytest.fixture
def domain() -> LocalDomain:
    return LocalDomain()


@pytest.fixture(params=["local", "cyclone"])
def join(request: pytest.FixtureRequest) -> Iterator[Callable[[], Participant]]:
    """Joins one domain as often as it is called."""
    members: list[Participant] = []
    if request.param == "local":
        yield LocalDomain().participant
        return
    pytest.importorskip("cyclonedds")
    from golem.middleware.dds.connect import connect
    from golem.middleware.dds.domain import DdsConfig

    with free_domain() as number:

        def joined() -> Participant:
            members.append(connect(DdsConfig(number)))
            return members[-1]

        try:
            yield joined
        finally:
            for member in members:
                member.close()


@contextmanager
def answering(server: RpcServer, code: int = OK) -> Iterator[list[ApiRequest]]:
    """Answer every call in a thread, each answer preceded by one to somebody else."""
    heard: list[ApiRequest] = []
    stop = threading.Event()

    def run() -> None:
        while not stop.is_set():
            for request in server.take():
                heard.append(request)
                server.reply(Response(request.id + 1, request.api_id, code, "not yours"))
                server.reply(Response(request.id, request.api_id + 1, code, "not yours"))
                server.reply(Response(request.id, request.api_id, code, request.parameter))
            time.sleep(0.0005)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield heard
    finally:
        stop.set()
        thread.join()


def test_topics_are_the_vendors(domain: LocalDomain) -> None:
    participant = domain.participant()
    serve(participant, SERVICE)
    client = domain.participant()
    writer = client.writer("rt/api/loco/request", "unitree_api::msg::dds_::Request_", DEFAULT)
    reader = client.reader("rt/api/loco/response", "unitree_api::msg::dds_::Response_", DEFAULT)
    assert writer.matched() == reader.matched() == 1


def test_a_call_gets_its_own_answer(join: Callable[[], Participant]) -> None:
    server, client = serve(join(), SERVICE), reach(join(), SERVICE)
    with answering(server, code=7) as heard:
        answer = call(client, 8101, '{"data": 1}')
    assert (answer.api_id, answer.code, answer.data) == (8101, 7, '{"data": 1}')
    assert [(request.id, request.api_id) for request in heard] == [(answer.id, 8101)]


def test_two_clients_do_not_take_each_others_answers(join: Callable[[], Participant]) -> None:
    server = serve(join(), SERVICE)
    clients = [reach(join(), SERVICE) for _ in range(4)]
    answers: dict[int, list[Response]] = {}

    def talk(number: int) -> None:
        answers[number] = [call(clients[number], 1, f"{number} {k}") for k in range(20)]

    with answering(server):
        threads = [threading.Thread(target=talk, args=(number,)) for number in range(len(clients))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    for number, got in answers.items():
        assert [answer.data for answer in got] == [f"{number} {k}" for k in range(20)]


def test_a_client_knows_whether_the_service_is_there(domain: LocalDomain) -> None:
    client = reach(domain.participant(), SERVICE)
    assert not client.connected
    server = serve(domain.participant(), SERVICE)
    assert client.connected
    server.close()
    assert not client.connected
    client.close()


def test_what_is_not_well_formed_is_left_out(domain: LocalDomain) -> None:
    server, client = serve(domain.participant(), SERVICE), reach(domain.participant(), SERVICE)
    stranger: Participant = domain.participant()
    requests = stranger.writer("rt/api/loco/request", api.REQUEST, DEFAULT)
    responses = stranger.writer("rt/api/loco/response", api.RESPONSE, DEFAULT)
    good = api.encode_request(ApiRequest(5, 1))
    for payload in (good[:20], good, b"\0\1\0\0\1"):
        requests.write(payload)
    assert server.take() == [ApiRequest(5, 1)]
    assert server.refused == 2 and "too short" in server.refusal
    responses.write(b"\0\1\0\0\1")
    responses.write(api.encode_response(Response(5, 1)))
    assert client.take() == [Response(5, 1)]
    stranger.close()
    assert server.take() == []
    assert client.take() == []
