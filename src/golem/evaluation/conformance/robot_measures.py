"""What a robot promises that can be measured: joints, torques, IMU, cameras, LiDAR and hands agree with the model.

The checks know the robot's model and nothing of where it hangs. The same ones are asked of every engine, of a recording
as far as it can answer, and of a robot on a domain. Tolerances are those of the profile `field`.
"""

from __future__ import annotations

from contextlib import AbstractContextManager

import numpy as np
from numpy.typing import NDArray

from golem.evaluation.conformance.base import Candidate, Inapplicable, check
from golem.evaluation.conformance.robot_rig import OPEN, Path, RobotRig
from golem.hardware.safety.base import SafetyLimits
from golem.hardware.servo.gravity import Gravity
from golem.middleware.wire.convert import rpy
from golem.robots.model.imu_mount import TORSO
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.model.table import JOINT_INDEX, JOINT_NAMES
from golem.robots.sensors.calibration import OPTICAL_FRAMES
from golem.robots.sensors.cameras import project
from golem.runtime.lockstep import start_posture
from golem.types import GRAVITY, NUM_JOINTS, SIDES, UPPER, Array, CameraInfo, LowState

ALONG = (0.0, 0.05, 0.1, 0.15, 0.2, 0.85, 0.9, 0.95)
"""Where on the way from the wrist to the grasp frame the arm is solid; between them one can look through the hand."""
WINDOW = 4
"""Half the window around a pixel whose median depth counts [px]."""
LAYER = 0.04
"""Thickness of the layer in which the floor is looked for [m]."""
BELOW = 0.4
"""How far under the pelvis the floor is at least [m]."""


def rotated(quat: Array, inverse: bool = False) -> Array:
    """Return the world's up, (3,), turned by a quaternion wxyz; with `inverse` as the body that has it sees it."""
    w, x, y, z = quat / np.linalg.norm(quat)
    s = -1.0 if inverse else 1.0
    return np.array([2.0 * (x * z + s * w * y), 2.0 * (y * z - s * w * x), 1.0 - 2.0 * (x * x + y * y)])


def up_in_base(state: LowState, kinematics: Kinematics) -> Array:
    """Return up, (3,) in base_link, by the torso's IMU; `kinematics` is at the joints of `state`."""
    return kinematics.pose("imu_link")[:3, :3] @ rotated(state.imu.quat, inverse=True)


def gap_to_own_arm(q: Array, depth: NDArray[np.float32], info: CameraInfo, calibration: Array) -> float:
    """Return how much nearer than the axis of the right hand a camera measures it [m], a median over points.

    Args:
        q: (27,) joints [rad].
        depth: (height, width) of the head camera [m].
        calibration: (4, 4), see `golem.robots.base.Robot`.

    Returns:
        NaN where less than half of the points are in the image and were measured.
    """
    kinematics = Kinematics()
    kinematics.update(q)
    T_optical_base = np.linalg.inv(kinematics.pose(OPTICAL_FRAMES["head"]) @ calibration)
    ends = [kinematics.pose(f"right_{name}")[:3, 3] for name in ("wrist_yaw_link", "gripper")]
    nearer: list[float] = []
    for share in ALONG:
        base = ends[0] + share * (ends[1] - ends[0])
        point = T_optical_base[:3, :3] @ base + T_optical_base[:3, 3]
        u, v = np.round(project(info, point)).astype(int)
        if not (WINDOW <= u < info.width - WINDOW and WINDOW <= v < info.height - WINDOW):
            continue
        window = depth[v - WINDOW : v + WINDOW + 1, u - WINDOW : u + WINDOW + 1]
        measured = window[window > 0.0]
        if measured.size > 0.3 * window.size:
            nearer.append(float(point[2] - np.median(measured)))
    return float(np.median(nearer)) if 2 * len(nearer) >= len(ALONG) else float("nan")


def floor_normal(points: Array, up: Array) -> tuple[Array, float, float]:
    """Return normal, roughness [m] and depth [m] of the floor in a cloud.

    Args:
        points: (n, 3) in base_link [m].
        up: (3,) in base_link.

    Returns:
        (3,) upward normal; standard deviation of the points from the plane; how far base_link is above it.
    """
    height = points @ up
    low = height[height < -BELOW]
    if low.size < 100:
        return np.full(3, np.nan), float("nan"), float("nan")
    counts, edges = np.histogram(low, bins=np.arange(low.min(), low.max() + LAYER, 0.5 * LAYER))
    middle = edges[int(np.argmax(counts))] + 0.25 * LAYER
    near = points[np.abs(height - middle) < LAYER]
    centre = near.mean(axis=0)
    _, size, axes = np.linalg.svd(near - centre, full_matrices=False)
    normal = axes[2] if axes[2] @ up > 0.0 else -axes[2]
    return normal, float(size[2] / np.sqrt(len(near))), float(-(centre @ normal))


