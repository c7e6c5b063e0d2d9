"""Links of model files as meshes on a tree: whose joints they hang on, where, and what is refused."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from golem.errors import ConfigError
from golem.evaluation.spheres.link_poses import link_poses
from golem.evaluation.spheres.robot_geometry import h12_geometry, read_geometry
from golem.robots.model.link_geometry import joint_names
from golem.robots.model.table import JOINT_NAMES

ARM = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="base">
      <geom type="box" size="0.1 0.1 0.1" contype="0" conaffinity="0"/>
      <body name="upper" pos="0 0 0.2">
        <joint name="shoulder" type="{kind}" axis="0 1 0" range="-1 0.5" limited="true"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.05"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def test_our_robot_has_a_link_for_every_joint_and_parents_come_first() -> None:
    links = h12_geometry().links
    assert set(JOINT_NAMES) <= {link.joint for link in links}
    assert all(link.parent < i for i, link in enumerate(links))
    assert all(np.isclose(np.linalg.norm(link.axis), 1.0) for link in links if link.kind == "hinge")
    assert sum(len(part.faces) for link in links for part in link.parts) > 1000


def test_a_file_gives_links_joints_and_closed_surfaces(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(kind="hinge"))
    base, upper = read_geometry(path).links
    assert (base.name, base.parent, base.kind) == ("base", -1, "fixed")
    assert (upper.joint, upper.parent, upper.lower, upper.upper) == ("shoulder", 0, -1.0, 0.5)
    assert upper.T_parent_link[:3, 3] == pytest.approx([0.0, 0.0, 0.2])
    assert np.abs(base.parts[0].vertices).max() == pytest.approx(0.1)
    assert upper.parts[0].vertices[:, 2].max() == pytest.approx(0.35, abs=1e-3)


def test_what_cannot_be_a_tree_of_surfaces_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(kind="ball").replace('range="-1 0.5" limited="true"', ""))
    with pytest.raises(ConfigError, match="'shoulder' is a ball joint"):
        read_geometry(path)
    inertial = "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>"
    path.write_text(f"<mujoco><worldbody><body><joint/>{inertial}</body></worldbody></mujoco>")
    with pytest.raises(ConfigError, match="has no geometry"):
        read_geometry(path)
    with pytest.raises(ConfigError, match=r"Cannot read '.*none.xml'"):
        read_geometry(tmp_path / "none.xml")


LINE = """
<mujoco>
  <compiler angle="radian"/>
  <asset><mesh name="plate" vertex="0 0 0 1 0 0 0 1 0 1 1 0" face="0 1 2 1 3 2" {inertia}/></asset>
  <worldbody>
    <body name="base">
      <geom type="box" size="0.1 0.1 0.1"/>
      <body name="a" pos="0 0 0.2" euler="0.1 0.2 0.3">
        <joint name="a" axis="0 1 0" pos="0.1 0 0" range="-1 2" limited="true" ref="0.4"/>
        <joint name="slide" type="slide" axis="1 1 0" ref="-0.2"/>
        <geom type="mesh" mesh="plate" contype="0" conaffinity="0"/>
        <body name="b" pos="0.3 0 0">
          <joint name="b" axis="0 0 1" pos="0 0.1 0" ref="0.7"/>
          <inertial pos="0 0 0" mass="1" diaginertia="{diagonal}"/>
          <geom type="sphere" size="0.1"/>
        </body>
      </body>
    </body>
  </worldbody>
  <equality>{equality}</equality>
</mujoco>
"""
FOLLOWS = '<joint joint1="b" joint2="a" polycoef="0.1 -2 0 0 0"/>'


def mjcf(folder: Path, equality: str = "", diagonal: str = "1 1 1", inertia: str = 'inertia="shell"') -> Path:
    path = folder / "line.xml"
    path.write_text(LINE.format(equality=equality, diagonal=diagonal, inertia=inertia))
    return path


def test_joints_with_a_ref_stand_where_mujoco_has_them(tmp_path: Path) -> None:
    path = mjcf(tmp_path)
    links, model = read_geometry(path).links, mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    assert joint_names(links) == ["a", "slide", "b"]
    for q in (np.zeros(3), model.qpos0, np.array([1.0, -0.3, 2.0])):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        for link, T in zip(links, link_poses(links, q), strict=True):
            if link.name in ("a", "b"):
                np.testing.assert_allclose(T[:3, 3], data.body(link.name).xpos, atol=1e-12)
                np.testing.assert_allclose(T[:3, :3].ravel(), data.body(link.name).xmat, atol=1e-12)


def test_joints_that_an_equality_couples_follow(tmp_path: Path) -> None:
    links = read_geometry(mjcf(tmp_path, FOLLOWS)).links
    assert joint_names(links) == ["a", "slide"]
    # b - 0.7 = 0.1 - 2 (a - 0.4)
    assert (links[-1].leader, links[-1].ratio, links[-1].offset) == ("a", -2.0, pytest.approx(1.6))
    assert joint_names(read_geometry(mjcf(tmp_path, FOLLOWS.replace("/>", ' active="false"/>'))).links)[-1] == "b"
    with pytest.raises(ConfigError, match="'b' follows no other by a straight line"):
        read_geometry(mjcf(tmp_path, FOLLOWS.replace("-2 0", "-2 1")))


@pytest.mark.parametrize("diagonal", ["1 1 1", "5 1 1"])
@pytest.mark.parametrize("inertia", ["", 'inertia="shell"'])
def test_what_only_dynamics_need_is_not_asked_for(diagonal: str, inertia: str, tmp_path: Path) -> None:
    links = read_geometry(mjcf(tmp_path, "", diagonal, inertia)).links
    assert [len(link.parts) for link in links] == [1, 0, 1, 1]
