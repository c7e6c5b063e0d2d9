"""GOLEM's words as ROS messages and back: time, poses, joints, IMU, base, hands, objects. Images: `images`.

Inside quaternions are wxyz and poses are 4x4 matrices; here, at the edge, they become xyzw. Frames are REP-103's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from golem.interfaces.nav_payloads import NavPath, OccupancyGrid
from golem.interfaces.payloads import Detections, EstopMessage, GateState, GateStatus, HandStatus, LegStatus, Reason
from golem.middleware.ros.message import NANO, CodecError
from golem.middleware.ros.msgs import diagnostic_msgs, geometry_msgs, golem_interfaces, nav_msgs, sensor_msgs
from golem.middleware.ros.msgs.builtin_interfaces import Duration, Time
from golem.middleware.ros.msgs.geometry_msgs import PoseStamped
from golem.middleware.ros.msgs.nav_msgs import Odometry
from golem.middleware.ros.msgs.std_msgs import Float64, Header
from golem.middleware.ros.msgs.tf2_msgs import TFMessage
from golem.types import Array, BaseEstimate, HandCommand, HandState, PlanarPose, Twist

POSE_COVARIANCE = np.diag(np.square([0.03, 0.03, 0.01, 0.01, 0.01, 0.03])).ravel()
"""Of position [m^2] and roll, pitch, yaw [rad^2], in odom [own: what 3 m of walking add, `golem bench estimation`; the
estimators do not follow how it grows, which is about a hundredth of the way]."""
TWIST_COVARIANCE = np.diag(np.square([0.05, 0.05, 0.05, 0.02, 0.02, 0.02])).ravel()
"""Of the linear [m^2/s^2] and the angular velocity [rad^2/s^2], in base_link [own: error allowed to the estimators; the
gyro's noise and zero]."""


def time(t: float) -> Time:
    """Return `t` [s] as a ROS time. Raises CodecError: it is not finite or does not fit into 32 bits."""
    return Time(*_sec_nanosec(t))


def duration(t: float) -> Duration:
    """Return a time span [s] as a ROS duration; the same limits as for `time`."""
    return Duration(*_sec_nanosec(t))


def seconds(time: Time | Duration) -> float:
    """Return a ROS time or duration in seconds."""
    return time.sec + time.nanosec / NANO


def header(t: float, frame: str = "") -> Header:
    """Return the header of what was measured at `t` [s] in `frame`."""
    return Header(time(t), frame)


def quaternion(wxyz: Array) -> geometry_msgs.Quaternion:
    """Return a quaternion (4,), wxyz, as ROS has it, xyzw."""
    w, x, y, z = np.asarray(wxyz, float).tolist()
    return geometry_msgs.Quaternion(x, y, z, w)


def vector(v: Array) -> geometry_msgs.Vector3:
    """Return a vector (3,)."""
    return geometry_msgs.Vector3(*np.asarray(v, float).tolist())


def pose(T: Array) -> geometry_msgs.Pose:
    """Return the pose `T` (4, 4)."""
    xyzw = _xyzw(T.tolist())
    return geometry_msgs.Pose(
        geometry_msgs.Point(*np.asarray(T[:3, 3], float).tolist()), geometry_msgs.Quaternion(*xyzw)
    )


def matrix(pose: geometry_msgs.Pose) -> Array:
    """Return a pose as (4, 4), its quaternion of any length. Raises CodecError: not finite, or no quaternion."""
    p, q = pose.position, pose.orientation
    numbers = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w])
    if not np.isfinite(numbers).all() or not 1e-6 < np.abs(numbers[3:]).max() < 1e6:
        raise CodecError(f"{numbers.tolist()} is no position (x, y, z) and quaternion (x, y, z, w).")
    T = np.eye(4)
    T[:3, :3] = _rotation(*(numbers[3:] / np.linalg.norm(numbers[3:])).tolist())
    T[:3, 3] = numbers[:3]
    return T


def transform_matrix(transform: geometry_msgs.Transform) -> Array:
    """Return a transform as (4, 4); the same limits as for `matrix`."""
    p = transform.translation
    return matrix(geometry_msgs.Pose(geometry_msgs.Point(p.x, p.y, p.z), transform.rotation))


def transforms(t: float, links: Sequence[tuple[str, str]], T_parent_child: Array) -> TFMessage:
    """Return poses (n, 4, 4) at `t` [s] of children in parents, the `links`, for /tf."""
    positions, rotations = T_parent_child[:, :3, 3].tolist(), map(_xyzw, T_parent_child.tolist())
    stamp = time(t)
    return TFMessage(
        [
            geometry_msgs.TransformStamped(
                Header(stamp, parent),
                child,
                geometry_msgs.Transform(geometry_msgs.Vector3(*xyz), geometry_msgs.Quaternion(*xyzw)),
            )
            for (parent, child), xyz, xyzw in zip(links, positions, rotations, strict=True)
        ]
    )


