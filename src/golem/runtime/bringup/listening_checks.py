"""The checks that only listen: who is on the domain, what the robot reports, and whether it can be true.

Cameras, LiDAR and hands are heard, each at its rate, and say something.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from typing import Any

import numpy as np

from golem.hardware.safety.base import SafetyLimits
from golem.hardware.safety.monitor import tilt
from golem.hardware.safety.motor_reports import MotorReports, MotorWatch
from golem.hardware.safety.senses import LIMBS
from golem.interfaces import public
from golem.interfaces.ros_convert import seconds
from golem.middleware.ros.message import CodecError
from golem.middleware.wire import convert, hg
from golem.robots.model.table import JOINT_NAMES
from golem.robots.sensors.cameras import CAMERAS
from golem.runtime.bringup.base import DEVICES, StepFinding, Workbench
from golem.types import SIDES, LowState

LISTEN = 3.0
"""Time over which states are gathered [s]."""
FREQUENCY = 500.0
"""States per second of the robot's time."""
LOST = 0.02
"""Share of states that may be lost on the way."""
UPRIGHT = 0.26
"""How far a hanging torso may lean [rad]."""
GRAVITY = (9.3, 10.3)
"""Mean specific force of a robot at rest [m/s^2]."""
STILL = 0.05
"""Mean rate of the torso of one [rad/s]: above it the gyroscope has an offset, or the robot swings."""


def check_domain(bench: Workbench) -> StepFinding:
    """One robot is there, and nobody who would command it."""
    link = bench.link
    link.spin(5.0, lambda: link.state is not None and link.others() > 0)
    link.spin(1.0)
    robots = link.writers("/lowstate")
    if not robots:
        return StepFinding(
            False, f"no robot on {bench.config.dds}: look at its power, the cable and the interface's address"
        )
    if len(robots) > 1:
        return StepFinding(False, f"{len(robots)} robots write /lowstate: {', '.join(robots)}")
    stacks = link.writers("/safety/lowcmd_in")
    if stacks:
        return StepFinding(False, f"a stack is on the domain, end it first: {', '.join(stacks)}")
    gates = [who for who in link.writers("/lowcmd") if who.startswith("golem ")]
    if gates:
        return StepFinding(False, f"a gate is on the domain, end it first: {', '.join(gates)}")
    own = link.writers("/lowcmd")
    found = {"others on the domain": float(link.others()), "other writers of /lowcmd": ", ".join(own) or "none"}
    return StepFinding(True, f"{bench.config.dds}; the robot is {robots[0]}", found)


def _turns(states: Sequence[LowState]) -> float:
    """Return how fast the IMU turns, on the mean [rad/s]."""
    return float(np.linalg.norm(np.mean([s.imu.gyro for s in states], axis=0)))


def check_state(bench: Workbench) -> StepFinding:
    """The state comes at its rate, lives, and what it says can be true."""
    link = bench.link
    link.spin(bench.config.patience, lambda: link.calm() and _turns([s for _, s in list(link.states)[-100:]]) <= STILL)
    before, heard = link.damaged, link.listen(LISTEN)
    damaged = link.damaged - before
    if len(heard) < 100:
        return StepFinding(False, f"{len(heard)} states in {LISTEN:g} s, and {damaged} that cannot be read")
    states = [s for _, s in heard]
    robot, ours = states[-1].t - states[0].t, heard[-1][0] - heard[0][0]
    rate, lost = robot / ours, 1.0 - (len(states) - 1) / (FREQUENCY * robot)
    force = np.mean([s.imu.acc for s in states], axis=0)
    spin = _turns(states)
    lean = tilt(states[-1].imu.quat)
    figures: dict[str, float | str] = {
        "states per second of the robot's time": round((len(states) - 1) / robot, 1),
        "robot's time by ours": round(rate, 3),
        "unreadable states": float(damaged),
        "specific force [m/s^2]": round(float(np.linalg.norm(force)), 2),
        "mean rate [rad/s]": round(spin, 4),
        "lean [deg]": round(float(np.degrees(lean)), 1),
        "mode_machine": float(convert.mode_machine(link.payload)),
    }
    limits = SafetyLimits.from_profile()
    mode, error, temperature, voltage = convert.motor_columns(link.payload)
    watch = MotorWatch(limits)
    reports = MotorReports(mode == hg.ENABLE, error, temperature, voltage)
    fault = next((f for f in (watch.add(reports) for _ in range(10)) if f is not None), None)
    out = np.flatnonzero((states[-1].q < limits.state_lower) | (states[-1].q > limits.state_upper))
    wrong = ""
    if damaged > 0.02 * len(heard):
        wrong = f"{damaged} states cannot be read: checksum, or another firmware"
    elif lost > LOST:
        wrong = f"{100 * lost:.0f} % of the states are lost, or its tick is no millisecond"
    elif bench.config.dds.robot and not 0.98 <= rate <= 1.02:
        wrong = f"the robot's time runs at {rate:.2f} of ours"
    elif (frozen := frozen_groups(states)) and bench.config.dds.robot:
        wrong = f"{', '.join(frozen)} repeat the very same numbers: the bus is dead"
    elif not GRAVITY[0] <= np.linalg.norm(force) <= GRAVITY[1]:
        wrong = f"the IMU feels {np.linalg.norm(force):.1f} m/s^2"
    elif spin > STILL:
        wrong = f"the IMU turns at {spin:.2f} rad/s: let the robot hang still"
    elif lean > UPRIGHT:
        wrong = f"the torso leans by {np.degrees(lean):.0f} degrees by its IMU: hang it upright"
    elif fault is not None:
        wrong = fault.detail
    elif len(out):
        wrong = f"{JOINT_NAMES[out[0]]} is out of its range at {states[-1].q[out[0]]:.2f} rad"
    return StepFinding(not wrong, wrong or "sound", figures)


