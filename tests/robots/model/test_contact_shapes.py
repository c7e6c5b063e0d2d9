"""Self-collision: silent in every normal posture, there when limbs cross, and absent unless asked for."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.legs.hold import STANCES
from golem.robots.model import contact_shapes, mjcf
from golem.robots.model.contact_shapes import Feet
from golem.robots.model.table import JOINT_INDEX, JOINT_NAMES, SOLE
from golem.types import LEGS, SIDES, UPPER, Array

# ALMI's default arms (shoulder pitch, roll, yaw, elbow, wrist) and hanging arms.
ARMS = {
    **POSTURES,
    "almi": np.array([0, 0.4, 0.2, 0, 0.3, 0, 0, 0, 0.4, -0.2, 0, 0.3, 0, 0, 0]),
    "hanging": np.array([0, 0, 0.3, 0, 1.4, 0, 0, 0, 0, -0.3, 0, 1.4, 0, 0, 0]),
    "zero": np.zeros(15),
}


@pytest.fixture(scope="module", params=[True, False], ids=["hands", "handless"])
def model(request: pytest.FixtureRequest) -> mujoco.MjModel:
    """The robot that touches itself, in empty space."""
    return mjcf.robot_spec(hands=request.param, self_collision=True).compile()


def touching(model: mujoco.MjModel, q: Array) -> set[tuple[str, str]]:
    """Return the names of the shapes that touch at the joints `q` (27,)."""
    data = mujoco.MjData(model)
    data.qpos[[model.joint(name).qposadr[0] for name in JOINT_NAMES]] = q
    mujoco.mj_forward(model, data)
    return {(model.geom(a).name, model.geom(b).name) for a, b in data.contact.geom}


def joints(stance: str, arms: str, **changes: float) -> Array:
    q = np.zeros(27)
    q[LEGS], q[UPPER] = np.tile(STANCES[stance], 2), ARMS[arms]
    for name, value in changes.items():
        q[JOINT_INDEX[f"{name}_joint"]] = value
    return q


@pytest.mark.parametrize("arms", ARMS)
@pytest.mark.parametrize("stance", STANCES)
def test_nothing_touches_in_a_normal_posture(stance: str, arms: str, model: mujoco.MjModel) -> None:
    assert touching(model, joints(stance, arms)) == set()


def test_a_leg_stopped_by_the_other(model: mujoco.MjModel) -> None:
    crossed = touching(model, joints("crouch", "almi", left_hip_roll=-0.4, right_hip_roll=0.3))
    assert ("left_shin", "right_shin") in crossed or ("left_shin", "right_foot") in crossed
    toe_in = touching(model, joints("straight", "almi", left_hip_roll=-0.15, right_hip_roll=0.15))
    assert ("left_foot", "right_foot") in toe_in


def test_an_arm_meets_trunk_and_thigh(model: mujoco.MjModel) -> None:
    folded = joints("crouch", "zero", left_shoulder_yaw=-1.5, left_elbow=0.3)
    assert any(pair[1] == "trunk" for pair in touching(model, folded))
    # The hand is 13 cm wide and hangs from a shoulder that is 1 cm further in than the thigh's outside.
    beside = touching(model, joints("stand", "hanging", left_shoulder_roll=0.1))
    assert beside == ({("left_thigh", "left_hand_box")} if model.nu > 27 else set())


def test_only_whoever_asks_for_it_pays(model: mujoco.MjModel) -> None:
    plain = mjcf.robot_spec(hands=model.nu > 27).compile()
    assert plain.npair == 0 < model.npair
    # Everything that meets the world is unchanged: the boxes that were added meet nothing but their pairs.
    added = {"left_foot", "right_foot", "left_hand_box", "right_hand_box"}
    for name in added & {model.geom(i).name for i in range(model.ngeom)}:
        assert not model.geom(name).contype[0] and not model.geom(name).conaffinity[0]
    assert model.ngeom == plain.ngeom + (4 if model.nu > 27 else 2)
    np.testing.assert_array_equal(model.body_mass, plain.body_mass)


def test_limbs_are_stopped_by_the_engine() -> None:
    model = mjcf.robot_spec(hands=False, self_collision=True).compile()
    model.opt.gravity[:] = 0.0
    model.opt.timestep = 0.002
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    data = mujoco.MjData(model)
    for side, sign in zip(SIDES, (-1.0, 1.0), strict=True):
        data.ctrl[JOINT_INDEX[f"{side}_hip_roll_joint"]] = sign * 20.0
    for _ in range(1000):
        mujoco.mj_step(model, data)
    left, right = (data.body(f"{side}_ankle_roll_link").xpos[1] for side in SIDES)
    assert left - right > 0.07


@pytest.mark.parametrize("feet", ["spheres", "box"])
def test_both_kinds_of_feet_stand_on_the_same_corners(feet: Feet) -> None:
    spec = mjcf.robot_spec(hands=False, self_collision=True, feet=feet)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[2, 2, 0.1])
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[2] = 0.4 + 0.4 + 0.02 + 0.1632 - SOLE.z - 1e-4
    mujoco.mj_forward(model, data)
    assert data.ncon == 8
    points = data.contact.pos - data.body("left_ankle_roll_link").xpos
    left = points[data.contact.pos[:, 1] > 0.0]
    for axis, edges in enumerate((SOLE.x, SOLE.y)):
        np.testing.assert_allclose(np.unique(left[:, axis].round(4)), edges, atol=1e-4)
    np.testing.assert_allclose(data.contact.friction[:, 0], max(contact_shapes.FOOT_FRICTION, 1.0))
