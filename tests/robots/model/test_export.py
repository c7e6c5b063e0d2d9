from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from golem.errors import ConfigError, OutputError
from golem.robots.model import mjcf, pinocchio_model
from golem.robots.model.export import export, export_mjcf, export_urdf
from golem.robots.model.table import JOINT_NAMES
from golem.types import Array


@pytest.mark.parametrize("hands", [False, True])
def test_mjcf_comes_back_as_the_same_model(hands: bool) -> None:
    ours, back = mjcf.robot_spec(hands).compile(), mujoco.MjModel.from_xml_string(export_mjcf(hands))
    for size in ("nq", "nv", "nu", "nbody", "ngeom", "neq", "ncam", "nsensor"):
        assert getattr(ours, size) == getattr(back, size), size
    names = [back.actuator(i).name for i in range(27)]
    assert tuple(names) == JOINT_NAMES
    for field in ("body_mass", "body_inertia", "body_pos", "jnt_range", "dof_armature", "actuator_ctrlrange"):
        np.testing.assert_allclose(getattr(ours, field), getattr(back, field), rtol=1e-5, atol=1e-9)


def test_pinocchio_reads_the_limits_of_torque_from_the_mjcf(tmp_path: Path) -> None:
    (tmp_path / "h12.xml").write_text(export_mjcf(hands=False), encoding="utf-8")
    back = pin.buildModelFromMJCF(str(tmp_path / "h12.xml"))
    efforts = [back.effortLimit[back.joints[back.getJointId(name)].idx_v] for name in JOINT_NAMES]
    np.testing.assert_allclose(efforts, mjcf.robot_spec(False).compile().actuator_ctrlrange[:27, 1])


@pytest.mark.parametrize("hands", [False, True])
def test_urdf_comes_back_in_pinocchio(hands: bool, postures: Callable[[int], Array]) -> None:
    ours = pinocchio_model.build(hands=False)
    back = pin.buildModelFromXML(export_urdf(hands))
    data, other = ours.createData(), back.createData()
    dofs = [back.joints[back.getJointId(name)].idx_q for name in JOINT_NAMES]
    for q in postures(10):
        full = pin.neutral(back)
        full[dofs] = q
        pin.framesForwardKinematics(ours, data, q)
        pin.framesForwardKinematics(back, other, full)
        for frame in ("left_wrist_yaw_link", "right_ankle_roll_link", "imu_link", "head_camera_optical"):
            here, there = data.oMf[ours.getFrameId(frame)], other.oMf[back.getFrameId(frame)]
            np.testing.assert_allclose(here.homogeneous, there.homogeneous, atol=1e-9)
        if not hands:
            g = pin.computeGeneralizedGravity(ours, data, q)
            h = pin.computeGeneralizedGravity(back, other, full)
            np.testing.assert_allclose(g, h[dofs], atol=1e-9)


def test_urdf_loads_in_mujoco_with_the_same_mass_matrix(
    bare_robot: mujoco.MjModel, reader: type[Any], postures: Callable[[int], Array]
) -> None:
    loaded = mujoco.MjModel.from_xml_string(export_urdf(hands=False))
    ours, back = reader(bare_robot), mujoco.MjData(loaded)
    dofs = [loaded.joint(name).dofadr[0] for name in JOINT_NAMES]
    for q in postures(5):
        ours.update(q)
        back.qpos[dofs] = q
        mujoco.mj_forward(loaded, back)
        full = np.zeros((loaded.nv, loaded.nv))
        mujoco.mj_fullM(loaded, back, full)
        np.testing.assert_allclose(ours.mass_matrix(), full[np.ix_(dofs, dofs)], rtol=1e-6, atol=1e-8)
    with_hands = mujoco.MjModel.from_xml_string(export_urdf(hands=True))
    assert with_hands.nv == 27 + 8


@pytest.mark.parametrize("format", ["urdf", "mjcf"])
def test_export_writes_the_file_and_nothing_else(tmp_path: Path, format: str) -> None:
    out = tmp_path / f"robot.{format}"
    out.write_text("old")
    export(format, True, out)
    assert os.listdir(tmp_path) == [out.name]
    assert "left_wrist_yaw_joint" in out.read_text(encoding="utf-8")


def test_unknown_format_names_the_valid_ones(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="Unknown model format 'udrf'; valid: mjcf, urdf"):
        export("udrf", True, tmp_path / "robot.xml")
    assert os.listdir(tmp_path) == []


def test_unwritable_path_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="Cannot write .*nowhere"):
        export("mjcf", False, tmp_path / "nowhere" / "robot.xml")
    folder = tmp_path / "folder"
    folder.mkdir()
    with pytest.raises(OutputError, match="Cannot write .*folder"):
        export("urdf", False, folder)
    assert os.listdir(tmp_path) == ["folder"]
