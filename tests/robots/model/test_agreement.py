"""Pinocchio and MuJoCo, hands on, tell the same story; and every motor turns its own joint the right way."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from golem.robots.model import magpie_model, mjcf, pinocchio_model
from golem.robots.model.table import JOINT_NAMES, JOINTS, LINKS
from golem.types import SIDES, Array


@pytest.fixture(scope="module")
def locked_hands() -> mujoco.MjModel:
    """The robot with the fingers welded at half their opening, as the Pinocchio model has them.

    The crank's hinge is removed after turning crank and finger by the angle it would have.
    """
    spec = mjcf.robot_spec()
    for equality in list(spec.equalities):
        spec.delete(equality)
    for actuator in list(spec.actuators)[27:]:
        spec.delete(actuator)
    for side in SIDES:
        for finger in magpie_model.FINGERS:
            crank, blade, _ = magpie_model.finger_names(side, finger)
            half = magpie_model.MID / 2.0 * (1.0 if finger == "a" else -1.0)
            spec.body(crank).quat = [np.cos(half), np.sin(half), 0, 0]
            spec.body(blade).quat = [np.cos(half), -np.sin(half), 0, 0]
            spec.delete(spec.joint(crank))
            spec.delete(spec.joint(blade))
    return spec.compile()


def test_kinematics_mass_matrix_and_gravity_agree_with_hands_on(
    locked_hands: mujoco.MjModel, reader: type[Any], postures: Callable[[int], Array]
) -> None:
    model = pinocchio_model.build()
    data = model.createData()
    twin = reader(locked_hands)
    bodies = [*LINKS, "left_hand", "right_hand"]
    for q in postures(50):
        twin.update(q)
        pin.framesForwardKinematics(model, data, q)
        for name in bodies:
            T = data.oMf[model.getFrameId(name)]
            np.testing.assert_allclose(twin.data.body(name).xpos, T.translation, atol=1e-6)
            np.testing.assert_allclose(twin.data.body(name).xmat.reshape(3, 3), T.rotation, atol=1e-6)
        M = pin.crba(model, data, q)
        M = np.triu(M) + np.triu(M, 1).T
        np.testing.assert_allclose(twin.mass_matrix(), M, rtol=1e-6, atol=1e-8)
        gravity = pin.computeGeneralizedGravity(model, data, q)
        np.testing.assert_allclose(twin.gravity(), gravity, rtol=1e-6, atol=1e-6)


def test_sites_and_cameras_are_at_pinocchio_frames(
    robot: mujoco.MjModel, reader: type[Any], postures: Callable[[int], Array]
) -> None:
    model = pinocchio_model.build()
    data = model.createData()
    twin = reader(robot)
    for q in postures(5):
        twin.update(q)
        pin.framesForwardKinematics(model, data, q)
        for site, frame in (
            ("imu", "imu_link"), ("left_gripper", "left_gripper"), ("right_gripper", "right_gripper"),
        ):  # fmt: skip
            T = data.oMf[model.getFrameId(frame)]
            np.testing.assert_allclose(twin.data.site(site).xpos, T.translation, atol=1e-6)
            np.testing.assert_allclose(twin.data.site(site).xmat.reshape(3, 3), T.rotation, atol=1e-6)
        for camera in ("head", "left_hand", "right_hand"):
            T = data.oMf[model.getFrameId(f"{camera}_camera_optical")]
            np.testing.assert_allclose(twin.data.camera(camera).xpos, T.translation, atol=1e-6)
            # MuJoCo's cameras look along -z with y up, optical frames along z with y down.
            R = twin.data.camera(camera).xmat.reshape(3, 3) @ np.diag([1.0, -1.0, -1.0])
            np.testing.assert_allclose(R, T.rotation, atol=1e-6)


def test_cameras_look_where_they_should() -> None:
    model = pinocchio_model.build()
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.zeros(27))
    forward = data.oMf[model.getFrameId("head_camera_optical")].rotation[:, 2]
    np.testing.assert_allclose(forward, [np.cos(0.885929), 0.0, -np.sin(0.885929)], atol=1e-6)
    palm = data.oMf[model.getFrameId("left_hand_camera_optical")].rotation
    # With all joints at zero the forearm points forward: the palm camera looks forward and its image is upright.
    np.testing.assert_allclose(palm, [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], atol=1e-6)


def test_mass_matrix_of_the_moving_hand_agrees_in_the_body_joints(
    robot: mujoco.MjModel, reader: type[Any], postures: Callable[[int], Array]
) -> None:
    """The body's block of the mass matrix does not depend on whether the fingers are hinged, only on where they are."""
    model = pinocchio_model.build()
    data = model.createData()
    twin = reader(robot)
    for q in postures(5):
        twin.update(q)
        for side in SIDES:
            for finger in magpie_model.FINGERS:
                crank, blade, _ = magpie_model.finger_names(side, finger)
                twin.data.joint(crank).qpos[0], twin.data.joint(blade).qpos[0] = (magpie_model.MID, -magpie_model.MID)
        mujoco.mj_forward(robot, twin.data)
        M = pin.crba(model, data, q)
        M = np.triu(M) + np.triu(M, 1).T
        np.testing.assert_allclose(twin.mass_matrix(), M, rtol=1e-6, atol=1e-8)


def test_pinocchio_joints_are_in_motor_order() -> None:
    assert tuple(pinocchio_model.build().names)[1:] == JOINT_NAMES
    assert tuple(pinocchio_model.build(free_base=True).names)[1:] == ("base", *JOINT_NAMES)
    for free_base in (False, True):
        model = pinocchio_model.build(free_base=free_base)
        first = 6 if free_base else 0
        assert [model.joints[model.getJointId(n)].idx_v - first for n in JOINT_NAMES] == list(range(27))


def test_every_motor_turns_its_own_joint_in_the_positive_sense(robot: mujoco.MjModel) -> None:
    data = mujoco.MjData(robot)
    for index, joint in enumerate(JOINTS):
        mujoco.mj_resetData(robot, data)
        data.qpos[:3] = 0.0
        mujoco.mj_forward(robot, data)
        data.ctrl[index] = 1.0
        mujoco.mj_forward(robot, data)
        dofs = [robot.joint(name).dofadr[0] for name in JOINT_NAMES]
        np.testing.assert_array_equal(data.qfrc_actuator[dofs], np.eye(27)[index])
        # A positive angle turns the child link about its axis, right-handed.
        before = data.body(joint.child).xmat.reshape(3, 3).copy()
        data.joint(joint.name).qpos[0] += 0.1
        mujoco.mj_kinematics(robot, data)
        turn = pin.log3(before.T @ data.body(joint.child).xmat.reshape(3, 3))
        np.testing.assert_allclose(turn, 0.1 * joint.axis, atol=1e-9)


def test_total_mass_with_hands(robot: mujoco.MjModel) -> None:
    assert robot.body_mass.sum() == pytest.approx(66.984 + 2 * 0.414, abs=1e-6)
    free = pinocchio_model.build(free_base=True)
    assert pin.computeTotalMass(free) == pytest.approx(66.984 + 2 * 0.414, abs=1e-6)
