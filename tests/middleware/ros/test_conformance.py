"""What every node does with topics and services, whatever carries them."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("rosbags")

from golem.errors import ConfigError
from golem.middleware.dds.base import LATCHED, SENSOR, Qos
from golem.middleware.ros.codec import dds_name, message, service
from golem.middleware.ros.future import RosError
from golem.middleware.ros.message import CodecError
from golem.middleware.ros.node import RosNode
from golem.middleware.ros.service import Client

from .conftest import SET_BOOL, STRING, World

String = message(STRING)
SetBool = service(SET_BOOL)


def echo(request: Any) -> Any:
    return SetBool.Response(request.data, f"{request.data}")


def ready(world: World, client: Client) -> None:
    world.until(client.ready)


def test_a_message_reaches_the_callback_when_the_node_is_spun(world: World) -> None:
    talker: RosNode = world.node("talker")
    listener: RosNode = world.node("listener", "/robot")
    heard: list[str] = []
    publisher = talker.publisher("/robot/chatter", STRING)
    subscription = listener.subscription("chatter", STRING, lambda m: heard.append(m.data))
    world.until(lambda: publisher.matched() == 1 and subscription.matched() == 1)
    for text in ("a", "b"):
        publisher.publish(String(text))
    world.unspun(lambda: subscription.count() == 2)
    assert heard == []
    assert subscription.latest() == String("b")
    assert listener.poll() == 2
    assert heard == ["a", "b"]
    assert listener.poll() == 0


def test_latest_needs_no_spinning(world: World) -> None:
    talker, listener = world.node("talker"), world.node("listener")
    publisher = talker.publisher("chatter", STRING, SENSOR)
    subscription = listener.subscription("chatter", STRING, qos=SENSOR)
    assert subscription.latest() is None
    world.until(lambda: publisher.matched() == 1 and subscription.matched() == 1)
    publisher.publish(String("now"))
    world.unspun(lambda: subscription.count() == 1)
    assert subscription.latest() == String("now")
    assert subscription.latest() is subscription.latest()


def test_a_callback_gets_the_newest_that_fit(world: World) -> None:
    talker, listener = world.node("talker"), world.node("listener")
    heard: list[str] = []
    publisher = talker.publisher("chatter", STRING)
    subscription = listener.subscription("chatter", STRING, lambda m: heard.append(m.data), Qos(depth=2))
    world.until(lambda: publisher.matched() == 1 and subscription.matched() == 1)
    for number in range(5):
        publisher.publish(String(f"{number}"))
    world.until(lambda: "4" in heard)
    assert heard[-2:] == ["3", "4"]


def test_who_comes_late_hears_what_holds(world: World) -> None:
    talker = world.node("talker")
    publisher = talker.publisher("robot_description", STRING, LATCHED)
    publisher.publish(String("old"))
    publisher.publish(String("new"))
    listener = world.node("listener")
    heard: list[str] = []
    listener.subscription("robot_description", STRING, lambda m: heard.append(m.data), LATCHED)
    world.until(lambda: bool(heard))
    assert heard == ["new"]


def test_a_message_of_another_type_is_refused(world: World) -> None:
    publisher = world.node("talker").publisher("chatter", STRING)
    with pytest.raises(CodecError, match="Topic '/chatter' takes a std_msgs/msg/String here, not Bool"):
        publisher.publish(message("std_msgs/msg/Bool")(True))
    with pytest.raises(ConfigError, match="std_msgs/msg/Sting"):
        world.node("other").publisher("chatter", "std_msgs/msg/Sting")


def test_bytes_that_are_no_message_are_counted_and_dropped(world: World) -> None:
    talker, listener = world.node("talker"), world.node("listener")
    heard: list[str] = []
    subscription = listener.subscription("chatter", STRING, lambda m: heard.append(m.data))
    writer = world.participant(talker).writer("rt/chatter", dds_name(STRING), Qos())
    world.until(lambda: writer.matched() == 1 and subscription.matched() == 1)
    writer.write(b"\0\1\0\0\xff\xff\xff\x7f")
    writer.write(b"\0\1\0\0\2\0\0\0a\0")
    world.until(lambda: heard == ["a"])
    assert subscription.malformed == 1


def test_a_service_answers(world: World) -> None:
    server, caller = world.node("server"), world.node("caller")
    asked: list[bool] = []

    def callback(request: Any) -> Any:
        asked.append(request.data)
        return echo(request)

    server.service("~/set", SET_BOOL, callback)
    client = caller.client("/server/set", SET_BOOL)
    ready(world, client)
    answers = [client.call(SetBool.Request(value)) for value in (True, False)]
    assert asked == [] and not answers[0].done
    assert [world.get(a).message for a in answers] == ["True", "False"]
    assert asked == [True, False]


def test_wait_spins_until_the_answer_is_there(world: World) -> None:
    node = world.node("both")
    node.service("set", SET_BOOL, echo)
    client = node.client("set", SET_BOOL)
    ready(world, client)
    assert node.wait(client.call(SetBool.Request(True)), 5.0).success


def test_nobody_gets_the_answer_of_another(world: World) -> None:
    server = world.node("server")
    server.service("set", SET_BOOL, echo)
    clients = [world.node(f"caller_{i}").client("set", SET_BOOL) for i in range(2)]
    for client in clients:
        ready(world, client)
    answers = [client.call(SetBool.Request(value)) for client, value in zip(clients, (True, False), strict=True)]
    assert [world.get(a).success for a in answers] == [True, False]
    world.settle()


def test_without_a_server_a_call_fails_at_once(world: World) -> None:
    client = world.node("caller").client("set", SET_BOOL)
    assert not client.ready()
    with pytest.raises(RosError, match="No server of '/set' is there"):
        client.call(SetBool.Request(True)).result()
    with pytest.raises(CodecError, match="SetBool_Request"):
        client.call(SetBool.Response())


def test_a_server_that_is_silent_costs_the_time_limit(world: World) -> None:
    caller = world.node("caller")
    silent = world.participant(world.node("silent"))
    silent.reader("rq/setRequest", dds_name(f"{SET_BOOL}_Request"), Qos())
    silent.writer("rr/setReply", dds_name(f"{SET_BOOL}_Response"), Qos())
    client = caller.client("set", SET_BOOL)
    ready(world, client)
    future = client.call(SetBool.Request(True))
    with pytest.raises(RosError, match=r"No answer within 0.05 s"):
        caller.wait(future, 0.05)
    flood = [client.call(SetBool.Request(True)) for _ in range(1002)]
    assert [f.done for f in flood].count(True) == 2
    client.close()
    with pytest.raises(RosError, match="was closed"):
        flood[-1].result()


def test_a_server_that_dies_fails_its_calls_and_may_return(world: World) -> None:
    caller, server = world.node("caller"), world.node("server")
    server.service("set", SET_BOOL, echo)
    client = caller.client("set", SET_BOOL)
    ready(world, client)
    future = client.call(SetBool.Request(True))
    world.kill(server)
    with pytest.raises(RosError, match="server of '/set' has gone"):
        world.get(future)
    assert not client.ready()
    world.node("server").service("set", SET_BOOL, echo)
    ready(world, client)
    assert world.get(client.call(SetBool.Request(True))).success


def test_a_client_that_dies_is_no_ones_loss(world: World) -> None:
    server, caller, other = world.node("server"), world.node("caller"), world.node("other")
    server.service("set", SET_BOOL, echo)
    doomed, client = caller.client("set", SET_BOOL), other.client("set", SET_BOOL)
    ready(world, doomed)
    ready(world, client)
    doomed.call(SetBool.Request(True))
    world.kill(caller)
    world.settle()
    assert world.get(client.call(SetBool.Request(True))).success


def test_requests_and_replies_that_are_none_do_no_harm(world: World) -> None:
    server, caller = world.node("server"), world.node("caller")
    offered = server.service("set", SET_BOOL, echo)
    client = caller.client("set", SET_BOOL)
    stranger = world.participant(world.node("stranger"))
    requests = stranger.writer("rq/setRequest", dds_name(f"{SET_BOOL}_Request"), Qos())
    replies = stranger.writer("rr/setReply", dds_name(f"{SET_BOOL}_Response"), Qos())
    ready(world, client)
    world.until(lambda: requests.matched() == 1 and replies.matched() == 1)
    for writer in (requests, replies):
        for payload in (b"\0\1\0\0\0", b"\0\1\0\0" + bytes(16), b"\0\1\0\0" + b"\xff" * 40):
            writer.write(payload)
    world.until(lambda: offered.responder.malformed >= 2)
    assert world.get(client.call(SetBool.Request(True))).success


def test_a_node_may_be_closed_after_its_participant(world: World) -> None:
    node = world.node("late")
    node.service("set", SET_BOOL, echo)
    node.client("set", SET_BOOL)
    world.participant(node).close()
    node.close()


def test_a_closed_node_leaves(world: World) -> None:
    talker, listener = world.node("talker"), world.node("listener")
    publisher = talker.publisher("chatter", STRING)
    listener.subscription("chatter", STRING)
    world.until(lambda: publisher.matched() == 1)
    listener.close()
    listener.close()
    world.until(lambda: publisher.matched() == 0)
    with pytest.raises(RosError, match="closed"):
        listener.publisher("chatter", STRING)
