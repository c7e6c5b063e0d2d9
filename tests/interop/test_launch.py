"""ROS beside `golem launch`: it hears all that the robot says, and has it do something."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

from tests.interop.peers import Ros
from tests.interop.rows import cdr

from golem.interfaces import public
from golem.interfaces.public import TopicRow
from golem.middleware.ros import codec
from golem.middleware.ros.goals import GoalStatus
from golem.middleware.ros.msgs.std_srvs import Trigger_Request, Trigger_Response

pytestmark = [pytest.mark.slow, pytest.mark.alone, pytest.mark.timeout(1800)]

PICK = "golem_interfaces/action/Pick"
SILENT = ("/livox/", "/api/", "/objects/", "/onboard/", "/map", "/plan", "/pack/")
"""Beginnings of the topics that nothing need come on: for some it takes a LiDAR, a goal or a job by a list."""
LISTEN = 15.0
"""How long all topics are listened to [s]."""


@pytest.fixture
def launched(join: Callable[[], Ros], domain: int) -> Iterator[Ros]:
    """`golem launch tether`, whose robot may move, and ROS beside it."""
    command = [sys.executable, "-m", "golem", "launch", "tether", "--domain", str(domain)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert process.stdout is not None
    lines: list[str] = []
    try:
        for line in process.stdout:
            lines.append(line)
            if re.match(r"\[safety\] Safety gate: active", line):
                break
        else:
            raise AssertionError("golem launch ended:\n" + "".join(lines))
        threading.Thread(target=process.stdout.read, daemon=True).start()
        yield join()
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(60)


def rows() -> dict[str, TopicRow]:
    return {row.name: row for row in public.TOPICS if not row.name.startswith(SILENT)}


def headers(message: Any) -> list[Any]:
    if hasattr(message, "transforms"):
        return [transform.header for transform in message.transforms]
    return [message.header] if hasattr(message, "header") else []


def test_ros_hears_everything_and_has_a_screw_picked(launched: Ros) -> None:
    ros = launched
    for row in rows().values():
        ros.do("listen", name=row.name, type=row.type, reliable=row.qos.reliable,
               transient_local=row.qos.transient_local, depth=row.qos.depth)  # fmt: skip
    time.sleep(LISTEN)
    wrong: dict[str, str] = {}
    for row in rows().values():
        came = ros.do("came", name=row.name)
        if came["writers"] and (why := fault(row, came)):
            wrong[row.name] = why
    assert wrong == {}

    call: dict[str, Any] = {
        "name": "/right/gripper/open",
        "type": "std_srvs/srv/Trigger",
        "request": cdr(Trigger_Request()),
    }
    (answer,) = ros.do("call", **call)["answers"]
    assert codec.deserialize(bytes.fromhex(answer), Trigger_Response).success

    goal = codec.action(PICK).Goal("screw", "tray", "right")
    assert ros.do("give", name="/skill/pick", type=PICK, goal=cdr(goal))["accepted"]
    ros.tell("outcome", name="/skill/pick", timeout=300.0)
    outcome = ros.hear(timeout=310.0)
    result = codec.deserialize(bytes.fromhex(outcome["result"]), codec.action(PICK).Result).result
    # The robot may fail at it; the answer has to be one.
    assert GoalStatus(outcome["status"]) is (GoalStatus.SUCCEEDED if result.success else GoalStatus.ABORTED)
    assert result.stage and (result.success or result.reason)
    assert outcome["feedback"]


def fault(row: TopicRow, came: dict[str, Any]) -> str:
    """Return what is wrong with what came on a topic, or nothing."""
    if not came["count"]:
        return "nothing came"
    for writer in came["writers"]:
        if (writer["reliable"], writer["transient_local"]) != (row.qos.reliable, row.qos.transient_local):
            return f"another QoS is seen: {writer}"
    messages = [codec.deserialize(bytes.fromhex(hex), codec.message(row.type)) for hex in came["first"]]
    heads = [header for message in messages for header in headers(message)]
    if any(header.stamp.sec == 0 and header.stamp.nanosec == 0 for header in heads) and row.rate:
        return "a message has no stamp"
    if row.frame and row.name != "/tf" and any(header.frame_id != row.frame for header in heads):
        return f"another frame: {heads[0].frame_id}"
    return ""
