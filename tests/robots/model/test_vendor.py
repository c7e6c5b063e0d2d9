"""Our model against the vendor's, hands removed: the acceptance of the table.

Mass matrices are compared without armature: MuJoCo adds it to the diagonal (0.1 in unitree_mujoco's MJCF, as in
ours), while Pinocchio's reader of the URDF knows none. Armature is compared on its own.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from golem.robots.model import pinocchio_model
from golem.robots.model.table import FRAMES, JOINT_NAMES
from golem.types import Array

POSTURES = 200
MJCF = "h12/vendor/unitree_mujoco_h1_2/h1_2_handless.xml"
URDF = "h12/vendor/unitree_ros_h1_2_description/h1_2_handless.urdf"


@pytest.fixture(scope="module")
def vendor_mjcf(shared: Path) -> mujoco.MjModel:
    """The vendor's model without geoms: its inertias are explicit, and 31 MB of meshes say nothing about them."""
    spec = mujoco.MjSpec.from_file(str(shared / MJCF))
    for geom in list(spec.geoms):
        spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    return spec.compile()


@pytest.fixture(scope="module")
def vendor_urdf(shared: Path) -> pin.Model:
    return pin.buildModelFromUrdf(str(shared / URDF), pin.JointModelFreeFlyer())


def relative(ours: Array, theirs: Array) -> float:
    return float(np.linalg.norm(ours - theirs) / np.linalg.norm(theirs))


def symmetric(upper: Array) -> Array:
    """Pinocchio promises the upper triangle only."""
    return np.triu(upper) + np.triu(upper, 1).T


def test_total_mass_within_one_gram(bare_robot: mujoco.MjModel, vendor_mjcf: mujoco.MjModel) -> None:
    assert bare_robot.body_mass.sum() == pytest.approx(vendor_mjcf.body_mass.sum(), abs=1e-3)


def test_joint_positions_mass_matrix_and_gravity_match_the_mjcf(
    bare_robot: mujoco.MjModel, vendor_mjcf: mujoco.MjModel, reader: type[Any], postures: Callable[[int], Array]
) -> None:
    ours, theirs = reader(bare_robot), reader(vendor_mjcf)
    for q in postures(POSTURES):
        ours.update(q)
        theirs.update(q)
        # The MJCF rounds the shoulder's quaternion to six digits: 1e-6 rad, 1.2e-6 m at the wrist.
        np.testing.assert_allclose(ours.anchors(), theirs.anchors(), rtol=0, atol=2e-6)
        assert relative(ours.mass_matrix(), theirs.mass_matrix()) < 1e-4
        np.testing.assert_allclose(np.diag(ours.mass_matrix()), np.diag(theirs.mass_matrix()), rtol=1e-4)
        assert relative(ours.gravity(), theirs.gravity()) < 1e-4


def test_joint_positions_mass_matrix_and_gravity_match_the_urdf(
    vendor_urdf: pin.Model, postures: Callable[[int], Array]
) -> None:
    ours = pinocchio_model.build(hands=False, free_base=True)
    order = [vendor_urdf.getJointId(name) for name in JOINT_NAMES]
    dofs = np.array([vendor_urdf.joints[i].idx_v for i in order])
    both = np.concatenate([np.arange(6), dofs])
    data, other = ours.createData(), vendor_urdf.createData()
    base = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    for q in postures(POSTURES):
        q_ours = np.concatenate([base, q])
        q_theirs = pin.neutral(vendor_urdf)
        q_theirs[dofs + 1] = q
        pin.forwardKinematics(ours, data, q_ours)
        pin.forwardKinematics(vendor_urdf, other, q_theirs)
        for name, index in zip(JOINT_NAMES, order, strict=True):
            here = data.oMi[ours.getJointId(name)].homogeneous
            np.testing.assert_allclose(here, other.oMi[index].homogeneous, rtol=0, atol=1e-6)
        M, N = symmetric(pin.crba(ours, data, q_ours)), symmetric(pin.crba(vendor_urdf, other, q_theirs))
        assert relative(M, N[np.ix_(both, both)]) < 1e-4
        g = pin.computeGeneralizedGravity(ours, data, q_ours)
        h = pin.computeGeneralizedGravity(vendor_urdf, other, q_theirs)
        assert relative(g, h[both]) < 1e-4


def test_ranges_efforts_and_velocities_match_the_urdf(vendor_urdf: pin.Model) -> None:
    ours = pinocchio_model.build(hands=False)
    for i, name in enumerate(JOINT_NAMES):
        joint = vendor_urdf.joints[vendor_urdf.getJointId(name)]
        assert ours.lowerPositionLimit[i] == vendor_urdf.lowerPositionLimit[joint.idx_q], name
        assert ours.upperPositionLimit[i] == vendor_urdf.upperPositionLimit[joint.idx_q], name
        assert ours.upperEffortLimit[i] == vendor_urdf.upperEffortLimit[joint.idx_v], name
        assert ours.upperVelocityLimit[i] == vendor_urdf.upperVelocityLimit[joint.idx_v], name


def test_motors_passive_dynamics_and_imu_match_the_mjcf(
    bare_robot: mujoco.MjModel, vendor_mjcf: mujoco.MjModel
) -> None:
    ours, theirs = bare_robot, vendor_mjcf
    for i, name in enumerate(JOINT_NAMES):
        assert ours.actuator(i).name == ours.joint(int(ours.actuator_trnid[i, 0])).name == name
        assert theirs.joint(int(theirs.actuator_trnid[i, 0])).name == name
        np.testing.assert_array_equal(ours.actuator_ctrlrange[i], theirs.actuator_ctrlrange[i])
        a, b = ours.joint(name), theirs.joint(name)
        np.testing.assert_array_equal(a.axis, b.axis)
        np.testing.assert_array_equal(a.range, b.range)
        dof = (int(a.dofadr[0]), int(b.dofadr[0]))
        for field in ("dof_damping", "dof_armature", "dof_frictionloss"):
            assert getattr(ours, field)[dof[0]] == getattr(theirs, field)[dof[1]], (name, field)
    np.testing.assert_allclose(ours.site("imu").pos, theirs.site("imu").pos, atol=1e-9)


def test_sensor_frames_match_the_urdf(vendor_urdf: pin.Model) -> None:
    """The lidar's is not compared: the lab mounts it upside down, the vendor upright."""
    for name in ("imu_link", "camera_link"):
        frame = vendor_urdf.frames[vendor_urdf.getFrameId(name)]
        torso = vendor_urdf.frames[vendor_urdf.getFrameId(FRAMES[name].parent)]
        np.testing.assert_allclose(
            FRAMES[name].T_parent_frame, (torso.placement.inverse() * frame.placement).homogeneous, atol=1e-9
        )