def joint_state(t: float, names: Sequence[str], q: Array, dq: Array, tau: Array) -> sensor_msgs.JointState:
    """Return positions [rad], velocities [rad/s] and torques [N m] of joints, each (n,); empty where not known."""
    values = (np.ascontiguousarray(v, np.float64) for v in (q, dq, tau))
    return sensor_msgs.JointState(header(t), list(names), *values)


def twist(command: Twist) -> geometry_msgs.Twist:
    """Return a velocity command in base_link."""
    return geometry_msgs.Twist(
        geometry_msgs.Vector3(command.vx, command.vy, 0.0), geometry_msgs.Vector3(0.0, 0.0, command.wz)
    )


def cmd_height(command: Twist) -> Float64:
    """Return the height of base_link in a command [m]; NaN is the lower body's own."""
    return Float64(math.nan if command.height is None else command.height)


def to_cmd_height(message: Float64) -> Twist:
    """Return a command to stand at a height [m]; NaN is the lower body's own."""
    return Twist(height=message.data)


def to_twist(message: geometry_msgs.Twist) -> Twist:
    """Return what a velocity command says of the plane: vx, vy, wz; they may be not finite."""
    return Twist(message.linear.x, message.linear.y, message.angular.z)


def odometry(estimate: BaseEstimate, rate: Array) -> Odometry:
    """Return the base's pose in odom and velocity in base_link; `rate` (3,) is angular, in base_link [rad/s]."""
    message = Odometry(header(estimate.t, "odom"), "base_link")
    message.pose.pose = pose(estimate.T_odom_base)
    message.twist.twist.linear = vector(estimate.T_odom_base[:3, :3].T @ estimate.velocity)
    message.twist.twist.angular = vector(rate)
    message.pose.covariance, message.twist.covariance = POSE_COVARIANCE, TWIST_COVARIANCE
    return message


def wrench(t: float, frame: str, values: Array) -> geometry_msgs.WrenchStamped:
    """Return what acts on the origin of `frame`, in its axes: `values` (6,), force [N] and moment [N m]."""
    return geometry_msgs.WrenchStamped(header(t, frame), geometry_msgs.Wrench(vector(values[:3]), vector(values[3:])))


def diagnostics(t: float, statuses: Sequence[diagnostic_msgs.DiagnosticStatus]) -> diagnostic_msgs.DiagnosticArray:
    """Return what is known of the health of the robot's parts."""
    return diagnostic_msgs.DiagnosticArray(header(t), list(statuses))


def diagnostic(level: int, name: str, message: str, values: Mapping[str, object]) -> diagnostic_msgs.DiagnosticStatus:
    """Return the health of one part.

    Args:
        level: `DiagnosticStatus.OK`, `WARN`, `ERROR` or `STALE`.
        name: of the part.
        message: one line for a person.
        values: figures behind it.
    """
    pairs = [diagnostic_msgs.KeyValue(key, str(value)) for key, value in values.items()]
    return diagnostic_msgs.DiagnosticStatus(level, name, message, "", pairs)


def base_estimate(estimate: BaseEstimate) -> golem_interfaces.BaseEstimate:
    """Return an estimate of the base."""
    place, velocity = pose(estimate.T_odom_base), vector(estimate.velocity)
    rest = (float(estimate.height), np.array(estimate.contact, np.float64), bool(estimate.stale))
    return golem_interfaces.BaseEstimate(header(estimate.t, "odom"), place, velocity, *rest)


def to_base_estimate(message: golem_interfaces.BaseEstimate) -> BaseEstimate:
    """Return an estimate of the base. Raises CodecError: its pose is none."""
    t, T, v = seconds(message.header.stamp), matrix(message.pose), message.velocity
    contact = np.array(message.contact)
    return BaseEstimate(t, T, np.array([v.x, v.y, v.z]), message.height, contact, message.stale)


def hand_state(state: HandState, side: str) -> golem_interfaces.HandState:
    """Return what one hand reports."""
    fingers, force = np.array(state.fingers, np.float64), np.array(state.force, np.float64)
    return golem_interfaces.HandState(header(state.t, f"{side}_gripper"), float(state.gap), fingers, force)


def to_hand_state(message: golem_interfaces.HandState) -> HandState:
    """Return what one hand reports. Raises CodecError: gap, a finger or a force is not finite."""
    fingers, force = np.array(message.fingers), np.array(message.force)
    if not np.isfinite([message.gap, *fingers, *force]).all():
        raise CodecError(f"A hand reports a gap of {message.gap} m, fingers at {fingers}, forces of {force} N.")
    return HandState(seconds(message.header.stamp), message.gap, fingers, force)


def hand_command(command: HandCommand, side: str) -> golem_interfaces.HandCommand:
    """Return what one hand is told."""
    head = header(command.t, f"{side}_gripper")
    return golem_interfaces.HandCommand(head, float(command.gap), float(command.force))


def to_hand_command(message: golem_interfaces.HandCommand) -> HandCommand:
    """Return what one hand is told. Raises CodecError: gap or force is not finite."""
    if not (math.isfinite(message.gap) and math.isfinite(message.force)):
        raise CodecError(f"The hand is told a gap of {message.gap} m and a force of {message.force} N.")
    return HandCommand(seconds(message.header.stamp), message.gap, message.force)


