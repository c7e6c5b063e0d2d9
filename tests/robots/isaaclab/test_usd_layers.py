"""The USD layers say what the compiled model says."""

from __future__ import annotations

import re
from typing import Any

import mujoco
import numpy as np
import pytest

from golem.errors import ConfigError
from golem.robots.isaaclab.usd_layers import robot_layer, world_layer
from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.other_engine import FINGER_DRIVE, follower_names
from golem.robots.mujoco.scene import build_scene
from golem.robots.sensors.profiles import load_profile
from golem.robots.worlds.layout import PackLayout

JOINT = re.compile(r'def PhysicsRevoluteJoint "(\w+)".*?\n        }\n', re.DOTALL)
LINK = re.compile(r'^    def Xform "(\w+)".*?^    }\n', re.DOTALL | re.MULTILINE)


def model_of(**options: Any) -> mujoco.MjModel:
    return build_scene(MujocoConfig(**options), PackLayout(), load_profile("ideal"), 0).model


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return model_of(world="open")


def blocks(pattern: re.Pattern[str], text: str) -> dict[str, str]:
    """Return the text of each prim that `pattern` finds, by name."""
    return {match[1]: match[0] for match in pattern.finditer(text)}


def value(block: str, name: str) -> np.ndarray:
    """Return the numbers of the first property `name` of a prim."""
    found = re.search(rf"{re.escape(name)} = \(?([^)\n]*)\)?", block)
    assert found is not None, name
    return np.array([float(v) for v in found[1].split(",")])


def test_links_have_their_masses_and_places(model: mujoco.MjModel) -> None:
    links = blocks(LINK, robot_layer(model))
    assert len(links) == 38 and "pelvis" in links
    for name, block in links.items():
        body = model.body(name)
        assert value(block, "physics:mass") == pytest.approx(body.mass)
        np.testing.assert_array_equal(value(block, "physics:centerOfMass"), body.ipos)
        np.testing.assert_array_equal(value(block, "physics:diagonalInertia"), body.inertia)
        np.testing.assert_array_equal(value(block, "physics:principalAxes"), body.iquat)


def test_joints_have_their_limits_damping_and_armature(model: mujoco.MjModel) -> None:
    joints = blocks(JOINT, robot_layer(model))
    hinges = [model.joint(j) for j in range(model.njnt) if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE]
    assert set(joints) == {joint.name for joint in hinges}
    for joint in hinges:
        block, v = joints[joint.name], joint.dofadr[0]
        follows = joint.name in follower_names()
        damping = FINGER_DRIVE[1] if follows else model.dof_damping[v]
        assert value(block, "drive:angular:physics:damping") == pytest.approx(np.radians(damping))
        stiffness = FINGER_DRIVE[0] if follows else 0.0
        assert value(block, "drive:angular:physics:stiffness") == pytest.approx(np.radians(stiffness))
        assert value(block, "physxJoint:armature") == pytest.approx(model.dof_armature[v])
        assert ("lowerLimit" in block) == bool(model.jnt_limited[joint.id])
        if "lowerLimit" in block:
            limits = [value(block, f"physics:{end}Limit") for end in ("lower", "upper")]
            np.testing.assert_allclose(np.radians(limits).ravel(), model.jnt_range[joint.id], atol=1e-12)


def test_a_joint_turns_about_its_axis_where_both_its_links_have_it(model: mujoco.MjModel) -> None:
    for name, block in blocks(JOINT, robot_layer(model)).items():
        joint = model.joint(name)
        body = model.body(joint.bodyid[0])
        for end, axis in (("1", joint.axis), ("0", turned(body.quat, joint.axis))):
            x = turned(value(block, f"physics:localRot{end}"), np.array([1.0, 0.0, 0.0]))
            np.testing.assert_allclose(x, axis, atol=1e-12)
        np.testing.assert_array_equal(value(block, "physics:localPos0"), body.pos)


def turned(quat: np.ndarray, vector: np.ndarray) -> np.ndarray:
    out = np.empty(3)
    mujoco.mju_rotVecQuat(out, vector, quat)
    return out


def test_soles_and_floor_have_their_frictions(model: mujoco.MjModel) -> None:
    foot = blocks(LINK, robot_layer(model))["left_ankle_roll_link"]
    assert foot.count("def Sphere") == 4
    sole = next(g for g in range(model.ngeom) if model.geom_contype[g] and "ankle_roll" in owner(model, g))
    friction = model.geom_friction[sole, 0]
    assert foot.count(f"</Robot/materials/friction_{round(1000 * friction)}>") == 4
    floor = world_layer(model, 0.37)
    assert floor.count("def Plane") == 1
    assert value(floor, "physics:dynamicFriction") == value(floor, "physics:staticFriction") == 0.37


def owner(model: mujoco.MjModel, geom: int) -> str:
    return model.body(int(model.geom_bodyid[geom])).name


@pytest.mark.parametrize(("world", "boxes"), [("slope", 3), ("step", 1), ("corridor", 2)])
def test_a_world_has_its_boxes(world: str, boxes: int) -> None:
    assert world_layer(model_of(world=world), 1.0).count("def Cube") == boxes


def test_what_moves_besides_the_robot_is_refused() -> None:
    with pytest.raises(ConfigError, match="only the robot moves"):
        robot_layer(model_of(world="furnished", people=1))


def test_a_layer_closes_what_it_opens(model: mujoco.MjModel) -> None:
    for text in (robot_layer(model), world_layer(model, 1.0)):
        assert text.startswith("#usda 1.0\n")
        for pair in ("{}", "()", "[]"):
            assert text.count(pair[0]) == text.count(pair[1])