SETTLE = 1.0
"""Time in which joints come to rest [s]."""
LEAN, RATE, FORCE = 0.035, 0.03, 0.3
"""Most that a robot at rest is off by its IMU: attitude [rad], angular rate [rad/s], specific force [m/s^2]."""
SWING, ANSWERS, OTHERS = 0.25, 0.7, 0.1
"""How far a joint is sent [rad], the share of it that it has to move, and how far another may: legs swing [rad]."""
STAY = 0.4
"""How long it stays there [s]; the mean of the second half counts, as legs swing about where they are sent."""
PACE = 1.5
"""How fast [rad/s]: half of what the safety gate lets pass."""
BESIDE = 0.05
"""How far from a posture joints come to it, once from either side, so that friction cancels [rad]."""
TORQUE = 0.05
"""Most relative error of the torque that holds the arms."""
STEP, STEP_PACE, STEP_TIME = 0.1, 2.5, 0.6
"""The step response: how far [rad], how fast the command gets there [rad/s], and how long is looked [s]."""
STEPPED = tuple(
    JOINT_INDEX[f"{name}_joint"]
    for name in ("right_elbow", "right_shoulder_pitch", "right_wrist_roll", "left_hip_pitch", "left_knee")
)
LATEST, LEFT = 0.3, 0.02
"""When a step has to be half done [s], and how far from its end the mean of the second half may be [rad]."""
TURN = 0.3
"""How far the torso is turned [rad]."""
GAPS, GAP_ERROR, GRIP_ERROR = (0.09, 0.03), 0.006, 0.25
"""Openings that a hand is sent to [m], how far off it may be [m], and the relative error of its force."""
GRIP_TIME = 2.5
"""Time in which a hand gets anywhere [s]: all the way takes 1.8 s."""
PRESSED = 5.0
"""Force with which the fingers press each other [N]."""
IN_VIEW: dict[int, float] = dict(zip(range(20, 27), (-2.03, -0.15, -0.60, 2.70, -1.85, -0.39, 1.08), strict=True))
"""The right arm with its hand before the head camera: joint -> angle [rad]."""
NEARER = -0.03, 0.09
"""How much nearer than the arm's axis its surface may be measured [m]: half its thickness, and the camera's error."""


