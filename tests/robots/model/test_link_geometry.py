"""Links of model files as meshes on a tree: whose joints they hang on, where, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.robots.model.link_geometry import h12_geometry, read_geometry
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
