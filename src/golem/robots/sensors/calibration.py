"""Where each camera sits, by calibration: a transform from where the robot's model has it."""

from __future__ import annotations

from golem.interfaces import public
from golem.interfaces import ros_convert as convert
from golem.middleware.ros.msgs.tf2_msgs import TFMessage
from golem.types import SIDES, Array

OPTICAL_FRAMES = {"head": "head_camera_optical"} | {f"{s}_hand": f"{s}_hand_camera_optical" for s in SIDES}
"""Frame of the nominal model per camera."""


def calibrations(message: TFMessage) -> dict[str, Array]:
    """Return the (4, 4) pose of each optical frame in its nominal one, by camera, as far as `message` has it.

    The drivers of the cameras publish frames of the same names, in other parents.
    """
    wanted = {(OPTICAL_FRAMES[camera], public.optical_frame(camera)): camera for camera in OPTICAL_FRAMES}
    links = ((wanted.get((link.header.frame_id, link.child_frame_id)), link) for link in message.transforms)
    return {camera: convert.transform_matrix(link.transform) for camera, link in links if camera is not None}
