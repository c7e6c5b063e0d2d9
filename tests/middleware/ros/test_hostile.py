"""Mutated traffic into services and actions: whatever strangers write, servers and clients go on."""

from __future__ import annotations

import gc
import random

import pytest

pytest.importorskip("rosbags")

from tests.middleware.ros.samples import mutated

from golem.middleware.dds.base import LATCHED, Qos, Reader, Writer
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.action_server import MAX_WAITING
from golem.middleware.ros.codec import action, dds_name, service
from golem.middleware.ros.goals import CANCEL_GOAL, STATUS_ARRAY
from golem.middleware.ros.message import CodecError

from .conftest import PICK, SET_BOOL, World
from .test_actions import Handler, feedback, result

Pick, SetBool = action(PICK), service(SET_BOOL)
DEEP = Qos(depth=None)
SERVICES = {
    "/set": SET_BOOL,
    "/pick/_action/send_goal": f"{PICK}_SendGoal",
    "/pick/_action/cancel_goal": CANCEL_GOAL,
    "/pick/_action/get_result": f"{PICK}_GetResult",
}
TOPICS = {
    "rt/pick/_action/feedback": (f"{PICK}_FeedbackMessage", Qos()),
    "rt/pick/_action/status": (STATUS_ARRAY, LATCHED),
    **{f"rq{name}Request": (f"{kind}_Request", Qos()) for name, kind in SERVICES.items()},
    **{f"rr{name}Reply": (f"{kind}_Response", Qos()) for name, kind in SERVICES.items()},
}


class Scene:
    """A server and a client at work, and a stranger who has listened and now talks."""

    def __init__(self) -> None:
        self.domain = LocalDomain()
        self.world = World(self.domain.participant, 0.0)
        self.handler = Handler()
        self.handler.finish = True
        server, caller = self.world.node("server"), self.world.node("client")
        server.service("set", SET_BOOL, lambda request: SetBool.Response(request.data, "done"))
        self.server = server.action_server("pick", PICK, self.handler)
        self.setter, self.client = caller.client("set", SET_BOOL), caller.action_client("pick", PICK)
        stranger = self.domain.participant()
        readers: dict[str, Reader] = {}
        self.writers: dict[str, Writer] = {}
        for topic, (kind, qos) in TOPICS.items():
            readers[topic] = stranger.reader(topic, dds_name(kind), DEEP)
            self.writers[topic] = stranger.writer(topic, dds_name(kind), qos)
        self.work()
        self.heard = {topic: [s.payload for s in reader.take()] for topic, reader in readers.items()}
        for reader in readers.values():
            reader.close()

    def work(self) -> None:
        """Use everything once."""
        assert self.world.get(self.setter.call(SetBool.Request(True))).success
        self.handler.finish = False
        heard: list[str] = []
        goal = self.world.get(self.client.send_goal(Pick.Goal("screw"), lambda f: heard.append(f.feedback.text)))
        work = self.handler.goals[-1]
        work.execute()
        work.feedback(feedback("here"))
        outcome = goal.result()
        self.world.get(goal.cancel())
        work.canceled(result("enough"))
        assert self.world.get(outcome).result.result.reason == "enough" and heard == ["here"]
        self.handler.finish = True
        self.handler.goals.clear()

    def attack(self, count: int, rng: random.Random) -> None:
        """Write `count` mutations of what was heard."""
        topics = list(self.heard)
        for i in range(count):
            topic = rng.choice(topics)
            payload = mutated(bytes(rng.choice(self.heard[topic])), rng)
            if len(payload) > 4 and payload[:2] == b"\0\1":
                self.writers[topic].write(payload)
            if i % 20 == 0:
                self.world.clock.t += 0.1
                self.world.spin()
                self.handler.goals.clear()


def test_mutated_traffic_is_survived() -> None:
    scene = Scene()
    assert all(scene.heard.values())
    scene.attack(2000, random.Random(1))
    scene.work()


@pytest.mark.slow
def test_a_hundred_thousand_mutations_leave_nothing_behind() -> None:
    scene = Scene()
    rng = random.Random(2)
    scene.attack(10_000, rng)
    before = objects()
    scene.attack(100_000, rng)
    assert objects() < before + 1000
    scene.work()


def objects() -> int:
    """Return how many containers are alive."""
    gc.collect()
    return len(gc.get_objects())


def test_requests_for_the_result_of_one_goal_are_bounded() -> None:
    scene = Scene()
    scene.handler.finish = False
    goal = scene.world.get(scene.client.send_goal(Pick.Goal("screw")))
    work = scene.handler.goals[-1]
    work.execute()
    outcomes = [goal.result() for _ in range(MAX_WAITING + 50)]
    scene.world.settle()
    work.succeed(result("one for all"))
    scene.world.settle()
    assert [o.done for o in outcomes] == [False] * 50 + [True] * MAX_WAITING


def test_a_result_that_cannot_be_sent_does_not_end_the_goal() -> None:
    scene = Scene()
    scene.handler.finish = False
    goal = scene.world.get(scene.client.send_goal(Pick.Goal("screw")))
    work = scene.handler.goals[-1]
    work.execute()
    broken = result("x")
    broken.result.reason = 3
    with pytest.raises(CodecError, match="cannot be serialised"):
        work.succeed(broken)
    work.abort(result("x"))
    assert scene.world.get(goal.result()).result.result.reason == "x"
