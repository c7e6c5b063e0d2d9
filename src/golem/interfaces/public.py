"""Every public stream, service and action of a running robot, simulated or real: the one table is `public.yaml`.

What offers a row creates its endpoints from the row, `docs/reference/topics.md` is written from the rows, and tests
compare both with what running processes really offer. Names are those of ROS 2; on the wire `/x` is `rt/x`, so that
`/lowstate` and the vendor's `rt/lowstate` are the same topic.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from string import Template
from typing import Any

import numpy as np

from golem.interfaces import images, lidar_convert, topics
from golem.interfaces import ros_convert as convert
from golem.interfaces.payloads import Exposure, LegCommand
from golem.interfaces.rows import ActionRow, Role, ServiceRow, TopicRow
from golem.interfaces.unitree_api import ArmSdkCommand
from golem.middleware.dds.base import CALLS, DEFAULT, LATCHED, SENSOR, Payload, Qos
from golem.middleware.ros.msgs.rosgraph_msgs import Clock
from golem.middleware.ros.msgs.sensor_msgs import CameraInfo
from golem.middleware.ros.msgs.std_msgs import String
from golem.middleware.ros.msgs.tf2_msgs import TFMessage
from golem.middleware.ros.msgs.unitree_go import WirelessController
from golem.middleware.wire import hg
from golem.middleware.wire.convert import decode_low_command, decode_low_state, encode_low_command, encode_low_state
from golem.middleware.wire.struct_layout import WireError
from golem.package_data import load_data
from golem.types import ARMS, LEGS, NUM_JOINTS, SIDES, BaseEstimate, LowCommand, LowState, Twist

_TO_SERVO = 1
"""Index in `reserve` of the word that says whether the feed-forward torque is left to the servo."""


def encode_legs(command: LegCommand) -> bytes:
    """Return leg targets as a `LowCmd_`, zero for other motors. Raises WireError: not finite in single precision."""
    whole = {name: np.zeros(NUM_JOINTS) for name in ("q", "dq", "tau", "kp", "kd")}
    for name in ("q", "kp", "kd"):
        whole[name][LEGS] = getattr(command, name)
    if command.tau is not None:
        whole["tau"][LEGS] = command.tau
    payload = bytearray(encode_low_command(LowCommand(0.0, **whole), 0))
    hg.LOW_CMD.read(payload)["reserve"][_TO_SERVO] = command.tau is None
    hg.COMMAND_CHECKSUM.seal(payload)
    return bytes(payload)


def decode_legs(payload: Payload) -> LegCommand:
    """Return the leg targets in a `LowCmd_`. Raises WireError: see `decode_low_command`."""
    whole = decode_low_command(payload, 0.0)
    to_servo = bool(hg.LOW_CMD.read(payload)["reserve"][_TO_SERVO])
    return LegCommand(whole.q[LEGS], whole.kp[LEGS], whole.kd[LEGS], None if to_servo else whole.tau[LEGS])


WEIGHT = 27
"""Motor slot of an `/arm_sdk` command whose q is its weight (unitree_sdk2_python, example/hg/arm_sdk.py)."""
STICKS = (0.6, 0.3, 0.8)
"""Velocities at the ends of the remote control's sticks [m/s, m/s, rad/s] [own: what a user of it is used to]."""


def decode_arm_sdk(payload: Payload) -> ArmSdkCommand:
    """Return what a `LowCmd_` on `/arm_sdk` wants; modes do not count, and a checksum of 0 is none, as in examples.

    Raises WireError: the length or a checksum is wrong, or a value is not finite.
    """
    image = hg.LOW_CMD.read(payload)
    if image["crc"] and not hg.COMMAND_CHECKSUM.holds(payload):
        raise WireError("The checksum of a command on /arm_sdk is wrong.")
    motors, weight = image["motor"][ARMS], float(image["motor"]["q"][WEIGHT])
    values = np.array([motors[name] for name in ("q", "dq", "tau", "kp", "kd")], float)
    if not (np.isfinite(values).all() and np.isfinite(weight) and (values[3:] >= 0.0).all()):
        raise WireError("A command on /arm_sdk has a number that is not finite, or a negative gain.")
    return ArmSdkCommand(min(max(weight, 0.0), 1.0), values)


