"""The tree of frames is that of the URDF export, and stands where the kinematics say."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np

from golem.robots.model import magpie_model, tree
from golem.robots.model.export import export_urdf
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.model.spatial import rotation_rpy, transform
from golem.types import NUM_JOINTS, Array


def urdf() -> dict[str, tuple[str, str, Array, Array | None]]:
    """Return parent, joint, origin and axis by child of every joint of the export."""
    out: dict[str, tuple[str, str, Array, Array | None]] = {}
    for joint in ElementTree.fromstring(export_urdf(hands=True)).iter("joint"):
        origin, axis = joint.find("origin"), joint.find("axis")
        parent, child = joint.find("parent"), joint.find("child")
        assert origin is not None and parent is not None and child is not None
        xyz, rpy = (np.array(list(map(float, origin.attrib[key].split()))) for key in ("xyz", "rpy"))
        way = None if axis is None else np.array(list(map(float, axis.attrib["xyz"].split())))
        out[child.attrib["link"]] = (
            parent.attrib["link"],
            joint.attrib["name"],
            transform(xyz, rotation_rpy(*rpy)),
            way,
        )
    return out


def test_the_tree_is_that_of_the_urdf() -> None:
    known = urdf()
    assert {edge.child for edge in (*tree.HINGES, *tree.FIXED)} == {*known, "pelvis"}
    for edge in (*tree.HINGES, *tree.FIXED[1:]):
        parent, joint, T, axis = known[edge.child]
        assert edge.parent == parent
        np.testing.assert_allclose(edge.T_parent_child, T, atol=1e-9)
        if isinstance(edge, tree.Hinge):
            assert edge.joint == joint and axis is not None
            np.testing.assert_allclose(edge.axis, axis, atol=1e-12)
        else:
            assert axis is None


def test_the_chain_to_each_hand_is_that_of_the_kinematics() -> None:
    rng = np.random.default_rng(0)
    q = rng.uniform(-0.5, 0.5, NUM_JOINTS)
    poses = tree.poses(tree.angles(q, (np.full(2, 0.03), np.full(2, 0.03))))
    up: dict[str, tuple[str, Array]] = {e.child: (e.parent, e.T_parent_child) for e in tree.FIXED}
    for hinge, pose in zip(tree.HINGES, poses, strict=True):
        up[hinge.child] = (hinge.parent, pose)
    kinematics = Kinematics()
    kinematics.update(q)
    for frame in ("left_gripper", "right_hand_camera_optical", "head_camera_optical", "lidar_link"):
        T, at = np.eye(4), frame
        while at != "base_link":
            at, T_up = up[at]
            T = T_up @ T
        np.testing.assert_allclose(T, kinematics.pose(frame), atol=1e-9)


def test_the_pads_are_as_far_apart_as_the_hand_reports() -> None:
    fingers = (np.array([0.02, 0.03]), np.array([0.0, magpie_model.MAX_GAP / 2]))
    angle = tree.angles(np.zeros(NUM_JOINTS), fingers)
    cranks = angle[NUM_JOINTS:].reshape(4, 2)
    np.testing.assert_allclose(magpie_model.pad_offset(cranks[:, 0]), np.concatenate(fingers), atol=1e-9)
    np.testing.assert_allclose(cranks[:, 1], -cranks[:, 0])
