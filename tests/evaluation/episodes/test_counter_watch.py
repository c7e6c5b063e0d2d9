"""The judge of errands: it goes by where the things are in truth."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mujoco
import pytest

from golem.evaluation.episodes.counter_watch import CounterWatch
from golem.middleware.bus import Bus
from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.lockstep import start_posture


@pytest.fixture
def robot() -> MujocoRobot:
    return MujocoRobot("ideal", 0, start_posture(), MujocoConfig(world="kitchen"))


def put(robot: MujocoRobot, body: str, shift: tuple[float, float, float]) -> None:
    """Move a thing by `shift` [m]."""
    model = robot.scene.model
    first = model.jnt_qposadr[model.body_jntadr[model.body(body).id]]
    robot.data.qpos[first : first + 3] += shift
    mujoco.mj_kinematics(model, robot.data)


def test_a_thing_that_was_lifted_and_set_down_elsewhere_is_judged_by_its_place(robot: MujocoRobot) -> None:
    running: Any = SimpleNamespace(bus=Bus())
    oracle: Any = SimpleNamespace(picture=lambda: b"")
    assert robot.scene.kitchen is not None
    thing = next(one for one in robot.scene.kitchen.things if one.kind == "can")
    watch = CounterWatch(running, robot, oracle, "can", balances=False)
    watch()
    x, y = float(thing.position[0]), float(thing.position[1])
    assert watch.problem((x, y)) == "No can was lifted."
    put(robot, thing.body, (0.0, 0.0, 0.2))
    watch()
    put(robot, thing.body, (0.0, 0.15, -0.2))
    watch()
    assert watch.problem((x, y + 0.15)) is None
    assert watch.series((x, y + 0.15))["set_down_error"] == pytest.approx(0.0, abs=2e-3)
    assert watch.problem((x, y)) == "The can is 15 cm from its place."
    assert watch.astray((x, y)) and not watch.astray((x, y + 0.15))
    # What fell to the floor, or lies on its side, was not set down beside its place by a robot that lost its way.
    put(robot, thing.body, (0.0, 0.0, -0.5))
    assert not watch.astray((x, y))
    put(robot, thing.body, (0.0, 0.0, 0.5))
    first = robot.scene.model.jnt_qposadr[robot.scene.model.body_jntadr[robot.scene.model.body(thing.body).id]]
    robot.data.qpos[first + 3 : first + 7] = (0.7071, 0.7071, 0.0, 0.0)
    mujoco.mj_kinematics(robot.scene.model, robot.data)
    assert not watch.astray((x, y))
