"""Every public stream, service and action of a running robot, simulated or real: the one table of them.

What offers a row creates its endpoints from the row, `docs/reference/topics.md` is written from the rows, and tests
compare both with what running processes really offer. Names are those of ROS 2; on the wire `/x` is `rt/x`, so that
`/lowstate` and the vendor's `rt/lowstate` are the same topic.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
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
from golem.types import ARMS, LEGS, NUM_JOINTS, SIDES, BaseEstimate, LowCommand, LowState, Side, Twist

_TO_SERVO = 1
"""Index in `reserve` of the word that says whether the feed-forward torque is left to the servo."""


def encode_legs(command: LegCommand) -> bytes:
    """Return leg targets as a `LowCmd_` whose other motors get zero gains and zero torque.

    Raises:
        WireError: a value is not finite in single precision.
    """
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
    """Return the leg targets in a `LowCmd_`.

    Raises:
        WireError: see `decode_low_command`.
    """
    whole = decode_low_command(payload, 0.0)
    to_servo = bool(hg.LOW_CMD.read(payload)["reserve"][_TO_SERVO])
    return LegCommand(whole.q[LEGS], whole.kp[LEGS], whole.kd[LEGS], None if to_servo else whole.tau[LEGS])


WEIGHT = 27
"""Motor slot of an `/arm_sdk` command whose q is its weight (unitree_sdk2_python, example/hg/arm_sdk.py)."""
STICKS = (0.6, 0.3, 0.8)
"""Velocities at the ends of the remote control's sticks [m/s, m/s, rad/s] [own: what a user of it is used to]."""


