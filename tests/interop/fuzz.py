"""Sends mutated goals, requests and commands to a standing robot: `python -m tests.interop.fuzz --count 100000`.

It starts `golem launch stand --world open`, and fails unless the robot stands after all of them and nothing has ended.
What stops or frees a robot when it is well-formed is left out, and so is what one process alone may write.
"""

from __future__ import annotations

import argparse
import random
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from typing import Any

from tests.domains import free_domain
from tests.interop.peers import joined
from tests.middleware.ros.samples import mutated, random_message

from golem.interfaces import public
from golem.interfaces.payloads import GateState
from golem.middleware.dds.base import Writer
from golem.middleware.ros import codec, names
from golem.middleware.ros.message import Header, pack
from golem.middleware.ros.node import RosNode

LEFT_OUT = ("/safety/stop", "/safety/reset", "/estop/press", "/elastic_band/release")
COMMANDS = ("/cmd_vel", "/cmd_height", "/left/gripper/command", "/right/gripper/command")
RATE = 400.0
"""Messages per second at most."""


def writers(node: RosNode) -> list[tuple[str, str, Writer, bool]]:
    """Return name, type and writer of everything that is sent, and whether it is a request."""
    found: list[tuple[str, str, str, bool]] = []
    for service in public.SERVICES:
        if service.name not in LEFT_OUT:
            found.append((names.request(service.name), f"{service.type}_Request", service.name, True))
    for action in public.ACTIONS:
        for part, type in (
            ("send_goal", f"{action.type}_SendGoal_Request"),
            ("get_result", f"{action.type}_GetResult_Request"),
            ("cancel_goal", "action_msgs/srv/CancelGoal_Request"),
        ):
            name = f"{action.name}/_action/{part}"
            found.append((names.request(name), type, name, True))
    for name in COMMANDS:
        found.append((names.topic(name), public.topic(name).type, name, False))
    qos = public.DEFAULT
    participant: Any = node._endpoints._participant
    return [
        (name, type, participant.writer(topic, codec.dds_name(type), qos), request)
        for topic, type, name, request in found
    ]


def attack(node: RosNode, count: int, seed: int) -> Counter[str]:
    """Send `count` messages, half of them mutated as bytes, and return how many of each name."""
    rng, sent = random.Random(seed), Counter[str]()
    targets = writers(node)
    begin = time.monotonic()
    for i in range(count):
        name, type, writer, request = rng.choice(targets)
        payload = bytes(codec.serialize(random_message(codec.codec(), type, rng)))
        if request:
            payload = pack(Header(writer.handle, i), payload)
        if rng.random() < 0.5:
            payload = payload[:4] + (mutated(payload[4:], rng) or b"\0")
        writer.write(payload)
        sent[name] += 1
        node.poll()
        time.sleep(max(0.0, begin + i / RATE - time.monotonic()))
        if i % 10000 == 0:
            print(f"{i} sent, {time.monotonic() - begin:.0f} s", flush=True)
    return sent


def main() -> int:
    """Start the robot, attack it, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with free_domain() as domain:
        command = [sys.executable, "-m", "golem", "launch", "stand", "--world", "open", "--domain", str(domain)]
        log = open("fuzz.log", "w+")  # noqa: SIM115  it outlives this block's reader
        launch = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)
        try:
            while "Safety gate: active" not in open("fuzz.log").read():
                if launch.poll() is not None:
                    print("golem launch has ended, see fuzz.log")
                    return 2
                time.sleep(0.5)
            time.sleep(10.0)
            with joined(domain, "fuzz") as node:
                heights: list[float] = []
                row = public.topic("/base_estimate")
                node.subscription(row.name, row.type, lambda m: heights.append(m.height), row.qos)
                gate = public.topic("/safety/status")
                status = node.subscription(gate.name, gate.type, None, gate.qos)
                sent = attack(node, options.count, options.seed)
                for _ in range(1000):
                    node.spin_once(0.01)
                lowest = min(heights, default=float("nan"))
                newest: Any = status.latest()
                print(dict(sent))
                print(f"gate {newest.state}, height {heights[-1]:.3f} m, lowest {lowest:.3f} m")
            said = open("fuzz.log").read()
            died = re.findall(r".* has died.*", said)
            print("died:", died)
            alive = launch.poll() is None
            return 0 if alive and not died and newest.state == GateState.ACTIVE.value else 1
        finally:
            launch.send_signal(signal.SIGINT)
            launch.wait(60)


if __name__ == "__main__":
    sys.exit(main())