def hand_status(status: HandStatus, side: str) -> golem_interfaces.HandStatus:
    """Return what a hand's controller found."""
    head, force = header(max(status.t, 0.0), f"{side}_gripper"), np.array(status.force, np.float64)
    return golem_interfaces.HandStatus(head, status.state, status.gap, status.offset, force)


def leg_status(status: LegStatus) -> golem_interfaces.LegStatus:
    """Return what the lower body does."""
    return golem_interfaces.LegStatus(
        header(status.t, "base_link"), twist(status.commanded), twist(status.applied),
        cmd_height(status.commanded).data, math.nan if status.height is None else status.height, bool(status.clamped),
        status.reason, bool(status.stepping), bool(status.moving), pose(status.rest.matrix()),
        np.array(status.phase, np.float64), status.controller, status.fault or "",
    )  # fmt: skip


def sightings(seen: Detections) -> golem_interfaces.Sightings:
    """Return what a localizer found in one frame; masks stay inside."""
    objects = [
        golem_interfaces.LocalizedObject(
            o.label,
            float(o.detection.score),
            np.array(o.detection.box, np.float64),
            np.array(o.detection.center, np.float64),
            geometry_msgs.Point(*np.asarray(o.position, float).tolist()),
            np.asarray(o.points, np.float32).reshape(-1),
        )
        for o in seen.objects
    ]
    return golem_interfaces.Sightings(header(seen.t, "odom"), seen.camera, objects)


def _sec_nanosec(t: float) -> tuple[int, int]:
    if not abs(t) < 2.0**31:
        raise CodecError(f"{t} s is no time that ROS can write.")
    return divmod(round(t * NANO), NANO)


def _xyzw(R: list[list[float]]) -> list[float]:
    """Return the unit quaternion xyzw, w >= 0, of a rotation (3, 3) or pose (4, 4).

    It is scaled by its largest part (Shepperd 1978). Importing scipy for it would take a second of CPU time.
    """
    trace = R[0][0] + R[1][1] + R[2][2]
    i = max(range(3), key=lambda axis: R[axis][axis])
    j, k = (i + 1) % 3, (i + 2) % 3
    q = [0.0] * 4
    if trace > R[i][i]:
        q[:] = R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1], 1.0 + trace
    else:
        q[i], q[j], q[k] = 1.0 - trace + 2.0 * R[i][i], R[j][i] + R[i][j], R[k][i] + R[i][k]
        q[3] = R[k][j] - R[j][k]
    norm = math.copysign(math.hypot(*q), q[3])
    return [part / norm for part in q]


def _rotation(x: float, y: float, z: float, w: float) -> list[list[float]]:
    """Return the (3, 3) rotation of a unit quaternion."""
    return [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ]


def gate_status(status: GateStatus) -> golem_interfaces.SafetyStatus:
    """Return what the gate lets everybody know."""
    return golem_interfaces.SafetyStatus(header(status.t), status.state, status.reason or "", status.detail)


def to_gate_status(message: golem_interfaces.SafetyStatus) -> GateStatus:
    """Return what the gate said, at its own time; a state or a reason nobody knows is a shut gate."""
    t = seconds(message.header.stamp)
    try:
        reason = Reason(message.reason) if message.reason else None
        return GateStatus(t, GateState(message.state), reason, message.detail)
    except ValueError:
        return GateStatus(t, GateState.INIT, None, f"the gate says '{message.state}', '{message.reason}'")


def estop_frame(frame: EstopMessage) -> golem_interfaces.EstopFrame:
    """Return a frame of the emergency stop."""
    return golem_interfaces.EstopFrame(header(frame.t), frame.sequence, frame.pressed)


MAP_FRAME = "map"
"""Frame of the map."""


def occupancy_grid(grid: OccupancyGrid) -> nav_msgs.OccupancyGrid:
    """Return a map in its own frame."""
    rows, columns = grid.cells.shape
    origin = pose(grid.in_map.origin.matrix())
    info = nav_msgs.MapMetaData(time(grid.t), grid.resolution, columns, rows, origin)
    return nav_msgs.OccupancyGrid(header(grid.t, MAP_FRAME), info, grid.cells.ravel().astype(np.int8))


def to_occupancy_grid(message: nav_msgs.OccupancyGrid) -> OccupancyGrid:
    """Return a map as it was told, in its own frame."""
    info = message.info
    cells = np.asarray(message.data, np.int8).reshape(info.height, info.width)
    return OccupancyGrid(seconds(message.header.stamp), PlanarPose.of(matrix(info.origin)), info.resolution, cells)


def path(way: NavPath) -> nav_msgs.Path:
    """Return a way; each pose heads to the next."""
    headings = [math.atan2(y, x) for x, y in np.diff(way.points, axis=0).tolist()]
    headings += headings[-1:] or [0.0]
    stamp = header(way.t, way.frame)
    poses = [
        PoseStamped(stamp, pose(PlanarPose(x, y, yaw).matrix()))
        for (x, y), yaw in zip(way.points.tolist(), headings, strict=False)
    ]
    return nav_msgs.Path(stamp, poses)
