"""A ROS 2 node over rclpy that does what lines of JSON on its standard input say, and answers each by a line.

It runs in the Python that `build.sh` makes and knows nothing of GOLEM. Messages travel as hex of their CDR.
"""

# pyright: reportMissingImports=false
from __future__ import annotations

import importlib
import json
import random
import sys
import threading
import time
import traceback
from typing import Any

import rclpy
from action_msgs.srv import CancelGoal
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message

SAMPLES = 2000
"""Latencies of a topic that are kept."""
RESTARTED = 5.0
"""Step of a stamp from which the robot was restarted meanwhile [s]."""


def kind(name: str) -> Any:
    """Return the class of `package/msg/Type`, and likewise of services and actions."""
    package, what, name = name.split("/")
    return getattr(importlib.import_module(f"{package}.{what}"), name)


def profile(reliable: bool, transient_local: bool, depth: int) -> QoSProfile:
    """Return what GOLEM's `Qos` says."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if transient_local else DurabilityPolicy.VOLATILE,
    )


def wait(condition: Any, timeout: float) -> bool:
    """Return whether `condition()` came true within `timeout` [s]."""
    end = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.005)
    return True


class Heard:
    """What came on one topic."""

    def __init__(self, keep: int) -> None:
        """Keep the first `keep` messages."""
        self.count, self.gap, self.begin, self.last = 0, 0.0, 0.0, 0.0
        self.robot_time, self._stamp = 0.0, 0.0
        self.first: list[str] = []
        self.latencies: list[float] = []
        self._keep = keep

    def take(self, message: Any, info: Any) -> None:
        """Count a message."""
        now = time.time()
        self.begin = self.begin or now
        self.gap = max(self.gap, now - (self.last or now))
        self.last = now
        self._advance(message)
        if len(self.first) < self._keep:
            self.first.append(serialize_message(message).hex())
        latency = now - info["source_timestamp"] * 1e-9
        if len(self.latencies) < SAMPLES:
            self.latencies.append(latency)
        else:  # of so many a fair share
            at = random.randrange(self.count + 1)
            if at < SAMPLES:
                self.latencies[at] = latency
        self.count += 1

    def _advance(self, message: Any) -> None:
        """Add up the time between stamps: lost messages leave it as it is, and a restarted robot begins anew."""
        stamp = getattr(message, "clock", None) or getattr(getattr(message, "header", None), "stamp", None)
        if stamp is None:
            return
        t = stamp.sec + 1e-9 * stamp.nanosec
        self.robot_time += t - self._stamp if self._stamp and 0.0 < t - self._stamp < RESTARTED else 0.0
        self._stamp = t

    def told(self) -> dict[str, Any]:
        """Return it in figures; times in s."""
        ordered = sorted(self.latencies)
        return {
            "count": self.count,
            "first": self.first,
            "span": self.last - self.begin,
            "robot_time": self.robot_time,
            "gap": self.gap,
            "median": ordered[len(ordered) // 2] if ordered else None,
            "p99": ordered[len(ordered) * 99 // 100] if ordered else None,
        }


class Peer:
    """The node, and what its callers asked for."""

    def __init__(self) -> None:
        """Join the domain of ROS_DOMAIN_ID."""
        rclpy.init()
        self.node = Node("peer")
        self.heard: dict[str, Heard] = {}
        self.kept: list[Any] = []
        self.requests: dict[str, list[str]] = {}
        self.clients: dict[str, Any] = {}
        self.goals: dict[str, Any] = {}
        self.feedback: dict[str, list[str]] = {}
        self.modes: dict[str, str] = {}
        executor = MultiThreadedExecutor(4)
        executor.add_node(self.node)
        threading.Thread(target=self._spin, args=(executor,), daemon=True).start()

    @staticmethod
    def _spin(executor: MultiThreadedExecutor) -> None:
        try:
            executor.spin()
        except ExternalShutdownException:
            pass

    def echo(self, name: str, type: str, back: str, **qos: Any) -> None:
        """Send what comes on a topic back on another."""
        publisher = self.node.create_publisher(kind(type), back, profile(**qos))
        self.listen(name, type, then=publisher.publish, **qos)
        self.kept.append(publisher)

    def listen(self, name: str, type: str, then: Any = None, keep: int = 3, **qos: Any) -> None:
        """Count what comes on a topic, and keep the first `keep`."""
        heard = self.heard.setdefault(name, Heard(keep))

        def take(message: Any, info: Any) -> None:
            heard.take(message, info)
            if then is not None:
                then(message)

        self.kept.append(self.node.create_subscription(kind(type), name, take, profile(**qos)))

    def publish(self, name: str, type: str, message: str, count: int, **qos: Any) -> None:
        """Send a message `count` times, once somebody listens."""
        publisher = self.node.create_publisher(kind(type), name, profile(**qos))
        wait(publisher.get_subscription_count, 10.0)
        ready = deserialize_message(bytes.fromhex(message), kind(type))
        for _ in range(count):
            publisher.publish(ready)
            time.sleep(0.02)
        self.kept.append(publisher)

    def came(self, name: str) -> dict[str, Any]:
        """Return how many messages came on a topic, the first of them, when, and what the graph says of its writers."""
        return self.heard[name].told() | {"writers": self.writers(name)}

    def writers(self, name: str) -> list[dict[str, Any]]:
        """Return what the graph says of the writers of a topic."""
        return [
            {
                "node": info.node_name,
                "type": info.topic_type,
                "hash": str(info.topic_type_hash),
                "reliable": info.qos_profile.reliability == ReliabilityPolicy.RELIABLE,
                "transient_local": info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL,
            }
            for info in self.node.get_publishers_info_by_topic(name)
        ]

    def call(self, name: str, type: str, request: str, count: int = 1, timeout: float = 10.0) -> dict[str, Any]:
        """Call a service `count` times at once."""
        service = kind(type)
        client = self.clients.get(name) or self.node.create_client(service, name)
        self.clients[name] = client
        if not client.wait_for_service(timeout):
            return {"found": False, "answers": []}
        start = time.monotonic()
        message = deserialize_message(bytes.fromhex(request), service.Request)
        futures = [client.call_async(message) for _ in range(count)]
        wait(lambda: all(future.done() for future in futures), timeout)
        answers = [serialize_message(future.result()).hex() for future in futures if future.done()]
        return {"found": True, "answers": answers, "took": time.monotonic() - start}

    def serve(self, name: str, type: str, response: str) -> None:
        """Answer a service by always the same, and keep the requests."""
        service = kind(type)
        asked = self.requests.setdefault(name, [])

        def answer(request: Any, _: Any) -> Any:
            asked.append(serialize_message(request).hex())
            return deserialize_message(bytes.fromhex(response), service.Response)

        self.kept.append(self.node.create_service(service, name, answer))

    def asked(self, name: str) -> list[str]:
        """Return the requests that a service had."""
        return self.requests[name]

    def act(self, name: str, type: str, feedback: str, result: str) -> None:
        """Offer an action that ends its goals as `mode` says."""
        action = kind(type)
        asked = self.requests.setdefault(name, [])
        self.modes[name] = "succeed"

        def execute(goal: Any) -> Any:
            asked.append(serialize_message(goal.request).hex())
            goal.publish_feedback(deserialize_message(bytes.fromhex(feedback), action.Feedback))
            mode = self.modes[name]
            if mode == "raise":
                raise RuntimeError("as was asked for")
            if mode in ("wait", "stubborn"):
                wait(lambda: goal.is_cancel_requested or self.modes[name] == "succeed", 20.0)
            if goal.is_cancel_requested:
                goal.canceled()
            elif mode == "abort":
                goal.abort()
            else:
                goal.succeed()
            return deserialize_message(bytes.fromhex(result), action.Result)

        def decide(_: Any) -> GoalResponse:
            return GoalResponse.REJECT if self.modes[name] == "reject" else GoalResponse.ACCEPT

        def cancel(_: Any) -> CancelResponse:
            return CancelResponse.REJECT if self.modes[name] == "stubborn" else CancelResponse.ACCEPT

        server = ActionServer(self.node, action, name, execute, goal_callback=decide, cancel_callback=cancel)
        self.kept.append(server)

    def mode(self, name: str, mode: str) -> None:
        """Choose how an action ends its goals."""
        self.modes[name] = mode

    def give(self, name: str, type: str, goal: str, timeout: float = 10.0) -> dict[str, Any]:
        """Give a goal, and return whether it was accepted."""
        action = kind(type)
        client = self.clients.get(name) or ActionClient(self.node, action, name)
        self.clients[name] = client
        if not client.wait_for_server(timeout):
            return {"found": False}
        feedback = self.feedback[name] = []
        message = deserialize_message(bytes.fromhex(goal), action.Goal)
        future = client.send_goal_async(message, lambda m: feedback.append(serialize_message(m.feedback).hex()))
        if not wait(future.done, timeout):
            return {"found": True, "answered": False}
        handle = self.goals[name] = future.result()
        return {"found": True, "answered": True, "accepted": handle.accepted}

    def outcome(self, name: str, timeout: float = 10.0) -> dict[str, Any]:
        """Wait for the outcome of the goal that was given last."""
        future = self.goals[name].get_result_async()
        if not wait(future.done, timeout):
            return {"done": False}
        answer = future.result()
        return {
            "done": True,
            "status": answer.status,
            "result": serialize_message(answer.result).hex(),
            "feedback": self.feedback[name],
        }

    def cancel(self, name: str, timeout: float = 10.0) -> dict[str, Any]:
        """Ask to cancel the goal that was given last."""
        return self._canceling(self.goals[name].cancel_goal_async(), timeout)

    def cancel_id(self, name: str, id: str, timeout: float = 10.0) -> dict[str, Any]:
        """Ask to cancel a goal of anybody, or of nobody (32 hex digits), or all (zeros)."""
        client = self.clients.setdefault(
            f"{name}/cancel", self.node.create_client(CancelGoal, f"{name}/_action/cancel_goal")
        )
        if not client.wait_for_service(timeout):
            return {"done": False}
        request = CancelGoal.Request()
        request.goal_info.goal_id.uuid = list(bytes.fromhex(id))
        return self._canceling(client.call_async(request), timeout)

    @staticmethod
    def _canceling(future: Any, timeout: float) -> dict[str, Any]:
        if not wait(future.done, timeout):
            return {"done": False}
        answer = future.result()
        return {"done": True, "code": answer.return_code, "goals": len(answer.goals_canceling)}

    def graph(self) -> dict[str, Any]:
        """Return what is on the domain."""
        nodes = self.node.get_node_names_and_namespaces()
        return {
            "nodes": [(space.rstrip("/") + "/" + name) for name, space in nodes],
            "topics": dict(self.node.get_topic_names_and_types()),
            "services": dict(self.node.get_service_names_and_types()),
        }

    def implementation(self) -> str:
        """Return the name of the middleware below."""
        return rclpy.get_rmw_implementation_identifier()


def main() -> None:
    """Obey until the standard input ends."""
    # Loggers of ROS write on the standard output; the answers go to a copy of it.
    peer = Peer()
    out = sys.stdout
    print("ready", file=out, flush=True)
    for line in sys.stdin:
        words = json.loads(line)
        try:
            answer = {"value": getattr(peer, words.pop("do"))(**words)}
        except Exception:
            answer = {"error": traceback.format_exc()}
        print(json.dumps(answer), file=out, flush=True)
    rclpy.shutdown()


if __name__ == "__main__":
    main()
