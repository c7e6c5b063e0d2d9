"""The film of a lost trial: five seconds, around the stage in which it was lost, and only of what is the twin."""

from __future__ import annotations

import io
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from golem.evaluation.episodes.last_seconds import FPS, LENGTH, LastSeconds
from golem.interfaces import topics
from golem.interfaces.payloads import Feedback
from golem.middleware.bus import Bus
from golem.runtime.executor import Executor
from golem.runtime.lockstep import build_robot
from golem.stack import load_stack


@pytest.fixture(scope="module")
def robot() -> Iterator[Any]:
    made = build_robot(load_stack("tether", profile="ideal"), 0)
    yield made
    made.close()


class Says:
    """Says a stage, and moves the twin, once a second."""

    period = 1.0

    def __init__(self, bus: Bus, robot: Any) -> None:
        self._bus, self._robot = bus, robot

    def step(self, t: float) -> None:
        self._robot.data.qpos[0] = 0.02 * t
        stage = "grasp" if t < 8.0 else "release"
        self._bus.publish(topics.FEEDBACK, Feedback(t, "open", stage, f"second {t:.0f}", {}), t)


def watched(robot: Any) -> LastSeconds:
    bus, last = Bus(), LastSeconds()
    running = SimpleNamespace(bus=bus, executor=Executor(bus, [Says(bus, robot)]))
    last(running, robot)
    running.executor.run(20.0)
    return last


def length(film: bytes) -> tuple[int, Image.Image]:
    image = Image.open(io.BytesIO(film))
    return int(getattr(image, "n_frames", 1)), image


def test_the_film_is_of_the_stage_that_was_lost(robot: Any) -> None:
    last, kept = watched(robot), robot.data.qpos.copy()
    lamp = robot.scene.model.vis.headlight.ambient.copy()
    lost, end = last.film("grasp", "grasp_method: mine"), last.film("fall", None)
    assert lost is not None and end is not None and lost != end
    assert 2 <= length(lost)[0] <= LENGTH * FPS and length(end)[1].size == (320, 240 + 51)
    np.testing.assert_array_equal(robot.data.qpos, kept)
    np.testing.assert_array_equal(robot.scene.model.vis.headlight.ambient, lamp)


class Fails:
    """Says once a second that it closes the hand, and at some times that this failed."""

    period = 1.0

    def __init__(self, bus: Bus, robot: Any, at: tuple[float, ...]) -> None:
        self._bus, self._robot, self._at = bus, robot, at

    def step(self, t: float) -> None:
        self._robot.data.qpos[0] = 0.02 * t
        failed = any(abs(t - at) < 0.5 for at in self._at)
        self._bus.publish(topics.FEEDBACK, Feedback(t, "take", "grasp", "Closing.", {"failed": failed}), t)


def film_of_failures(robot: Any, *at: float) -> bytes:
    bus, last = Bus(), LastSeconds()
    executor = Executor(bus, [Fails(bus, robot, at)])
    last(SimpleNamespace(bus=bus, executor=executor), robot)
    executor.run(20.0)
    film = last.film("grasp", None)
    assert film is not None
    return film


def test_the_film_ends_after_the_skill_said_that_it_failed(robot: Any) -> None:
    assert length(film_of_failures(robot, 3.0))[0] == pytest.approx(4.0 * FPS, abs=2)


def test_the_film_of_a_failure_that_ends_the_trial_is_of_its_end(robot: Any) -> None:
    assert film_of_failures(robot, 3.0, 19.0) == film_of_failures(robot)


def test_what_is_not_the_twin_has_no_film() -> None:
    last, bus = LastSeconds(), Bus()
    last(SimpleNamespace(bus=bus, executor=Executor(bus, [])), object())
    assert last.film("grasp", None) is None
