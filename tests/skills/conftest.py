"""A context whose arms go exactly where they are sent and whose hands and eyes follow a script."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from typing import Any

import numpy as np
import pytest

from golem.capabilities.grasping.base import GraspMethod
from golem.capabilities.grasping.visual_servo import VisualServo
from golem.capabilities.memory.object_map import ObjectMap
from golem.capabilities.planning.rrt_connect import Straight
from golem.capabilities.properties.property_table import PropertyTable
from golem.interfaces import topics
from golem.interfaces.payloads import Detections, GripState, HandStatus
from golem.middleware.bus import Bus
from golem.robots.model.pinocchio_model import Kinematics
from golem.runtime.skill_table import SkillTable
from golem.skills.context import Context, Modules
from golem.skills.runner import SkillRun
from golem.stack import Stack
from golem.types import SIDES, Array, Detection, LocalizedObject, Side

PERIOD = 0.01
FRAME = 7
"""Ticks between two frames of a camera."""
FINGER_TICKS = 10
"""Ticks the fingers take from a goal to its end."""


def seen(label: str, position: Array, t: float, score: float = 0.9) -> LocalizedObject:
    """Return an object at `position` (3,) as a localizer reports it, without a cloud."""
    detection = Detection(label, score, np.array([0.0, 0.0, 10.0, 10.0]), np.array([5.0, 5.0]))
    return LocalizedObject(detection, t, np.array(position, dtype=float), np.zeros((0, 3)))


def modules(**given: Any) -> Modules:
    """Return the modules of a stack, some of them given."""
    default: dict[str, Any] = {
        "grasp_method": VisualServo,
        "skill": SkillTable(Stack()).make,
        "planner": Straight,
        "properties": PropertyTable(),
        "memory": ObjectMap(),
    }
    return Modules(**default | given)


class Ideal(Kinematics):
    """Kinematics of arms that are where they were sent; base_link and odom coincide."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self.offset = np.zeros(3)

    def update(self, q: Array) -> None:
        """Take nothing from the joints."""

    def pose(self, frame: str) -> Array:
        """Return where the gripper was sent, off by `offset`."""
        side = frame.removesuffix("_gripper")
        targets = self._bus.latest(topics.PALM_TARGETS)
        sent = None if targets is None else getattr(targets, side)
        T = np.diag([1.0, -1.0, -1.0, 1.0]) if sent is None else sent.copy()
        if sent is None:
            T[:3, 3] = (0.35, 0.2 if side == "left" else -0.2, 0.1)
        T[:3, 3] += self.offset
        return T


class World:
    """The scripted world around a context.

    Attributes:
        objects: what each camera sees: asked at each frame for the true positions, by label.
        grips: what each closing finds, first come first served; True holds.
        holds: whether the right hand holds something.
        loses: asked every tick whether what is held gets lost.
        sent: every pose the right arm was sent to, one per tick at most.
        stages: every stage the skill spoke of, repetitions left out.
    """

    def __init__(self) -> None:
        self.bus = Bus()
        self.kinematics = Ideal(self.bus)
        self.method: GraspMethod = VisualServo()
        self.context = Context(self.bus, self.kinematics, PERIOD, modules(grasp_method=lambda: self.method))
        self.objects: dict[str, Callable[[], list[LocalizedObject]]] = {}
        self.grips: list[bool] = []
        self.holds = False
        self.loses: Callable[[], bool] = lambda: False
        self.sent: list[Array] = []
        self.stages: list[str] = []
        self._tick = 0
        self._goals: dict[Side, int] = {side: 0 for side in SIDES}
        self._moving: dict[Side, int] = {side: 0 for side in SIDES}
        self._state: dict[Side, GripState] = {side: GripState.OPEN for side in SIDES}
        self._gap: dict[Side, float] = {side: 0.06 for side in SIDES}

    @property
    def t(self) -> float:
        """Present time [s]."""
        return self._tick * PERIOD

    def run(self, coroutine: Coroutine[None, None, Any], ticks: int = 6000) -> SkillRun:
        """Run a skill to its end, or for so many ticks."""
        run = SkillRun("scripted", coroutine)
        for _ in range(ticks):
            if run.result is not None:
                break
            self.step()
            run.step()
        return run

    def step(self) -> None:
        """Let one tick pass: cameras, then hands, then the skill's clock."""
        self._tick += 1
        self.bus.deliver(self.t)
        for camera in ("head", "left_hand", "right_hand"):
            request = self.bus.latest(topics.detection_request(camera))
            if request is not None and request.labels and self._tick % FRAME == 0 and camera in self.objects:
                objects = tuple(o for o in self.objects[camera]() if o.label in request.labels)
                self.bus.publish(topics.detections(camera), Detections(self.t, camera, objects), self.t)
        for side in SIDES:
            self._hand(side)
        targets = self.bus.latest(topics.PALM_TARGETS)
        if targets is not None and targets.right is not None:
            self.sent.append(targets.right)
        feedback = self.bus.latest(topics.FEEDBACK)
        if feedback is not None and self.stages[-1:] != [feedback.stage]:
            self.stages.append(feedback.stage)
        self.context.refresh(self.t)

    def _hand(self, side: Side) -> None:
        goal = self.bus.latest(topics.hand_goal(side))
        count = self.bus.count(topics.hand_goal(side))
        if goal is not None and count != self._goals[side]:
            self._goals[side] = count
            self._moving[side] = FINGER_TICKS
            self._state[side] = GripState.CLOSING if goal.gap is None else GripState.OPENING
        elif self._moving[side] > 0 and goal is not None:
            self._moving[side] -= 1
            if self._moving[side] == 0 and goal.gap is not None:
                self._state[side], self._gap[side] = GripState.OPEN, goal.gap
            elif self._moving[side] == 0:
                held = self.grips.pop(0) if self.grips else False
                self._state[side] = GripState.HOLDING if held else GripState.EMPTY
                self._gap[side] = 0.01 if held else 0.0
        if self._state[side] is GripState.HOLDING and self.loses():
            self._state[side] = GripState.SLIPPED
        self.holds = self._state["right"] is GripState.HOLDING
        status = HandStatus(self.t, self._state[side], self._gap[side], 0.0, np.zeros(2))
        self.bus.publish(topics.hand_status(side), status, self.t)


@pytest.fixture
def world() -> World:
    """A world in which nothing is seen and nothing can be held."""
    return World()


@pytest.fixture
def thing() -> Callable[..., LocalizedObject]:
    """`seen`."""
    return seen
