from __future__ import annotations

import mujoco
import numpy as np
import pytest

from golem.robots.model import contact_shapes, looks, mjcf
from golem.robots.model.looks import Loft, ring
from golem.robots.model.table import SOLE


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def test_what_is_seen_never_touches_and_weighs_nothing(robot: mujoco.MjModel) -> None:
    seen = robot.geom_group == looks.VISUAL_GROUP
    assert seen.sum() > 100
    assert not robot.geom_contype[seen].any()
    assert not robot.geom_conaffinity[seen].any()
    assert robot.nmeshface < 12_000
    assert np.all(robot.geom_group[~seen] == mjcf.COLLISION_GROUP)


def test_no_two_geoms_of_the_robot_collide_but_all_meet_the_world(robot: mujoco.MjModel) -> None:
    solid = robot.geom_group == mjcf.COLLISION_GROUP
    types, affinities = robot.geom_contype[solid], robot.geom_conaffinity[solid]
    assert not (types[:, None] & affinities[None, :]).any()
    assert np.all(affinities & contact_shapes.WORLD)
    hands = [i for i in range(robot.ngeom) if robot.geom_contype[i] == contact_shapes.HAND]
    # Housing, two blades and two pads per hand.
    assert len(hands) == 10


@pytest.fixture(scope="module")
def on_floor() -> mujoco.MjModel:
    spec = mjcf.robot_spec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[2, 2, 0.1])
    return spec.compile()


def test_soles_carry_the_weight_on_their_four_corners(on_floor: mujoco.MjModel) -> None:
    data = mujoco.MjData(on_floor)
    data.qpos[2] = 0.4 + 0.4 + 0.02 + 0.1632 - SOLE.z - 1e-4
    mujoco.mj_forward(on_floor, data)
    assert data.ncon == 8
    points = data.contact.pos - data.body("left_ankle_roll_link").xpos
    left = points[data.contact.pos[:, 1] > 0.0]
    assert sorted({round(float(x), 4) for x in left[:, 0]}) == [round(x, 4) for x in SOLE.x]
    assert sorted({round(float(y), 4) for y in left[:, 1]}) == [round(y, 4) for y in SOLE.y]


def test_a_dropped_robot_lands_on_the_floor_and_stays_finite(on_floor: mujoco.MjModel) -> None:
    data = mujoco.MjData(on_floor)
    for _ in range(1500):
        mujoco.mj_step(on_floor, data)
    assert np.isfinite(data.qpos).all()
    assert 0.03 < data.body("pelvis").xpos[2] < 0.6
    assert data.warning.number.sum() == 0


def test_imu_sensors_read_gravity_up_when_held(robot: mujoco.MjModel) -> None:
    data = mujoco.MjData(robot)
    mujoco.mj_forward(robot, data)
    data.qacc[:] = 0.0
    mujoco.mj_rnePostConstraint(robot, data)
    mujoco.mj_sensorAcc(robot, data)
    np.testing.assert_allclose(data.sensor("imu_acc").data, [0.0, 0.0, 9.81], atol=1e-9)
    np.testing.assert_allclose(data.sensor("imu_quat").data, [1.0, 0.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_loft_is_closed_with_its_faces_outward(axis: str) -> None:
    sections = [(-0.1, 0.02, 0.03, 0.05, 0.05), (0.1, 0.02, 0.03, 0.05, 0.05)]
    loft = Loft(axis, sections, power=2.0, segments=64)  # pyright: ignore[reportArgumentType]
    for shape in (loft, loft.mirrored()):
        assert volume(*shape.mesh()) == pytest.approx(np.pi * 0.05**2 * 0.2, rel=2e-3)
    vertices, mirrored = loft.mesh()[0], loft.mirrored().mesh()[0]
    np.testing.assert_allclose(mirrored.mean(axis=0), vertices.mean(axis=0) * (1, -1, 1), atol=1e-12)


def test_a_ring_is_closed_with_its_faces_outward() -> None:
    # Pappus: area of the octagon that stands for the tube, times the length of the ellipse.
    octagon = 2.0 * np.sqrt(2.0) * 0.01**2
    assert volume(*ring(0.08, 0.08, 0.01, segments=128)) == pytest.approx(octagon * 2.0 * np.pi * 0.08, rel=2e-3)
