"""A small robot is packed, judged against its meshes, written and read; bad input is refused in one sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from golem.capabilities.collision.collision_model import CollisionModel
from golem.capabilities.collision.sphere_robot import load_spheres, sphere_columns
from golem.errors import ConfigError
from golem.evaluation.spheres.link_poses import hold_joints, link_poses
from golem.evaluation.spheres.pack_robot import SpheresConfig, run_spheres
from golem.evaluation.spheres.packing_report import spheres_collide
from golem.evaluation.spheres.robot_geometry import read_geometry
from golem.robots.model.link_geometry import joint_names

TWO_ARMS = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="base">
      <geom type="box" size="0.05 0.2 0.05" contype="0" conaffinity="0"/>
      <body name="left" pos="0 0.15 0.15">
        <joint name="left" axis="1 0 0" range="-1.5 1.5" limited="true"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.03" contype="0" conaffinity="0"/>
      </body>
      <body name="right" pos="0 -0.15 0.15">
        <joint name="right" axis="1 0 0" range="-1.5 1.5" limited="true"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.03" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("robot") / "two_arms.xml"
    path.write_text(TWO_ARMS)
    return path


@pytest.mark.slow
def test_a_robot_is_packed_and_nothing_is_missed(model: Path, tmp_path: Path) -> None:
    out = tmp_path / "spheres.json"
    packed = run_spheres(SpheresConfig(model, out, spheres=40, postures=300))
    assert packed.robot.pairs.tolist() == [[1, 2]]  # the arms hang on the base by one joint each
    assert packed.score.colliding > 30
    assert packed.score.missed == 0 and packed.score.false_share < 0.1
    read = load_spheres(out)
    assert joint_names(read.links) == ["left", "right"] and read.count == packed.robot.count
    for q in ([0.0, 0.0], [0.9, -0.9], [1.5, 0.0]):
        assert spheres_collide(read, np.array(q)) == spheres_collide(packed.robot, np.array(q))
    assert all((r.radii >= p.radii).all() for r, p in zip(read.packings, packed.robot.packings, strict=True))


def test_a_joint_that_is_held_stays_where_it_is(model: Path) -> None:
    links = read_geometry(model).links
    held = hold_joints(links, {"left": 0.4})
    assert joint_names(held) == ["right"]
    assert link_poses(held, np.array([0.2])) == pytest.approx(link_poses(links, np.array([0.4, 0.2])))
    with pytest.raises(ConfigError, match="Unknown joint 'middle'; valid: left, right"):
        hold_joints(links, {"middle": 0.0})


MIMIC = """
<robot name="gripper">
  <link name="palm"><visual><geometry><box size="0.1 0.3 0.02"/></geometry></visual></link>
  <link name="left"><visual><origin xyz="0 0 0.1"/><geometry><box size="0.02 0.02 0.2"/></geometry></visual></link>
  <link name="right"><visual><origin xyz="0 0 0.1"/><geometry><box size="0.02 0.02 0.2"/></geometry></visual></link>
  <joint name="left" type="revolute"><parent link="palm"/><child link="left"/><origin xyz="0 0.08 0.03"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="1"/></joint>
  <joint name="right" type="revolute"><parent link="palm"/><child link="right"/><origin xyz="0 -0.08 0.03"/>
    <axis xyz="1 0 0"/><limit lower="-1" upper="0"/><mimic joint="left" multiplier="-1"/></joint>
</robot>
"""


@pytest.mark.slow
def test_a_gripper_whose_fingers_follow_each_other_is_packed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = tmp_path / "gripper.urdf", tmp_path / "spheres.json"
    file.write_text(MIMIC)
    packed = run_spheres(SpheresConfig(file, out, spheres=40, postures=300))
    assert "Follows: right (left)." in capsys.readouterr().out
    assert packed.score.missed == 0 and 20 < packed.score.colliding < 280
    read = load_spheres(out)
    assert joint_names(read.links) == ["left"]
    for q in (0.0, 0.3, 0.7, 1.0):  # the tips meet at 0.4 rad
        assert spheres_collide(read, np.array([q])) == spheres_collide(packed.robot, np.array([q])) == (q > 0.35)
    with pytest.raises(ConfigError, match="Joint 'right' follows 'left', which can only be held here"):
        CollisionModel(read)
    link, centres, _ = sphere_columns(read)
    poses = link_poses(read.links, np.array([0.7]))[link]
    placed = np.einsum("nij,nj->ni", poses[:, :3, :3], centres) + poses[:, :3, 3]
    held = CollisionModel(read, (), {"left": 0.7}).placed(np.zeros(0))[:, :3]
    np.testing.assert_allclose(np.sort(held, axis=0), np.sort(placed, axis=0), atol=1e-9)


def test_a_urdf_without_meshes_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bare.urdf"
    inertial = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
    path.write_text(f"<robot name='bare'><link name='base'>{inertial}</link></robot>")
    with pytest.raises(ConfigError, match="has no geometry"):
        run_spheres(SpheresConfig(path))


def test_numbers_out_of_range_are_refused(model: Path) -> None:
    with pytest.raises(ConfigError, match="'two_arms' has 3 links with a surface, which take 6 or more"):
        run_spheres(SpheresConfig(model, spheres=5))
    with pytest.raises(ConfigError, match="--tolerance must be positive"):
        run_spheres(SpheresConfig(model, tolerance=0.0))


def test_a_file_that_is_none_of_ours_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "spheres.json"
    path.write_text('{"format": "other", "kind": "tight"}')
    with pytest.raises(ConfigError, match="`golem model spheres` writes one"):
        load_spheres(path)
