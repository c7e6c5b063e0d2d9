"""The Pinocchio model of the robot, built from the same table, and where its frames are."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from golem.robots.model import magpie_model
from golem.robots.model.spatial import Inertial
from golem.robots.model.table import BASE_LINK, FRAMES, JOINTS, LINKS, T_TORSO_HEAD_OPTICAL
from golem.types import SIDES, Array


class Kinematics:
    """Forward kinematics of the nominal model, computed when a frame is asked for."""

    def __init__(self) -> None:
        """Build the model with hands, fixed at base_link."""
        self._model = build(hands=True)
        self._data = self._model.createData()
        self._ids = {frame.name: i for i, frame in enumerate(self._model.frames)}
        self._q: Array | None = np.zeros(self._model.nq)

    def update(self, q: Array) -> None:
        """Set the joints `q` (27,) [rad]."""
        self._q = np.array(q, dtype=np.float64)

    def pose(self, frame: str) -> Array:
        """Return the (4, 4) pose of `frame` in base_link at the joints last set; at zero before."""
        if self._q is not None:
            pin.forwardKinematics(self._model, self._data, self._q)
            self._q = None
        return pin.updateFramePlacement(self._model, self._data, self._ids[frame]).homogeneous


_HINGES = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)


def build(hands: bool = True, free_base: bool = False) -> pin.Model:
    """Return the model.

    Joints are the 27 of the table in motor order, after a free-flyer named `base` if there is one: without it `q` and
    `v` are (27,) in motor order; with it `q` is (34,), position and quaternion xyzw of base_link first, and `v` (33,).
    The hands are rigid, with the fingers at half their opening. Armature is zero. Limits are the profile "urdf".

    Frames: every link by name, `base_link`, `imu_link`, `camera_link`, `lidar_link`, `head_camera_optical`; with hands
    also `{side}_hand`, `{side}_gripper`, `{side}_hand_camera_optical`.

    Args:
        hands: with the MAGPIE hands.
        free_base: with a floating base; otherwise base_link is the universe.
    """
    model = pin.Model()
    model.name = "golem_h12"
    root = 0
    if free_base:
        root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
        model.addJointFrame(root)
    model.appendBodyToJoint(root, _inertia(LINKS[BASE_LINK]), pin.SE3.Identity())
    placed = {BASE_LINK: root}
    _add_frame(model, BASE_LINK, root, np.eye(4), pin.FrameType.BODY)
    _add_frame(model, "base_link", root, np.eye(4))
    for joint in JOINTS:
        limits = [np.array([x]) for x in (joint.torque["urdf"], joint.velocity, joint.lower, joint.upper)]
        hinge = _HINGES[int(np.argmax(joint.axis))]()
        index = model.addJoint(placed[joint.parent], hinge, pin.SE3(joint.T_parent_joint), joint.name, *limits)
        model.addJointFrame(index)
        model.appendBodyToJoint(index, _inertia(LINKS[joint.child]), pin.SE3.Identity())
        placed[joint.child] = index
        _add_frame(model, joint.child, index, np.eye(4), pin.FrameType.BODY)
    for frame in FRAMES.values():
        _add_frame(model, frame.name, placed[frame.parent], frame.T_parent_frame)
    _add_frame(model, "head_camera_optical", placed["torso_link"], T_TORSO_HEAD_OPTICAL)
    if hands:
        for side in SIDES:
            wrist = placed[f"{side}_wrist_yaw_link"]
            T = magpie_model.T_WRIST_HAND
            model.appendBodyToJoint(wrist, _inertia(magpie_model.lump()), pin.SE3(T))
            _add_frame(model, magpie_model.hand_name(side), wrist, T, pin.FrameType.BODY)
            _add_frame(model, f"{side}_gripper", wrist, T @ magpie_model.T_HAND_GRIPPER)
            _add_frame(model, f"{side}_hand_camera_optical", wrist, T @ magpie_model.T_HAND_CAMERA)
    return model


def _inertia(body: Inertial) -> pin.Inertia:
    return pin.Inertia(body.mass, body.com, body.inertia)


def _add_frame(model: pin.Model, name: str, joint: int, T: Array, kind: pin.FrameType = pin.FrameType.OP_FRAME) -> None:
    model.addFrame(pin.Frame(name, joint, pin.SE3(T), kind), False)
