"""What the robot shows of itself: time, joints, frames, description, images, hands."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from golem.interfaces import images, public, topics
from golem.interfaces import ros_convert as convert
from golem.middleware.bus import Bus, News
from golem.middleware.ros.msgs.golem_interfaces import HandCommand as HandCommandMessage
from golem.middleware.ros.msgs.rosgraph_msgs import Clock
from golem.middleware.ros.msgs.sensor_msgs import CameraInfo
from golem.middleware.ros.msgs.std_msgs import String
from golem.robots.model import tree
from golem.robots.model.export import export_urdf
from golem.robots.sensors.calibration import OPTICAL_FRAMES
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.types import SIDES, TICK, Array, LowState, Side

JOINTS = tuple(hinge.joint for hinge in tree.HINGES)
LINKS = tuple((hinge.parent, hinge.child) for hinge in tree.HINGES)


def describe(endpoints: RoleEndpoints, calibration: Mapping[str, Array]) -> None:
    """Publish what holds for good: the description, and every frame that does not move in its parent.

    Args:
        endpoints: of the robot.
        calibration: of each camera; see `Robot.calibration`. Its optical frame in /tf_static is the claimed one.
    """
    endpoints.publish("/robot_description", String(export_urdf(hands=True)))
    links = [(edge.parent, edge.child) for edge in tree.FIXED]
    poses = [edge.T_parent_child for edge in tree.FIXED]
    for camera, T in calibration.items():
        links.append((OPTICAL_FRAMES[camera], public.optical_frame(camera)))
        poses.append(T)
    endpoints.publish("/tf_static", convert.transforms(0.0, links, np.array(poses)))


class ClockOut:
    """Sends the robot's time, where anybody wants it."""

    period = TICK

    def __init__(self, endpoints: RoleEndpoints) -> None:
        """Publish on `surface`."""
        self._endpoints = endpoints

    def step(self, t: float) -> None:
        """Send the time."""
        if self._endpoints.heard("/clock"):
            self._endpoints.publish("/clock", Clock(convert.time(t)))


class JointsOut:
    """Sends the angles of all hinges, where anybody wants them."""

    period = 0.01

    def __init__(self, bus: Bus, endpoints: RoleEndpoints) -> None:
        """Publish on `surface` what is on `bus`."""
        self._bus, self._endpoints = bus, endpoints

    def step(self, t: float) -> None:
        """Send the present angles; the fingers' speeds and torques are not measured."""
        state = self._bus.latest(topics.LOW_STATE)
        if state is not None and self._endpoints.heard("/joint_states"):
            angle, none = _angles(self._bus, state), np.zeros(len(JOINTS) - len(state.q))
            dq, tau = (np.concatenate([v, none]) for v in (state.dq, state.tau))
            self._endpoints.publish("/joint_states", convert.joint_state(state.t, JOINTS, angle, dq, tau))


class FramesOut:
    """Sends every moving link in its parent, where anybody wants it."""

    period = 0.02

    def __init__(self, bus: Bus, endpoints: RoleEndpoints) -> None:
        """Publish on `surface` what is on `bus`."""
        self._bus, self._endpoints = bus, endpoints

    def step(self, t: float) -> None:
        """Send the present poses."""
        state = self._bus.latest(topics.LOW_STATE)
        if state is not None and self._endpoints.heard("/tf"):
            poses = tree.poses(_angles(self._bus, state))
            self._endpoints.publish("/tf", convert.transforms(state.t, LINKS, poses))


class CameraOut:
    """Sends the exposures of one camera, in the forms that anybody wants."""

    period = TICK

    def __init__(self, bus: Bus, endpoints: RoleEndpoints, camera: str) -> None:
        """Publish on `surface` what `camera` puts on `bus`."""
        self._endpoints = endpoints
        self._exposures = News(bus, topics.exposures(camera))
        self._frame = public.optical_frame(camera)
        self._topics = {what: public.image(camera, what) for what in public.IMAGES}

    def wanted(self) -> bool:
        """Return whether anybody wants images."""
        return self._endpoints.heard(*self._topics.values())

    def step(self, t: float) -> None:
        """Send a new exposure."""
        e = self._exposures.read()
        if e is None:
            return
        frame = self._frame

        def info() -> CameraInfo:
            return images.camera_info(e.t, e.info, frame)

        forms = {
            public.COLOR: lambda: images.color_image(e.t, e.rgb, frame),
            public.COLOR_JPEG: lambda: images.color_jpeg(e.t, e.rgb, frame),
            public.DEPTH: lambda: images.depth_image(e.t, e.depth, frame),
            public.DEPTH_PNG: lambda: images.depth_png(e.t, e.depth, frame),
            public.CAMERA_INFO: info,
            public.DEPTH_INFO: info,
        }
        for what, topic in self._topics.items():
            if self._endpoints.heard(topic):
                self._endpoints.publish(topic, forms[what]())


class HandOut:
    """Sends what one hand reports."""

    period = 0.01

    def __init__(self, bus: Bus, endpoints: RoleEndpoints, side: Side) -> None:
        """Publish on `surface` what the hand on `side` puts on `bus`."""
        self._bus, self._endpoints = bus, endpoints
        self._side: Side = side
        self._topic = public.gripper(side, "state")

    def step(self, t: float) -> None:
        """Send the present report."""
        state = self._bus.latest(topics.hand_state(self._side))
        if state is not None and self._endpoints.heard(self._topic):
            self._endpoints.publish(self._topic, convert.hand_state(state, self._side))


def take_hand_commands(bus: Bus, endpoints: RoleEndpoints, side: Side) -> None:
    """Bring what the hand on `side` is told to `bus`, whenever the node is polled."""
    topic = topics.hand_command(side)

    def take(message: HandCommandMessage) -> None:
        command = convert.to_hand_command(message)
        bus.publish(topic, command, command.t)

    endpoints.subscribe(public.gripper(side, "command"), take)


def _angles(bus: Bus, state: LowState) -> Array:
    """Return the angle of every hinge [rad]; a hand that has not reported counts as closed."""
    hands = [bus.latest(topics.hand_state(side)) for side in SIDES]
    left, right = (np.zeros(2) if hand is None else hand.fingers for hand in hands)
    return tree.angles(state.q, (left, right))