class RobotMeasures:
    """Checks for any `RobotRig`. Each begins and ends with the joints at home."""

    def rig(self, candidate: Candidate) -> AbstractContextManager[RobotRig]:
        """Return the robot, at home."""
        raise NotImplementedError

    @check
    def imu_feels_gravity(self, candidate: Candidate) -> None:
        """At rest the IMU feels 9.81 m/s^2 along the up of its own orientation, wxyz, and does not turn."""
        with self.rig(candidate) as rig:
            rig.rest(SETTLE)
            states = rig.rest(0.5)
        force = np.mean([s.imu.acc for s in states], axis=0)
        rate = float(np.linalg.norm(np.mean([s.imu.gyro for s in states], axis=0)))
        up = rotated(states[-1].imu.quat, inverse=True)
        size = float(np.linalg.norm(force))
        lean = float(np.arccos(np.clip(up @ force / max(size, 1e-9), -1.0, 1.0)))
        candidate.figures |= {"force [m/s^2]": size, "rate [rad/s]": rate, "lean [rad]": lean}
        if abs(size - GRAVITY) > FORCE:
            raise candidate.fault(f"at rest the IMU feels {size:.2f} m/s^2")
        if rate > RATE:
            raise candidate.fault(f"at rest the IMU turns at {rate:.3f} rad/s")
        if lean > LEAN:
            raise candidate.fault(f"what the IMU feels is {lean:.3f} rad off the up of its orientation")

    @check
    def imu_turns_with_the_torso(self, candidate: Candidate) -> None:
        """When the torso turns to the left, gyroscope and orientation say so, and by as much as each other."""
        with self.rig(candidate) as rig:
            states = _there_and_back(rig, TORSO, TURN)
        turned = np.unwrap([rpy(s.imu.quat)[2] for s in states])
        yaw = float(turned[-1] - turned[0])
        spin = float(np.trapezoid([s.imu.gyro[2] for s in states], [s.t for s in states]))
        joint = float(states[-1].q[TORSO] - states[0].q[TORSO])
        candidate.figures |= {"joint [rad]": joint, "orientation [rad]": yaw, "gyroscope [rad]": spin}
        if yaw * joint <= 0.0 or abs(yaw - joint) > 0.6 * abs(joint):
            raise candidate.fault(f"the torso turned by {joint:+.2f} rad, and its orientation by {yaw:+.2f}")
        if abs(spin - yaw) > 0.1 * abs(yaw) + 0.01:
            raise candidate.fault(f"the orientation turned by {yaw:+.3f} rad, the gyroscope says {spin:+.3f}")

    @check
    def each_joint_moves_alone(self, candidate: Candidate) -> None:
        """Each joint that is sent away and back goes there, in its own direction, and takes no other along."""
        limits = SafetyLimits.from_profile()
        least, most = 1.0, 0.0
        with self.rig(candidate) as rig:
            rig.rest(SETTLE)
            for joint in range(NUM_JOINTS):
                way = float(limits.middle[joint] - start_posture()[joint])
                by = float(np.copysign(min(SWING, 0.8 * max(abs(way), 0.15)), way))
                states = _there_and_back(rig, joint, by)
                stayed = [s.q for s in states if s.t > states[-1].t - 0.5 * STAY]
                moved = np.mean(stayed, axis=0) - states[0].q
                others = float(np.abs(np.delete(moved, joint)).max())
                least, most = min(least, moved[joint] / by), max(most, others)
                candidate.figures |= {"least answer [1]": float(least), "another moved [rad]": most}
                if moved[joint] / by < ANSWERS or others > OTHERS:
                    raise candidate.fault(_answered(joint, by, moved))

    @check
    def torque_is_gravity(self, candidate: Candidate) -> None:
        """The torque that holds the arms at rest is what gravity asks for by the model."""
        home = start_posture()
        aside = np.where(np.arange(NUM_JOINTS) >= UPPER.start, BESIDE, 0.0)
        reached: list[LowState] = []
        with self.rig(candidate) as rig:
            for sign in (1.0, -1.0):
                away = home + sign * aside
                rig.follow(between(home, away, 0.3), 0.3 + SETTLE)
                reached += rig.follow(between(away, home, 0.3), 0.3 + 1.5 * SETTLE)[-50:]
        arms = slice(UPPER.start + 1, UPPER.stop)
        tau, q, quat = (np.mean(v, axis=0) for v in zip(*((s.tau, s.q, s.imu.quat) for s in reached), strict=True))
        asked = Gravity().torque(q, quat)
        error = float(np.linalg.norm((tau - asked)[arms]) / np.linalg.norm(asked[arms]))
        candidate.figures |= {"relative error [1]": error, "torques of the arms [N m]": tau[arms].tolist()}
        if error > TORQUE:
            worst = UPPER.start + 1 + int(np.argmax(np.abs(tau - asked)[arms]))
            raise candidate.fault(
                f"the arms are held with {100 * error:.1f} % of another torque than gravity's; {JOINT_NAMES[worst]} "
                f"reports {tau[worst]:.2f} N m, the model says {asked[worst]:.2f}"
            )

    @check
    def answers_a_step(self, candidate: Candidate) -> None:
        """A joint that is sent 0.1 rad away with the servo's gains is there in time, and stays."""
        with self.rig(candidate) as rig:
            for joint in STEPPED:
                rig.rest(SETTLE)
                home = start_posture()
                away = home.copy()
                away[joint] += STEP
                states = rig.follow(between(home, away, STEP / STEP_PACE), STEP_TIME)
                rig.follow(between(away, home, 0.3), 0.3)
                t, moved = np.array([s.t for s in states]), np.array([s.q[joint] for s in states])
                moved = np.interp(np.arange(0.0, STEP_TIME, 0.01), t, moved - moved[0])
                half = float(np.argmax(moved > 0.5 * STEP) * 0.01) if moved.max() > 0.5 * STEP else np.inf
                name = JOINT_NAMES[joint].removesuffix("_joint")
                candidate.figures |= {
                    f"{name} half there [s]": half,
                    f"{name} over [%]": 100.0 * max(0.0, float(moved.max()) / STEP - 1.0),
                    f"{name} [rad]": moved.tolist(),
                }
                end = float(moved[len(moved) // 2 :].mean())
                if half > LATEST or abs(end - STEP) > LEFT:
                    raise candidate.fault(
                        f"{name} was sent by {STEP} rad, was half there after {half:.2f} s and then about {end:.3f}"
                    )

    @check
    def head_camera_measures_the_arm(self, candidate: Candidate) -> None:
        """The right arm, held before the head camera, is where kinematics and calibration say, and as far away."""
        home = start_posture()
        shown = home.copy()
        shown[list(IN_VIEW)] = list(IN_VIEW.values())
        seconds = float(np.abs(shown - home).max()) / (0.5 * PACE)
        with self.rig(candidate) as rig:
            if "head" not in rig.cameras:
                raise Inapplicable("it has no head camera")
            states = rig.follow(between(home, shown, seconds), seconds + SETTLE)
            _, depth = rig.picture("head")
            nearer = gap_to_own_arm(states[-1].q, depth, rig.cameras["head"], rig.calibration["head"])
            rig.follow(between(shown, home, seconds), seconds + SETTLE)
        candidate.figures["nearer than the arm's axis [m]"] = nearer
        if not NEARER[0] <= nearer <= NEARER[1]:
            raise candidate.fault(
                f"the head camera measures the arm {nearer:.3f} m nearer than its axis; {NEARER[0]} to {NEARER[1]} m "
                "are its thickness and the camera's error"
            )

    @check
    def lidar_sees_the_floor_level(self, candidate: Candidate) -> None:
        """The floor that the LiDAR sees is level by the IMU."""
        with self.rig(candidate) as rig:
            state = rig.rest(SETTLE)[-1]
            points = rig.scan()
        kinematics = Kinematics()
        kinematics.update(state.q)
        up = up_in_base(state, kinematics)
        T = kinematics.pose("lidar_link")
        normal, thick, depth = floor_normal(points @ T[:3, :3].T + T[:3, 3], up)
        lean = float(np.arccos(np.clip(normal @ up, -1.0, 1.0)))
        candidate.figures |= {
            "floor off level [rad]": lean,
            "roughness [m]": thick,
            "pelvis above it [m]": depth,
            "points [1]": float(len(points)),
        }
        if lean > LEAN or thick > 0.03:
            raise candidate.fault(f"the floor leans by {lean:.3f} rad and is {thick:.3f} m rough")

    @check
    def hands_go_where_they_are_sent(self, candidate: Candidate) -> None:
        """Each hand opens and closes as told, alone, and its fingers press each other with the force asked for."""
        with self.rig(candidate) as rig:
            for side in SIDES:
                for gap in GAPS:
                    found = rig.grip(side, gap, PRESSED, GRIP_TIME).gap
                    candidate.figures[f"{side}: gap of {gap:g} m [m]"] = found
                    if abs(found - gap) > GAP_ERROR:
                        raise candidate.fault(f"the {side} hand was sent to {gap} m and reports {found:.4f}")
                force = float(rig.grip(side, 0.0, PRESSED, GRIP_TIME).force.mean())
                rig.grip(side, OPEN, PRESSED, 1.0)
                candidate.figures[f"{side}: force of {PRESSED:g} N [N]"] = force
                if abs(force - PRESSED) > GRIP_ERROR * PRESSED:
                    raise candidate.fault(f"the {side} fingers were to press with {PRESSED} N and report {force:.2f}")


def between(a: Array, b: Array, seconds: float) -> Path:
    """Return the straight path from `a` to `b` that takes `seconds`."""
    return lambda t: a + min(1.0, t / seconds) * (b - a)


def _there_and_back(rig: RobotRig, joint: int, by: float) -> list[LowState]:
    """Send one joint away from home and back; return the states of the way there, the last when it has arrived."""
    home = start_posture()
    away = home.copy()
    away[joint] += by
    seconds = abs(by) / PACE
    there = rig.follow(between(home, away, seconds), seconds + STAY)
    rig.follow(between(away, home, seconds), seconds + STAY)
    return there


def _answered(joint: int, by: float, moved: Array) -> str:
    others = np.abs(moved)
    others[joint] = 0.0
    most = int(np.argmax(others))
    return (
        f"{JOINT_NAMES[joint]} was sent by {by:+.3f} rad and moved by {moved[joint]:+.3f}; "
        f"{JOINT_NAMES[most]} moved by {moved[most]:+.3f}"
    )