def decode_arm_sdk(payload: Payload) -> ArmSdkCommand:
    """Return what a `LowCmd_` on `/arm_sdk` wants; modes do not count, and a checksum of 0 is none, as in examples.

    Raises:
        WireError: the length or a checksum is wrong, or a value is not finite.
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
    """Return the velocity that the sticks of a remote control ask for: left one forward and aside, right one to turn.

    Raises:
        WireError: one is not finite.
    """
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


# fmt: off
def _camera(camera: str) -> tuple[TopicRow, ...]:
    frame = optical_frame(camera)

    def info(e: Exposure) -> CameraInfo:
        return images.camera_info(e.t, e.info, frame)

    rows: tuple[tuple[str, str, tuple[Role, ...], str, Callable[[Exposure], Any]], ...] = (
        (COLOR, "Image", ("stack",), "Colour, rgb8.", lambda e: images.color_image(e.t, e.rgb, frame)),
        (COLOR_JPEG, "CompressedImage", (), "The same as JPEG.", lambda e: images.color_jpeg(e.t, e.rgb, frame)),
        (DEPTH, "Image", ("stack",), "Depth aligned to colour, 16UC1 [mm], 0 where there is none.",
         lambda e: images.depth_image(e.t, e.depth, frame)),
        (DEPTH_PNG, "CompressedImage", (), "The same as PNG, behind the 12 bytes of compressed_depth.",
         lambda e: images.depth_png(e.t, e.depth, frame)),
        (CAMERA_INFO, "CameraInfo", ("stack",), "Pinhole intrinsics, no distortion.", info),
        (DEPTH_INFO, "CameraInfo", (), "The same: the depth is aligned to colour.", info),
    )
    return tuple(
        TopicRow(image(camera, what), f"sensor_msgs/msg/{kind}", "robot", to, SENSOR, 15, frame, text,
                 topics.exposures(camera), encode, on_demand=True)
        for what, kind, to, text, encode in rows
    )


def _clock(state: LowState) -> Clock:
    return Clock(convert.time(state.t))


def _base_link(estimate: BaseEstimate) -> TFMessage:
    return convert.transforms(estimate.t, [("odom", BASE_FRAME)], estimate.T_odom_base[np.newaxis])


def _loco(service: str, robots: str) -> tuple[TopicRow, ...]:
    return (
        TopicRow(f"/api/{service}/request", "unitree_api/msg/Request", "stack", ("robot",), CALLS, None, "",
              f"Calls of the on-board leg controller, state and velocity, as {robots} has them. "
              "One of the two services is spoken to: see the option `robot` of `vendor`. The twin answers only where "
              "the stack file says `lower_body: {use: vendor}`, and else reports that there is no server."),
        TopicRow(f"/api/{service}/response", "unitree_api/msg/Response", "robot", ("stack",), CALLS, None, "",
              "The answers."),
    )


def _hand(side: Side) -> tuple[TopicRow, ...]:
    own, frame = "golem_interfaces/msg/", f"{side}_gripper"
    return (
        TopicRow(gripper(side, "state"), own + "HandState", "robot", ("stack",), SENSOR, 100, frame,
              "Opening, fingers and forces as the servos report them.",
              topics.hand_state(side), partial(convert.hand_state, side=side), convert.to_hand_state,
              on_demand=True, thinned=True),
        TopicRow(gripper(side, "command"), own + "HandCommand", "stack", ("robot",), SENSOR, 100, frame,
              "Opening and force that the servos are commanded.",
              topics.hand_command(side), partial(convert.hand_command, side=side), convert.to_hand_command),
        TopicRow(gripper(side, "status"), own + "HandStatus", "stack", (), DEFAULT, 10, frame,
              "What the hand's controller found: open, closing, holding, slipped, ...",
              topics.hand_status(side), partial(convert.hand_status, side=side), on_demand=True, thinned=True),
        TopicRow(wrench(side), "geometry_msgs/msg/WrenchStamped", "stack", (), DEFAULT, 100, frame,
              "What the world does to the hand, by the torques that the arm's motors report: a mean of 50 ms, for an "
              "arm that moves slowly. Errors of masses and friction, and what is held, are in it: look at its changes.",
              topics.LOW_STATE, on_demand=True, thinned=True),
        TopicRow(contact(side), own + "HandContact", "stack", (), DEFAULT, None, frame,
              "Whether something touches the hand: at every change, and ten times a second, with the covariance of "
              "what is felt.", topics.LOW_STATE, on_demand=True),
    )


TOPICS: tuple[TopicRow, ...] = (
    TopicRow("/lowstate", "unitree_hg/msg/LowState", "robot", ("safety", "stack"), LOW, 500, "",
          "Motors and torso IMU, with checksum; tick is robot time in ms and the clock of everything above the "
          "robot.",
          topics.LOW_STATE, encode_low_state, decode_low_state),
    TopicRow("/lowcmd", "unitree_hg/msg/LowCmd", "safety", ("robot", "safety"), LOW, 500, "",
          "The motor commands, with checksum; only the safety gate sends them. The twin's drives go "
          "limp 0.1 s after the last one. reserve[0] as in /safety/lowcmd_in: a simulated robot waits for answers.",
          topics.LOW_CMD),
    TopicRow("/clock", "rosgraph_msgs/msg/Clock", "robot", (), NEWEST, 500, "",
          "Robot time.",
          topics.LOW_STATE, _clock, on_demand=True),
    TopicRow("/joint_states", "sensor_msgs/msg/JointState", "robot", (), DEFAULT, 100, "",
          "The 27 joints in motor order, then the joints of the fingers.",
          topics.LOW_STATE, on_demand=True, thinned=True),
    TopicRow("/tf", "tf2_msgs/msg/TFMessage", "robot", (), DEFAULT, 50, "",
          "Every moving link in its parent.",
          topics.LOW_STATE, on_demand=True, thinned=True),
    TopicRow("/tf", "tf2_msgs/msg/TFMessage", "stack", (), DEFAULT, 50, "odom",
          "base_link in odom, by the base estimate; odom in map, where there is a map.",
          topics.BASE, _base_link, on_demand=True, thinned=True),
    TopicRow("/tf_static", "tf2_msgs/msg/TFMessage", "robot", ("stack",), LATCHED, None, "",
          "Sensor frames; those of the cameras are where their calibration claims them."),
    TopicRow("/robot_description", "std_msgs/msg/String", "robot", (), LATCHED, None, "",
          "The robot as URDF."),
    *(row for camera in CAMERAS for row in _camera(camera)),
    TopicRow("/livox/lidar", "livox_ros_driver2/msg/CustomMsg", "robot", (), CLOUD, 10, "lidar_link",
          "Points of the LiDAR in the driver's own type, each with its time.",
          topics.LIDAR_SCAN, lidar_convert.custom, on_demand=True),
    TopicRow("/livox/pointcloud", "sensor_msgs/msg/PointCloud2", "robot", ("stack",), CLOUD, 10, "lidar_link",
          "The same points, in the layout of the driver. The stack reads them where its odometry goes by them.",
          topics.LIDAR_SCAN, lidar_convert.cloud, lidar_convert.to_scan, on_demand=True),
    TopicRow("/livox/imu", "sensor_msgs/msg/Imu", "robot", ("stack",), SENSOR, 200, "lidar_link",
          "IMU inside the LiDAR, in its axes [rad/s], [m/s^2]. The vendor's driver says g: scale it before.",
          topics.LIDAR_IMU, lidar_convert.imu, lidar_convert.to_imu, on_demand=True),
    *(row for side in SIDES for row in _hand(side)),
    TopicRow("/api/motion_switcher/request", "unitree_api/msg/Request", "safety", ("robot",), CALLS, None, "",
          "Calls 1001 check, 1002 select, 1003 release: which on-board controller runs."),
    TopicRow("/api/motion_switcher/response", "unitree_api/msg/Response", "robot", ("safety",), CALLS, None, "",
          "The answers."),
    *(row for service, robots in (("loco", "an H1"), ("sport", "a G1 or an H2")) for row in _loco(service, robots)),
    TopicRow("/safety/lowcmd_in", "unitree_hg/msg/LowCmd", "stack", ("safety",), LOW, 500, "",
          "Motor commands of the stack, for the gate to judge. The field reserve[0] repeats the tick of the state "
          "it answers; the gate takes a command to be as old as that state, and refuses one with 0.",
          topics.LOW_CMD_REQUEST),
    TopicRow("/safety/status", "golem_interfaces/msg/SafetyStatus", "safety", ("stack",), LATCHED, 20, "",
          "State of the gate, and why; at every change, and regularly.",
          topics.SAFETY, convert.gate_status, convert.to_gate_status),
    TopicRow("/estop", "golem_interfaces/msg/EstopFrame", "safety", (), SENSOR, 100, "",
          "Frames of the emergency stop as the gate sees them.",
          topics.ESTOP, convert.estop_frame, on_demand=True),
    TopicRow("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "safety", (), DEFAULT, 1, "",
          "State of the gate, ages of what it watches, rate of its loop."),
    TopicRow("/base_estimate", "golem_interfaces/msg/BaseEstimate", "stack", ("safety",), LOW, 500, "odom",
          "Pose, velocity, height and contacts of the base as the stack estimates them; the gate watches "
          "`stale`.",
          topics.BASE, convert.base_estimate, convert.to_base_estimate),
    TopicRow("/odom", "nav_msgs/msg/Odometry", "stack", (), DEFAULT, 50, "odom",
          "Pose of base_link in odom and its velocity in base_link.",
          topics.BASE, on_demand=True, thinned=True),
    TopicRow("/map", "nav_msgs/msg/OccupancyGrid", "stack", (), LATCHED, None, convert.MAP_FRAME,
          "The map of the floor twice a second, where the stack listens to the LiDAR.",
          topics.MAP, convert.occupancy_grid, convert.to_occupancy_grid, on_demand=True),
    TopicRow("/plan", "nav_msgs/msg/Path", "stack", (), DEFAULT, None, convert.MAP_FRAME,
          "The way that the navigator means to go.",
          topics.NAV_PATH, convert.path, on_demand=True),
    TopicRow("/Odometry", "nav_msgs/msg/Odometry", "user", ("stack",), DEFAULT, None, "",
          "An odometry from outside, as FAST-LIO names it; `odometry: {use: topic}` goes by it.",
          topics.EXTERNAL_ODOMETRY, lidar_convert.odometry, lidar_convert.to_odometry),
    TopicRow("/cmd_vel", "geometry_msgs/msg/Twist", "user", ("stack",), DEFAULT, None, BASE_FRAME,
          "Velocity for the legs [m/s], [rad/s]; to be repeated at least every 0.5 s, or the robot stands. Ignored "
          "while a skill runs or the gate is shut; who sent any then lets go first: zero, or nothing for 1 s.",
          topics.TWIST, convert.twist, convert.to_twist),
    TopicRow("/wirelesscontroller", "unitree_go/msg/WirelessController", "user", ("stack",), DEFAULT, None, BASE_FRAME,
          "Sticks of the remote control: velocities, as on /cmd_vel. Its keys do nothing here.",
          topics.TWIST, None, decode_sticks),
    TopicRow("/arm_sdk", "unitree_hg/msg/LowCmd", "user", ("stack",), LOW, None, "",
          "What a program of the vendor's wants of motors 13 to 26; the legs stay ours. The q of slot 27 is its weight "
          "from 0 to 1. The arms follow that by 0.5 a second, also back when the program falls silent. Ignored while a "
          "skill runs or the gate is shut; who had the arms then lets go first: weight 0, or nothing for 1 s.",
          topics.ARM_SDK, None, decode_arm_sdk),
    TopicRow("/cmd_height", "std_msgs/msg/Float64", "user", ("stack",), DEFAULT, None, "",
          "Height of base_link over the ground to stand at [m]; NaN is the legs' own. It holds until the next one, a "
          "skill, or a shut gate. Legs that take none keep their own and say so in /legs/status.",
          topics.TWIST, convert.cmd_height, convert.to_cmd_height),
    TopicRow("/triggered_behavior", "std_msgs/msg/String", "user", ("stack",), DEFAULT, None, "",
          "What a gantry says before it loosens a fastener: `Remove: NAME with confidence = C`, as RAPID's cell does.",
          topics.REMOVALS, String, lambda message: message.data),
    TopicRow("/legs/status", "golem_interfaces/msg/LegStatus", "stack", (), DEFAULT, 50, BASE_FRAME,
          "The twist that the lower body was commanded, what it does, and why not more.",
          topics.LEG_STATUS, convert.leg_status, on_demand=True, thinned=True),
    TopicRow("/onboard/lowcmd", "unitree_hg/msg/LowCmd", "robot", ("stack",), LOW, 500, "",
          "What the on-board leg controller wants of the 12 leg motors while it is on, the others off. Simulation "
          "only: there it takes the way of every other command, through the gate.",
          topics.ONBOARD_LEGS, encode_legs, decode_legs),
    TopicRow("/skill/list", "golem_interfaces/msg/SkillList", "stack", (), LATCHED, None, "",
          "The skills of the stack, with the fields of their goals."),
    TopicRow("/pack/plan", "sensor_msgs/msg/CompressedImage", "stack", (), LATCHED, None, "",
          "The pack from above while `disassemble` goes by a list: what became of each fastener, stops, robot, gantry.",
          topics.PACK_PLAN, lambda picture: images.color_jpeg(picture.t, picture.rgb, ""), on_demand=True),
    *(TopicRow(f"/objects/{camera}", "golem_interfaces/msg/Sightings", "stack", (), DEFAULT, None, "odom",
            "Objects located in the frames that a skill asked for.",
            topics.detections(camera), convert.sightings) for camera in CAMERAS),
)

TRIGGER = "std_srvs/srv/Trigger"
SERVICES: tuple[ServiceRow, ...] = (
    ServiceRow("/safety/activate", TRIGGER, "safety", "Let commands through, if the gate is armed."),
    ServiceRow("/safety/stop", TRIGGER, "safety", "Stop the robot: its motors damp, then go limp."),
    ServiceRow("/safety/reset", TRIGGER, "safety", "Arm the gate again after a stop, if all is sound."),
    ServiceRow("/safety/hand_over", TRIGGER, "safety",
            "Give the lease for commands to the other of two stacks; not while the robot moves."),
    ServiceRow("/estop/press", "std_srvs/srv/SetBool", "safety",
            "Press or release the virtual emergency stop; simulation only."),
    ServiceRow("/elastic_band/release", TRIGGER, "robot", "Let the band of a standing robot go; simulation only."),
    ServiceRow("/skill/take_over", TRIGGER, "stack",
            "Take the lease for skills from who has it: whoever asks for one next gets it."),
    *(service for side in SIDES for service in (
        ServiceRow(gripper(side, "open"), TRIGGER, "stack", "Open the hand as far as it goes."),
        ServiceRow(gripper(side, "close"), TRIGGER, "stack", "Close the hand until its fingers press."),
        ServiceRow(gripper(side, "set_position"), "golem_interfaces/srv/SetGap", "stack",
                "Open or close the hand to a gap."),
        ServiceRow(gripper(side, "set_force"), "golem_interfaces/srv/SetForce", "stack",
                "Close the hand with a force."),
    )),
)

ACTIONS: tuple[ActionRow, ...] = (
    ActionRow("/skill/run", "golem_interfaces/action/RunSkill", "stack",
           "Any skill of the stack, by name, with a goal in JSON; those below have goals of their own types."),
    ActionRow("/skill/pick", "golem_interfaces/action/Pick", "stack",
           "Find an object, grasp it, pull it straight out and drop it in a container."),
    ActionRow("/skill/walk", "golem_interfaces/action/Walk", "stack", "Walk to a pose and stand there."),
    ActionRow("/skill/navigate", "golem_interfaces/action/Walk", "stack",
           "Walk to a pose, in `map`, `odom` or `base_link`, around what is in the way."),
    ActionRow("/skill/stand", "golem_interfaces/action/Stand", "stack", "Stand for a while."),
)
# fmt: on


def topic(name: str, by: Role | None = None) -> TopicRow:
    """Return the row of the topic called `name`, of the publisher `by` where there are several."""
    return next(row for row in TOPICS if row.name == name and by in (None, row.by))