def decode_sticks(message: WirelessController) -> Twist:
    """Return the velocity of the sticks: left one forward and aside, right one turns. Raises WireError: not finite."""
    sticks = np.array((message.ly, -message.lx, -message.rx), float)
    if not np.isfinite(sticks).all():
        raise WireError("A stick on /wirelesscontroller is not finite.")
    return Twist(*(np.clip(sticks, -1.0, 1.0) * STICKS).tolist())


CAMERAS = ("head", "left_hand", "right_hand")
LIDAR = ("/livox/lidar", "/livox/pointcloud", "/livox/imu")
"""What there is of the LiDAR: points in two forms, and the IMU inside it."""
BASE_FRAME = "base_link"
"""Root of the robot in /tf; the link `pelvis` coincides with it."""
NEWEST = Qos(depth=1)
CLOUD = Qos(depth=20)
LOW = Qos(depth=8)
"""Reliable, so that ROS subscriptions of either kind match; short, so that nobody who is slow holds the writer up."""


def optical_frame(camera: str) -> str:
    """Return the frame of the images of a camera: z forward, x right, y down, where the calibration claims it is."""
    return "camera_color_optical_frame" if camera == "head" else f"{camera}_camera_color_optical_frame"


def image(camera: str, what: str) -> str:
    """Return the topic of one kind of image of a camera, e.g. `color/image_raw`."""
    return f"/realsense/{camera}/{what}"


def gripper(side: str, what: str) -> str:
    """Return the name of a topic or service of one hand, e.g. `state`."""
    return f"/{side}/gripper/{what}"


def wrench(side: str) -> str:
    """Return the name of the topic of what a hand feels."""
    return f"/wrench/{side}"


def contact(side: str) -> str:
    """Return the name of the topic of whether something touches a hand."""
    return f"/contact/{side}"


COLOR, COLOR_JPEG = "color/image_raw", "color/image_raw/compressed"
DEPTH, DEPTH_PNG = "aligned_depth_to_color/image_raw", "aligned_depth_to_color/image_raw/compressedDepth"
CAMERA_INFO, DEPTH_INFO = "color/camera_info", "aligned_depth_to_color/camera_info"
IMAGES = (CAMERA_INFO, DEPTH_INFO, COLOR, COLOR_JPEG, DEPTH, DEPTH_PNG)
"""What there is of each camera; first what the others are read with."""


def _clock(state: LowState) -> Clock:
    return Clock(convert.time(state.t))


def _base_link(estimate: BaseEstimate) -> TFMessage:
    return convert.transforms(estimate.t, [("odom", BASE_FRAME)], estimate.T_odom_base[np.newaxis])


def _carried() -> dict[str, tuple[Any, ...]]:
    """Return by topic its `key`, `encode` and `decode` of `TopicRow`, as far as it has them."""
    found: dict[str, tuple[Any, ...]] = {
        "/lowstate": (topics.LOW_STATE, encode_low_state, decode_low_state),
        "/lowcmd": (topics.LOW_CMD,),
        "/clock": (topics.LOW_STATE, _clock),
        "/joint_states": (topics.LOW_STATE,),
        "/tf": (topics.LOW_STATE,),
        "/tf of the stack": (topics.BASE, _base_link),
        "/livox/lidar": (topics.LIDAR_SCAN, lidar_convert.custom),
        "/livox/pointcloud": (topics.LIDAR_SCAN, lidar_convert.cloud, lidar_convert.to_scan),
        "/livox/imu": (topics.LIDAR_IMU, lidar_convert.imu, lidar_convert.to_imu),
        "/safety/lowcmd_in": (topics.LOW_CMD_REQUEST,),
        "/safety/status": (topics.SAFETY, convert.gate_status, convert.to_gate_status),
        "/estop": (topics.ESTOP, convert.estop_frame),
        "/base_estimate": (topics.BASE, convert.base_estimate, convert.to_base_estimate),
        "/odom": (topics.BASE,),
        "/map": (topics.MAP, convert.occupancy_grid, convert.to_occupancy_grid),
        "/plan": (topics.NAV_PATH, convert.path),
        "/Odometry": (topics.EXTERNAL_ODOMETRY, lidar_convert.odometry, lidar_convert.to_odometry),
        "/cmd_vel": (topics.TWIST, convert.twist, convert.to_twist),
        "/wirelesscontroller": (topics.TWIST, None, decode_sticks),
        "/arm_sdk": (topics.ARM_SDK, None, decode_arm_sdk),
        "/cmd_height": (topics.TWIST, convert.cmd_height, convert.to_cmd_height),
        "/triggered_behavior": (topics.REMOVALS, String, lambda message: message.data),
        "/legs/status": (topics.LEG_STATUS, convert.leg_status),
        "/onboard/lowcmd": (topics.ONBOARD_LEGS, encode_legs, decode_legs),
        "/pack/plan": (topics.PACK_PLAN, lambda picture: images.color_jpeg(picture.t, picture.rgb, "")),
    }
    for side in SIDES:
        state, command, status = (partial(make, side=side) for make in _OF_A_HAND)
        found[gripper(side, "state")] = topics.hand_state(side), state, convert.to_hand_state
        found[gripper(side, "command")] = topics.hand_command(side), command, convert.to_hand_command
        found[gripper(side, "status")] = topics.hand_status(side), status
        found[wrench(side)] = found[contact(side)] = (topics.LOW_STATE,)
    for camera in CAMERAS:
        for what, encode in zip(IMAGES, _of_a_camera(optical_frame(camera)), strict=True):
            found[image(camera, what)] = topics.exposures(camera), encode
        found[f"/objects/{camera}"] = topics.detections(camera), convert.sightings
    return found