def frozen_groups(states: list[LowState]) -> list[str]:
    """Return the limbs, and "IMU", whose numbers never change in `states`."""
    frozen = [
        name
        for name, part in LIMBS.items()
        if all((s.q[part] == states[0].q[part]).all() and (s.dq[part] == states[0].dq[part]).all() for s in states)
    ]
    if all((s.imu.gyro == states[0].imu.gyro).all() for s in states):
        frozen.append("IMU")
    return frozen


HEARD = 2.0
"""Time over which each device is listened to [s]."""
FIRST = 20.0
"""How long their first message is waited for [s]."""
ENOUGH = 0.5
"""Share of its rate that has to arrive here: raw images are more than some networks carry."""
SEEN = 0.05
"""Share of the head camera's depth image that has to be measured; a hand camera may look into the air."""


class DeviceEars:
    """What has come from one device: `stamps` of its messages [s], and `faults` of what they say."""

    def __init__(self, bench: Workbench, topic: str, check: Callable[[Any], str]) -> None:
        """Listen to `topic`; `check` returns what is wrong with a message, empty if nothing is."""
        row = public.topic(topic)
        self.stamps: list[float] = []
        self.faults: list[str] = []
        self._check = check
        self._subscription = bench.link.node.subscription(row.name, row.type, self._take, row.qos)

    def close(self) -> None:
        """Stop listening."""
        self._subscription.close()

    def _take(self, message: Any) -> None:
        try:
            wrong = self._check(message)
        except (CodecError, ValueError) as error:
            wrong = str(error)
        self.stamps.append(seconds(message.header.stamp))
        if wrong:
            self.faults.append(wrong)


def check_sensors(bench: Workbench) -> StepFinding:
    """Every device that was not declared absent delivers at its rate, and what it says can be used.

    One is listened to after the other: raw images of all cameras at once are more than some networks carry.
    """
    wanted = [name for name in DEVICES if name not in bench.config.without]
    wrong, figures = list[str](), dict[str, float | str]()
    for name in wanted:
        with ExitStack() as closing_time:
            ears = [closing_time.enter_context(closing(ear)) for ear in _ears(bench, name)]
            passed = _listen(bench, ears)
        for ear in ears:
            wrong += _judge(name, ear, passed, figures)
    figures |= {name: "declared absent" for name in bench.config.without}
    return StepFinding(not wrong, "; ".join(wrong) or f"{len(wanted)} devices deliver", figures)


def _listen(bench: Workbench, ears: list[DeviceEars]) -> float:
    """Wait for the first messages, then listen; return how long, in the robot's time, which devices stamp with [s]."""
    link = bench.link
    clock = link.tell_time if bench.config.dds.robot else None
    link.spin(FIRST, lambda: all(ear.stamps for ear in ears), clock)
    for ear in ears:
        ear.stamps.clear()
        ear.faults.clear()
    link.states.clear()
    link.pass_time(HEARD, clock)
    return link.states[-1][1].t - link.states[0][1].t if len(link.states) > 1 else HEARD


def _judge(name: str, ear: DeviceEars, passed: float, figures: dict[str, float | str]) -> list[str]:
    rate = len(set(ear.stamps)) / passed
    figures[f"{name} [Hz]"] = round(rate, 1)
    if not ear.stamps:
        return [f"the {name} is silent: start its driver, or declare it absent (--without)"]
    if rate < ENOUGH * _rate(name):
        return [f"the {name} delivers {rate:.1f} of {_rate(name):g} a second"]
    if len(ear.faults) > 0.5 * len(ear.stamps):
        return [f"the {name}: {ear.faults[-1]}"]
    return []


def _rate(name: str) -> float:
    device = name.removesuffix(" camera")
    return CAMERAS[device].rate if device in CAMERAS else 10.0


def _ears(bench: Workbench, name: str) -> list[DeviceEars]:
    device = name.removesuffix(" camera").removesuffix(" hand")
    if device in CAMERAS:
        color, depth = public.image(device, public.COLOR), public.image(device, public.DEPTH)
        return [
            DeviceEars(bench, color, lambda m: _color(device, m)),
            DeviceEars(bench, depth, lambda m: _depth(device, m)),
        ]
    if device in SIDES:
        return [DeviceEars(bench, public.gripper(device, "state"), lambda _: "")]
    return [DeviceEars(bench, "/livox/pointcloud", lambda m: "" if m.width * m.height else "no points")]


def _size(camera: str, message: Any) -> str:
    info = CAMERAS[camera]
    if (message.width, message.height) != (info.width, info.height):
        return f"{message.width} x {message.height}, not {info.width} x {info.height}"
    return ""


def _color(camera: str, message: Any) -> str:
    pixels = np.frombuffer(message.data, np.uint8)
    return _size(camera, message) or ("" if pixels[::97].std() > 1.0 else "its image is of one colour")


def _depth(camera: str, message: Any) -> str:
    depth = np.frombuffer(message.data, np.uint16)
    measured = np.count_nonzero(depth) / max(1, depth.size)
    blind = camera == "head" and measured < SEEN
    return _size(camera, message) or (f"depth in {100 * measured:.0f} % of its image" if blind else "")
