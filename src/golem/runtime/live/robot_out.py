"""What the robot shows of itself beside what its rows of the public table say: description, links, hinges."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from golem.interfaces import public, topics
from golem.interfaces import ros_convert as convert
from golem.middleware.bus import Bus
from golem.middleware.ros.msgs.sensor_msgs import JointState
from golem.middleware.ros.msgs.std_msgs import String
from golem.middleware.ros.msgs.tf2_msgs import TFMessage
from golem.robots.model import tree
from golem.robots.model.export import export_urdf
from golem.robots.sensors.calibration import OPTICAL_FRAMES
from golem.runtime.live.bridge import Encoders
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.types import SIDES, Array, LowState

JOINTS = tuple(hinge.joint for hinge in tree.HINGES)
LINKS = tuple((hinge.parent, hinge.child) for hinge in tree.HINGES)


def describe(endpoints: RoleEndpoints, calibration: Mapping[str, Array]) -> None:
    """Publish what holds for good: the description, and every frame that does not move in its parent.

    The optical frames in /tf_static are those that `calibration` claims; see `Robot.calibration`.
    """
    endpoints.publish("/robot_description", String(export_urdf(hands=True)))
    links = [(edge.parent, edge.child) for edge in tree.FIXED]
    poses = [edge.T_parent_child for edge in tree.FIXED]
    for camera, T in calibration.items():
        links.append((OPTICAL_FRAMES[camera], public.optical_frame(camera)))
        poses.append(T)
    endpoints.publish("/tf_static", convert.transforms(0.0, links, np.array(poses)))


def encoders(bus: Bus) -> Encoders:
    """Return what makes the messages that take the hands on `bus` beside the state: of hinges and of moving links."""

    def angles(state: LowState) -> Array:
        """Return the angle of every hinge [rad]; a hand that has not reported counts as closed."""
        hands = [bus.latest(topics.hand_state(side)) for side in SIDES]
        left, right = (np.zeros(2) if hand is None else hand.fingers for hand in hands)
        return tree.angles(state.q, (left, right))

    def joint_states(state: LowState) -> JointState:
        """Return the present angles; the fingers' speeds and torques are not measured."""
        none = np.zeros(len(JOINTS) - len(state.q))
        dq, tau = (np.concatenate([v, none]) for v in (state.dq, state.tau))
        return convert.joint_state(state.t, JOINTS, angles(state), dq, tau)

    def links(state: LowState) -> TFMessage:
        """Return every moving link in its parent."""
        return convert.transforms(state.t, LINKS, tree.poses(angles(state)))

    return {"/joint_states": joint_states, "/tf": links}


def images_wanted(endpoints: RoleEndpoints, camera: str) -> bool:
    """Return whether anybody wants images of `camera`, in any form."""
    return endpoints.heard(*(public.image(camera, what) for what in public.IMAGES))


def lidar_wanted(endpoints: RoleEndpoints) -> bool:
    """Return whether anybody wants what the LiDAR says, in any form."""
    return endpoints.heard(*public.LIDAR)
