"""A robot on a domain as the desk's body: a client of its topics, actions and services, as ROS users are."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from golem.agent.body import Body, Picture, drawn
from golem.interfaces import public, topics
from golem.interfaces import ros_convert as convert
from golem.interfaces.nav_payloads import HERE, MapPlace
from golem.interfaces.payloads import Feedback
from golem.middleware.bus import Bus
from golem.middleware.dds.base import Participant
from golem.middleware.ros import codec, names
from golem.middleware.ros.action_client import ClientGoal
from golem.middleware.ros.future import Future, RosError
from golem.middleware.ros.goals import Outcome
from golem.middleware.ros.msgs.golem_interfaces import RunSkill_Goal
from golem.middleware.ros.msgs.std_srvs import Trigger_Request
from golem.middleware.ros.node import RosNode
from golem.middleware.ros.pubsub import Subscription
from golem.runtime.live.node_setup import SEARCH, until
from golem.runtime.live.skill_client import ask_skills
from golem.runtime.live.skill_messages import RUN
from golem.skills.base import SkillResult
from golem.types import PlanarPose

SPIN = 0.02
"""Time that is waited for news at once [s]."""
HEARD = ("/base_estimate", "/safety/status", "/map")
"""What comes to the bus, beside the state of the motors."""


class DomainBody(Body):
    """See `Body`. Its time passes by itself."""

    paced = True

    def __init__(self, participant: Participant, node: RosNode, remedy: str, jobs: Path = Path()) -> None:
        """Speak as a member of a domain; see `Body`. Raises RosError: no stack is there; `remedy` says what to do."""
        super().__init__(Bus(), jobs)
        self._node, self._remedy, self.t = node, remedy, 0.0
        self.specs = ask_skills(node, remedy)
        self._client = node.action_client(RUN, next(row.type for row in public.ACTIONS if row.name == RUN))
        self._stopper = node.client("/safety/stop", public.TRIGGER)
        self._heard = {name: (self._listen(name), 0) for name in HEARD}
        row = public.topic("/tf")
        node.subscription(row.name, row.type, self._place, row.qos)
        row = public.topic("/lowstate")
        self._states = participant.reader(names.topic(row.name), codec.dds_name(row.type), row.qos)
        self._goal: ClientGoal | None = None
        self._sent: Future[ClientGoal] | None = None
        self._outcome: Future[Outcome] | None = None
        self._canceling = False
        self._news: deque[Feedback] = deque()

    def _listen(self, name: str) -> Subscription:
        row = public.topic(name)
        return self._node.subscription(row.name, row.type, None, row.qos)

    @property
    def busy(self) -> bool:
        """Whether a skill of ours runs."""
        return self._sent is not None and self.result() is None

    def begin(self, skill: str, fields: Mapping[str, Any]) -> None:
        if not until(self._node, self._client.ready, SEARCH):
            raise RosError(f"Nobody offers '{RUN}'; {self._remedy}.")
        self._goal = self._outcome = None
        self._canceling = False
        self._news.clear()
        self._sent = self._client.send_goal(RunSkill_Goal(skill, json.dumps(fields)), self._hear)

    def _hear(self, message: Any) -> None:
        f = message.feedback
        self._news.append(Feedback(convert.seconds(f.stamp), f.skill, f.stage, f.text))

    def said(self) -> Feedback | None:
        return self._news.popleft() if self._news else None

    def result(self) -> SkillResult | None:
        try:
            if self._sent is None or not self._sent.done:
                return None
            if self._goal is None or self._outcome is None:
                self._goal = self._sent.result()
                self._outcome = self._goal.result()
                if self._canceling:
                    self._goal.cancel()
            if not self._outcome.done:
                return None
            told = self._outcome.result().result
        except RosError as error:
            return SkillResult(False, "robot", "robot", str(error))
        ended, value = told.result, json.loads(told.value) if told.value else None
        timings = {timing.name: timing.seconds for timing in ended.timings}
        return SkillResult(ended.success, ended.stage, ended.slot or None, ended.reason, timings, value)

    def cancel(self) -> None:
        self._canceling = True
        if self._goal is not None:
            self._goal.cancel()

    def stop_motors(self) -> None:
        if not self._stopper.ready():
            raise RosError("Nobody offers '/safety/stop'.")
        self._stopper.call(Trigger_Request())

    def picture(self, camera: str) -> Picture | None:
        images, seen = self._listen(public.image(camera, public.COLOR_JPEG)), self._listen(f"/objects/{camera}")
        until(self._node, lambda: images.latest() is not None, SEARCH)
        message, sightings = images.latest(), seen.latest()
        images.close()
        seen.close()
        if message is None:
            return None
        bgr = cv2.imdecode(np.frombuffer(bytes(message.data), np.uint8), cv2.IMREAD_COLOR)
        if bgr is None:
            return None
        objects = () if sightings is None else sightings.objects
        found = tuple((o.label, float(o.score), o.position.x, o.position.y, o.position.z) for o in objects)
        return Picture(drawn(np.asarray(bgr[:, :, ::-1], np.uint8)), found)

    def step(self) -> None:
        self._node.spin_once(SPIN)
        for name, (heard, before) in self._heard.items():
            if heard.count() != before:
                self._node.guard.call(name, self._take, name, heard.latest())
                self._heard[name] = heard, heard.count()
        states = [sample for sample in self._states.take() if sample.alive]
        if states:
            self._node.guard.call("/lowstate", self._take, "/lowstate", states[-1].payload)

    def _place(self, message: Any) -> None:
        """Take where the map is in odom of the base estimate, by which this body goes."""
        for told in message.transforms:
            if (told.header.frame_id, told.child_frame_id) == (convert.MAP_FRAME, "odom"):
                T = PlanarPose.of(convert.transform_matrix(told.transform))
                self._bus.publish(topics.MAP_POSE, MapPlace(self.t, T.to(HERE), T), self.t)

    def _take(self, name: str, message: Any) -> None:
        row = public.topic(name)
        if row.decode is not None and row.key is not None and message is not None:
            value = row.decode(message)
            self.t = value.t if name == "/lowstate" else self.t
            self._bus.publish(row.key, value, self.t)