_OF_A_HAND: tuple[Callable[..., Any], ...] = convert.hand_state, convert.hand_command, convert.hand_status


def _of_a_camera(frame: str) -> tuple[Callable[[Exposure], Any], ...]:
    """Return what makes the messages of `IMAGES`, in their order."""

    def info(e: Exposure) -> CameraInfo:
        return images.camera_info(e.t, e.info, frame)

    return (
        info,
        info,
        lambda e: images.color_image(e.t, e.rgb, frame),
        lambda e: images.color_jpeg(e.t, e.rgb, frame),
        lambda e: images.depth_image(e.t, e.depth, frame),
        lambda e: images.depth_png(e.t, e.depth, frame),
    )


_QOS = {"CALLS": CALLS, "CLOUD": CLOUD, "DEFAULT": DEFAULT, "LATCHED": LATCHED, "LOW": LOW, "NEWEST": NEWEST,
        "SENSOR": SENSOR}  # fmt: skip
_EACH: dict[str, list[dict[str, str]]] = {
    "camera": [{"camera": camera, "frame": optical_frame(camera)} for camera in CAMERAS],
    "side": [{"side": side} for side in SIDES],
    "service": [{"service": "loco", "robots": "an H1"}, {"service": "sport", "robots": "a G1 or an H2"}],
}
"""Words that the rows of `public.yaml` are repeated with."""


def _rows(listed: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield the rows of a list in `public.yaml`, those that are for each of something one after the other."""
    for row in listed:
        for words in _EACH[row["each"]] if "each" in row else ({},):
            for one in row.get("rows", (row,)):
                yield {k: Template(v).substitute(words) if isinstance(v, str) else v for k, v in one.items()}


def _topics(listed: list[dict[str, Any]]) -> Iterator[TopicRow]:
    carried, usual = _carried(), {"to": (), "rate": None, "frame": ""}
    for row in _rows(listed):
        of = f"{row['name']} of the {row['by']}"
        what = zip(("key", "encode", "decode"), carried.get(of, carried.get(row["name"], ())), strict=False)
        yield TopicRow(**usual | row | {"to": tuple(row.get("to", ())), "qos": _QOS[row["qos"]]} | dict(what))


_DATA = load_data(__package__, "public.yaml")
TOPICS: tuple[TopicRow, ...] = tuple(_topics(_DATA["topics"]))
TRIGGER = "std_srvs/srv/Trigger"
SERVICES: tuple[ServiceRow, ...] = tuple(ServiceRow(**row) for row in _rows(_DATA["services"]))
ACTIONS: tuple[ActionRow, ...] = tuple(ActionRow(**row) for row in _rows(_DATA["actions"]))


def topic(name: str, by: Role | None = None) -> TopicRow:
    """Return the row of the topic called `name`, of the publisher `by` where there are several."""
    return next(row for row in TOPICS if row.name == name and by in (None, row.by))
