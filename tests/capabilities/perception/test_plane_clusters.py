"""Handles and tableware by their shape, in the twin's own kitchens."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from golem.capabilities.perception.plane_clusters import LABELS, PlaneClusters
from golem.errors import ConfigError
from golem.evaluation.conformance import samples
from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.sensors.cameras import T_MUJOCO_OPTICAL
from golem.runtime.lockstep import start_posture
from golem.types import RgbdImage


def frame(seed: int) -> tuple[RgbdImage, MujocoRobot]:
    robot = MujocoRobot("field", seed, start_posture(), MujocoConfig(world="kitchen", layout="varied"))
    return picture(robot), robot


def picture(robot: MujocoRobot) -> RgbdImage:
    """Return what the head camera sees, in the world's frame."""
    rgb, depth = robot.capture("head")
    camera = robot.data.camera("head")
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = camera.xmat.reshape(3, 3), camera.xpos
    return RgbdImage(0.5, robot.cameras["head"], rgb, depth, T @ T_MUJOCO_OPTICAL)


@pytest.mark.parametrize("seed", [1, 4])
def test_the_handle_is_found_where_it_is(seed: int) -> None:
    image, robot = frame(seed)
    try:
        found = PlaneClusters().locate(image, LABELS)
        again = PlaneClusters().locate(image, LABELS)
        (bar,) = [part for part in robot.scene.names.parts if part.label == "handle"]
    finally:
        robot.close()
    best = max((o for o in found if o.label == "handle"), key=lambda o: o.detection.score)
    # On the surface of a bar of 25 mm, before its axis; along it, what is seen.
    assert np.linalg.norm((best.position - bar.position)[:2]) < 0.03
    assert best.mask is not None and len(best.points) == np.count_nonzero(best.mask.pixels)
    assert [o.position.tolist() for o in found] == [o.position.tolist() for o in again]
    things = [part for part in robot.scene.names.parts if part.label != "handle"]
    for ware in (o for o in found if o.label != "handle"):
        near = min(things, key=lambda part: float(np.linalg.norm((part.position - ware.position)[:2])))
        assert np.linalg.norm((near.position - ware.position)[:2]) < 0.10


def test_a_can_behind_a_bottle_is_a_can() -> None:
    """In the image the bottle hides the can's foot, and their outlines touch along a diagonal."""
    robot = MujocoRobot("ideal", 0, start_posture(), MujocoConfig(world="counter"))
    try:
        places = {"can_0": (0.563, 0.375), "bottle_2": (0.434, 0.28)}
        for body, place in places.items():
            joint = robot.scene.model.joint(body).qposadr[0]
            robot.data.qpos[joint : joint + 2] = place
        mujoco.mj_forward(robot.scene.model, robot.data)
        found = {o.label: o.position for o in PlaneClusters().locate(picture(robot), LABELS)}
    finally:
        robot.close()
    for body, place in places.items():
        assert np.linalg.norm(found[body.split("_")[0]][:2] - place) < 0.04


@pytest.mark.parametrize("seed", [0, 3])
def test_what_stands_on_a_counter_is_known_from_one_metre_away(seed: int) -> None:
    """What counts as the counter's top grew with the squared distance: a bowl of 6.5 cm was within it."""
    robot = MujocoRobot("field", seed, start_posture(), MujocoConfig(world="counter", stance=(0.6, 0.0, 0.0)))
    try:
        found = PlaneClusters().locate(picture(robot), LABELS)
        things = [part for part in robot.scene.names.parts if part.label != "handle"]
    finally:
        robot.close()
    assert len(things) == 4
    for thing in things:
        assert any(o.label == thing.label and np.linalg.norm((o.position - thing.position)[:2]) < 0.08 for o in found)


def test_an_empty_plate_and_a_blind_camera_hold_nothing() -> None:
    image = samples.image(0.1)
    module = PlaneClusters()
    assert module.locate(replace(image, depth=np.zeros_like(image.depth)), LABELS) == []
    assert module.locate(replace(image, depth=np.full_like(image.depth, np.nan)), LABELS) == []
    assert module.locate(image, ()) == []


def test_a_label_it_does_not_know_is_refused() -> None:
    with pytest.raises(ConfigError, match="Did you mean 'handle'"):
        PlaneClusters().locate(samples.image(0.1), ["handel"])
