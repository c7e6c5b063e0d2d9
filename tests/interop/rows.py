"""Every row of the table of interfaces, from us to a real ROS 2 and back."""

from __future__ import annotations

import random
import time
import zlib
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Literal

from tests.interop.peers import PATIENCE, Ros, until
from tests.middleware.ros.samples import random_message

from golem.interfaces import public
from golem.interfaces.public import ActionRow, ServiceRow, TopicRow
from golem.middleware.ros import codec
from golem.middleware.ros.action_server import ServerGoal
from golem.middleware.ros.future import RosError
from golem.middleware.ros.goals import GoalStatus
from golem.middleware.ros.node import RosNode

Row = TopicRow | ServiceRow | ActionRow
Result = Literal["passed", "failed", "cannot"]
TRIES = 20
CALLS = 3
"""Calls until one arrives: ROS takes a server for ready before the server knows it, and what is sent then is lost."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """How a row did in one direction, and why not better."""

    result: Result
    why: str = ""


PASSED = Verdict("passed")
ALIEN = "ROS serves by Fast DDS, whose requests we cannot send"


def unique() -> list[Row]:
    """Return the rows, each name once."""
    rows: dict[str, Row] = {}
    for row in (*public.TOPICS, *public.SERVICES, *public.ACTIONS):
        rows.setdefault(row.name, row)
    return list(rows.values())


def sample(type: str) -> Any:
    """Return a message whose fields hold random values, the same at every call."""
    return random_message(codec.codec(), type, random.Random(zlib.crc32(type.encode())))


def same(message: Any, hex: str) -> bool:
    """Return whether CDR (hex) is `message`."""
    theirs = codec.deserialize(bytes.fromhex(hex), type(message))
    return bytes(codec.serialize(theirs)) == bytes(codec.serialize(message))


def cdr(message: Any) -> str:
    """Return the CDR of a message as hex."""
    return bytes(codec.serialize(message)).hex()


def from_us(row: Row, node: RosNode, ros: Ros) -> Verdict:
    """Judge what ROS gets of us: our messages, our services called, our actions pursued."""
    return _judged(
        _published if isinstance(row, TopicRow) else _asked if isinstance(row, ServiceRow) else _pursued, row, node, ros
    )


def to_us(row: Row, node: RosNode, ros: Ros) -> Verdict:
    """Judge what we get of ROS: its messages, its services called, its actions pursued."""
    return _judged(
        _echoed if isinstance(row, TopicRow) else _asks if isinstance(row, ServiceRow) else _pursues, row, node, ros
    )


def _judged(judge: Callable[..., str], row: Row, node: RosNode, ros: Ros) -> Verdict:
    try:
        why = judge(row, node, ros)
    except RosError as error:
        if ros.setup.vendor == "fastdds" and "speaks Fast DDS" in str(error):
            return Verdict("cannot", ALIEN)
        why = str(error)
    return Verdict("failed", why) if why else PASSED


def _qos(row: TopicRow) -> dict[str, Any]:
    return asdict(row.qos)


def _published(row: TopicRow, node: RosNode, ros: Ros) -> str:
    message = sample(row.type)
    name, back = f"/from_us{row.name}", f"/own{row.name}"
    publisher = node.publisher(name, row.type, row.qos)
    ros.do("echo", node, name=name, type=row.type, back=back, **_qos(row))
    try:
        if not until(node, publisher.matched):
            return "no subscription was found"
        # What is best effort may be lost while ROS has not matched yet, and a slow machine takes long over it.
        end = time.monotonic() + PATIENCE
        came: dict[str, Any] = {"count": 0}
        while not came["count"] and time.monotonic() < end:
            for _ in range(TRIES):
                publisher.publish(message)
                until(node, lambda: False, 0.02)
            came = ros.do("came", node, name=name)
        own = ros.do("writers", node, name=back)
    finally:
        publisher.close()
    if not came["count"]:
        return "nothing came"
    if not all(same(message, hex) for hex in came["first"]):
        return "another content came"
    (writer,) = came["writers"]
    if (writer["reliable"], writer["transient_local"]) != (row.qos.reliable, row.qos.transient_local):
        return "another QoS is seen"
    if not row.vendor and writer["hash"] != own[0]["hash"]:
        return "another hash of the type is seen"
    return ""


def _echoed(row: TopicRow, node: RosNode, ros: Ros) -> str:
    message = sample(row.type)
    name = f"/to_us{row.name}"
    came: list[Any] = []
    subscription = node.subscription(name, row.type, came.append, row.qos)
    ros.do("publish", node, name=name, type=row.type, message=cdr(message), count=TRIES, **_qos(row))
    until(node, lambda: came)
    subscription.close()
    if not came:
        return "nothing came"
    return (
        ""
        if all(bytes(codec.serialize(one)) == bytes(codec.serialize(message)) for one in came)
        else "another content came"
    )


def _asked(row: ServiceRow, node: RosNode, ros: Ros) -> str:
    kind = codec.service(row.type)
    request, response = sample(f"{row.type}_Request"), sample(f"{row.type}_Response")
    came: list[Any] = []

    def answer(asked: Any) -> Any:
        came.append(asked)
        return response

    service = node.service(f"/from_us{row.name}", row.type, answer)
    called: dict[str, Any] = {}
    for _ in range(CALLS):
        called = ros.do("call", node, name=f"/from_us{row.name}", type=row.type, request=cdr(request))
        if came:
            break
    service.close()
    answers = called["answers"]
    assert kind.Request is type(request)
    if not called["found"]:
        return "no server was found"
    if len(answers) != 1 or len(came) != 1:
        return f"{len(came)} requests came, {len(answers)} answers"
    right = same(response, answers[0]) and same(request, cdr(came[0]))
    return "" if right else "another content came"


def _asks(row: ServiceRow, node: RosNode, ros: Ros) -> str:
    request, response = sample(f"{row.type}_Request"), sample(f"{row.type}_Response")
    name = f"/to_us{row.name}"
    ros.do("serve", node, name=name, type=row.type, response=cdr(response))
    client = node.client(name, row.type)
    try:
        if not until(node, client.ready):
            return "no server was found"
        answer = node.wait(client.call(request), 10.0)
    finally:
        client.close()
    right = same(answer, cdr(response)) and same(request, ros.do("asked", node, name=name)[0])
    return "" if right else "another content came"


class Pursuer:
    """Ends every goal at once, in success."""

    def __init__(self, feedback: Any, result: Any) -> None:
        """Say `feedback`, then `result`."""
        self.feedback, self.result = feedback, result
        self.requests: list[Any] = []

    def decide(self, request: Any) -> bool:
        """Take it on."""
        return True

    def accepted(self, goal: ServerGoal) -> None:
        """Pursue it."""
        self.requests.append(goal.request)
        goal.execute()
        goal.feedback(self.feedback)
        goal.succeed(self.result)

    def cancel(self, goal: ServerGoal) -> bool:
        """Refuse."""
        return False


def _pursued(row: ActionRow, node: RosNode, ros: Ros) -> str:
    goal, feedback, result = (sample(f"{row.type}_{part}") for part in ("Goal", "Feedback", "Result"))
    name = f"/from_us{row.name}"
    handler = Pursuer(feedback, result)
    server = node.action_server(name, row.type, handler)
    given: dict[str, Any] = {}
    for _ in range(CALLS):
        given = ros.do("give", node, name=name, type=row.type, goal=cdr(goal))
        if given.get("answered"):
            break
    if not given.get("accepted"):
        return f"the goal was not accepted: {given}"
    outcome = ros.do("outcome", node, name=name)
    server.close()
    if outcome.get("status") != GoalStatus.SUCCEEDED:
        return f"the goal did not succeed: {outcome}"
    right = same(goal, cdr(handler.requests[0])) and same(result, outcome["result"])
    return "" if right and all(same(feedback, hex) for hex in outcome["feedback"]) else "another content came"


def _pursues(row: ActionRow, node: RosNode, ros: Ros) -> str:
    goal, feedback, result = (sample(f"{row.type}_{part}") for part in ("Goal", "Feedback", "Result"))
    name = f"/to_us{row.name}"
    ros.do("act", node, name=name, type=row.type, feedback=cdr(feedback), result=cdr(result))
    client = node.action_client(name, row.type)
    heard: list[Any] = []
    try:
        if not until(node, client.ready):
            return "no server was found"
        sent = node.wait(client.send_goal(goal, heard.append), 10.0)
        outcome = node.wait(sent.result(), 10.0)
    finally:
        client.close()
    if outcome.status is not GoalStatus.SUCCEEDED:
        return f"the goal ended as {outcome.status.name}"
    right = same(outcome.result, cdr(result)) and same(goal, ros.do("asked", node, name=name)[0])
    return "" if right and all(same(one, cdr(feedback)) for one in heard) else "another content came"
