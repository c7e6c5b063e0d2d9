"""A robot on a domain as the desk's body: a client of its topics, actions and services, as ROS users are."""

from __future__ import annotations

import json
import math
import time
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from golem.agent.answers import words
from golem.agent.body import Moment, Picture, drawn, map_text
from golem.agent.stack_body import inventory
from golem.interfaces import public
from golem.interfaces import ros_convert as convert
from golem.interfaces.payloads import Feedback
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
from golem.types import SIDES, PlanarPose

SPIN = 0.02
"""Time that is waited for news at once [s]."""
SILENT = 1.0
"""Time without an /odom after which nobody knows how the robot moves [s]."""


class DomainBody:
    """See `Body`. Its time passes by itself."""

    paced = True

    def __init__(self, node: RosNode, remedy: str, jobs: Path = Path()) -> None:
        """Speak through `node`; the inventories of jobs are in the folder `jobs` of this machine.

        Raises:
            RosError: no stack is there; `remedy` says what to do.
        """
        self._node, self._remedy, self._jobs = node, remedy, jobs
        self.specs = ask_skills(node, remedy)
        self._client = node.action_client(RUN, next(row.type for row in public.ACTIONS if row.name == RUN))
        self._stopper = node.client("/safety/stop", public.TRIGGER)
        names = ("/odom", "/joint_states", "/safety/status", "/map", *map(public.wrench, SIDES))
        self._heard: dict[str, Subscription] = {name: self._listen(name) for name in names}
        self._odom_at, self._odoms = -math.inf, 0
        self._goal: ClientGoal | None = None
        self._sent: Future[ClientGoal] | None = None
        self._outcome: Future[Outcome] | None = None
        self._canceling = False
        self._news: deque[Feedback] = deque()

    def _listen(self, name: str) -> Subscription:
        row = public.topic(name)
        return self._node.subscription(row.name, row.type, None, row.qos)

    @property
    def t(self) -> float:
        """Robot time [s]."""
        odom = self._heard["/odom"].latest()
        return 0.0 if odom is None else convert.seconds(odom.header.stamp)

    @property
    def busy(self) -> bool:
        """Whether a skill of ours runs."""
        return self._sent is not None and self.result() is None

    def begin(self, skill: str, fields: Mapping[str, Any]) -> None:
        """Begin a skill; see `Body`."""
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
        """Return news of the skill; see `Body`."""
        return self._news.popleft() if self._news else None

    def result(self) -> SkillResult | None:
        """Return how the skill ended; see `Body`."""
        try:
            if self._sent is None or not self._sent.done:
                return None
            if self._goal is None:
                self._goal = self._sent.result()
                self._outcome = self._goal.result()
                if self._canceling:
                    self._goal.cancel()
            if self._outcome is None or not self._outcome.done:
                return None
            told = self._outcome.result().result
        except RosError as error:
            return SkillResult(False, "robot", "robot", str(error))
        ended = told.result
        timings = {timing.name: timing.seconds for timing in ended.timings}
        value = json.loads(told.value) if told.value else None
        return SkillResult(ended.success, ended.stage, ended.slot or None, ended.reason, timings, value)

    def cancel(self) -> None:
        """Cancel the skill; see `Body`."""
        self._canceling = True
        if self._goal is not None:
            self._goal.cancel()

    def stop_motors(self) -> None:
        """Stop; see `Body`."""
        if not self._stopper.ready():
            raise RosError("Nobody offers '/safety/stop'.")
        self._stopper.call(Trigger_Request())

    def moment(self) -> Moment | None:
        """Return how the robot moves; see `Body`."""
        odom = self._heard["/odom"].latest()
        if self._heard["/odom"].count() != self._odoms:
            self._odoms, self._odom_at = self._heard["/odom"].count(), time.monotonic()
        if odom is None or time.monotonic() - self._odom_at > SILENT:
            return None
        T, v = convert.matrix(odom.pose.pose), odom.twist.twist.linear
        velocity = T[:2, :3] @ (v.x, v.y, v.z)
        felt = [self._heard[public.wrench(side)].latest() for side in SIDES]
        forces = [
            (0.0, 0.0, 0.0) if m is None else (m.wrench.force.x, m.wrench.force.y, m.wrench.force.z) for m in felt
        ]
        return Moment(float(T[0, 3]), float(T[1, 3]), (float(velocity[0]), float(velocity[1])), np.array(forces))

    def in_odom(self, frame: str, x: float, y: float) -> tuple[float, float] | None:
        """Return a place in odom; see `Body`."""
        odom = self._heard["/odom"].latest()
        if frame == "base_link" and odom is not None:
            place = PlanarPose.of(convert.matrix(odom.pose.pose)) @ PlanarPose(x, y, 0.0)
            return place.x, place.y
        return (x, y) if frame == "odom" else None

    def read(self, resource: str) -> dict[str, Any]:
        """Return a resource; see `Body`."""
        until(self._node, lambda: self.moment() is not None, SILENT)
        return {"t": self.t, **getattr(self, f"_{resource}")()}

    def _state(self) -> dict[str, Any]:
        moment, joints = self.moment(), self._heard["/joint_states"].latest()
        if moment is None:
            return {}
        base = {"frame": "odom", "x": moment.x, "y": moment.y, "velocity": list(moment.velocity)}
        named = {} if joints is None else dict(zip(joints.name, np.round(joints.position, 4).tolist(), strict=True))
        hands = {side: {"force": moment.forces[k].round(1).tolist()} for k, side in enumerate(SIDES)}
        return {"base": base, "joints": named, "hands": hands, "busy": self.busy}

    def _safety(self) -> dict[str, Any]:
        message = self._heard["/safety/status"].latest()
        if message is None:
            return {}
        status = convert.to_gate_status(message)
        return {"state": status.state.value, "why": words(status.why, False)}

    def _map(self) -> dict[str, Any]:
        grid = self._heard["/map"].latest()
        if grid is None:
            return {"map": None}
        cells, origin = np.array(grid.data, np.int8).reshape(grid.info.height, grid.info.width), grid.info.origin
        pose = PlanarPose.of(convert.matrix(origin))
        corner = {"x": pose.x, "y": pose.y, "yaw": pose.yaw}
        return {"frame": "map", "origin": corner, "cell": grid.info.resolution, "map": map_text(cells)}

    def _memory(self) -> dict[str, Any]:
        return {"places": None, "note": "Over a domain, ask with the tool 'recall'."}

    def _inventory(self) -> dict[str, Any]:
        return inventory(self._jobs)

    def picture(self, camera: str) -> Picture | None:
        """Return what a camera shows; see `Body`."""
        name = public.image(camera, public.COLOR_JPEG)
        images, seen = self._listen(name), self._listen(f"/objects/{camera}")
        try:
            until(self._node, lambda: images.latest() is not None, SEARCH)
            message, sightings = images.latest(), seen.latest()
        finally:
            images.close()
            seen.close()
        if message is None:
            return None
        rgb = cv2.imdecode(np.frombuffer(bytes(message.data), np.uint8), cv2.IMREAD_COLOR)
        objects = () if sightings is None else sightings.objects
        found = tuple((o.label, float(o.score), o.position.x, o.position.y, o.position.z) for o in objects)
        return Picture(drawn(np.ascontiguousarray(rgb[:, :, ::-1]), ()), found)

    def step(self) -> None:
        """Take what has come; see `Body`."""
        self._node.spin_once(SPIN)
