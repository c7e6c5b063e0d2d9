"""`golem bringup --rehearse`: the whole bring-up with a twin in a process of its own, and a fault it has to find."""

from __future__ import annotations

import json
import tempfile
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from golem.errors import ConfigError, check_known
from golem.hardware.servo.gains import default_gains
from golem.interfaces import public
from golem.middleware.dds.base import Qos
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.ros import names
from golem.middleware.ros.codec import dds_name
from golem.middleware.ros.future import RosError
from golem.middleware.ros.msgs.std_srvs import SetBool_Request
from golem.middleware.wire import convert
from golem.middleware.wire.struct_layout import WireError
from golem.robots.model.table import JOINT_INDEX, JOINTS
from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.bringup.base import Act, BringupConfig, Task
from golem.runtime.bringup.bringup_command import CHECKS, FILE, run_bringup
from golem.runtime.bringup.robot_link import RobotLink
from golem.runtime.live.launch import Process
from golem.runtime.live.node_setup import log_line, member
from golem.runtime.live.operator import ask
from golem.types import TICK, Array, Imu, LowCommand, LowState

FAULTS: dict[str, str] = {
    "none": "",
    "swapped_joints": "joints",
    "wrong_sign": "joints",
    "silent_estop": "estop",
    "missing_camera": "sensors",
    "tilted_imu": "state",
}
"""What can be wrong, and the check that has to find it."""
SWAPPED = JOINT_INDEX["left_hip_pitch_joint"], JOINT_INDEX["right_hip_pitch_joint"]
"""Two encoders whose plugs are in each other's place."""
FLIPPED = JOINT_INDEX["left_hip_roll_joint"]
"""One that counts the other way."""
TILT = 0.4
"""How far the IMU is turned in its mount [rad]."""


@dataclass(frozen=True)
class MiswiredTwinConfig(MujocoConfig):
    """Options of the twin.

    Attributes:
        fault: what is wrong with it, a key of `FAULTS`.
    """

    fault: str = "none"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_known("fault of a bring-up", FAULTS, self.fault)


class MiswiredTwin(MujocoRobot):
    """The twin, with a fault in what it reports; see `golem.robots.base.Robot`."""

    def __init__(self, profile: str, seed: int, posture: Array, config: MiswiredTwinConfig | None = None) -> None:
        wrong = config or MiswiredTwinConfig()
        super().__init__(profile, seed, posture, wrong)
        self._fault = wrong.fault
        if self._fault == "missing_camera":
            self.cameras = {name: info for name, info in self.cameras.items() if name != "head"}
            self.calibration = {name: T for name, T in self.calibration.items() if name != "head"}

    def joints(self) -> tuple[Array, Array, Array]:
        q, dq, tau = super().joints()
        return reported(self._fault, q), reported(self._fault, dq), reported(self._fault, tau)

    def imu(self) -> Imu:
        sample = super().imu()
        if self._fault != "tilted_imu":
            return sample
        w, x, y, z = sample.quat
        c, s = np.cos(TILT / 2.0), np.sin(TILT / 2.0)
        turned = np.array([c * w - s * x, c * x + s * w, c * y + s * z, c * z - s * y])
        return Imu(turned, sample.gyro, sample.acc)


def reported(fault: str, values: Array) -> Array:
    """Return what is reported of (27,) values of the joints under a fault; it is its own inverse."""
    out = values.copy()
    if fault == "swapped_joints":
        out[list(SWAPPED)] = values[list(reversed(SWAPPED))]
    elif fault == "wrong_sign":
        out[FLIPPED] = -values[FLIPPED]
    return out


ANGLE = 0.2
"""How far a joint is moved by hand [rad]."""
PACE = 0.4
"""How fast [rad/s]."""
NEAR = 0.05
"""Distance from where a joint was at which it is back [rad]."""


class MovingHand:
    """A hand on a twin: its motors, before any gate is there, hold it and move one joint."""

    def __init__(self, dds: DdsConfig, fault: str) -> None:
        """Take hold of the twin on the domain, which reports with `fault`."""
        self._dds, self._fault = dds, fault
        self._goal: tuple[int, float] | None = None
        self._over, self._there = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="hand", daemon=True)
        self._thread.start()

    def move(self, joint: int, by: float) -> None:
        """Move a joint `by` [rad] from where it was when the hand took hold."""
        self._goal = (joint, by)

    def back(self) -> None:
        """Put everything back, and wait until it is there, or for 10 s."""
        self._goal = None
        self._there.clear()
        self._there.wait(10.0)

    def close(self) -> None:
        """Let go for good."""
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        gains = default_gains()
        row, out = public.topic("/lowstate"), public.topic("/lowcmd")
        with member("hand", self._dds) as (participant, _):
            reader = participant.reader(names.topic(row.name), dds_name(row.type), Qos(reliable=False, depth=8))
            writer = participant.writer(names.topic(out.name), dds_name(out.type), out.qos)
            hold = at = None
            t = 0.0
            while not self._over.wait(TICK):
                state = _newest(reader.take)
                if state is None:
                    continue
                q = reported(self._fault, state.q)
                if hold is None or at is None:
                    # Inside the range, so that nothing leans on its end.
                    hold = np.clip(q, [j.lower + 0.02 for j in JOINTS], [j.upper - 0.02 for j in JOINTS])
                    at, t = hold.copy(), state.t
                wanted = hold.copy()
                if self._goal is not None:
                    wanted[self._goal[0]] += self._goal[1]
                elif np.abs(q - hold).max() < NEAR:
                    self._there.set()
                step = PACE * max(0.0, state.t - t)
                at, t = at + np.clip(wanted - at, -step, step), state.t
                zero = np.zeros_like(at)
                command = LowCommand(t=state.t, q=at, dq=zero, tau=zero, kp=gains.kp, kd=gains.kd)
                writer.write(convert.encode_low_command(command, convert.MODE_MACHINE))


class ScriptedPerson:
    """A person who does at once, and without a mistake, what is asked."""

    def __init__(self, dds: DdsConfig, fault: str) -> None:
        """Stand beside the twin on the domain that has `fault`."""
        self._dds, self._fault = dds, fault
        self._hand: MovingHand | None = None

    def tell(self, text: str) -> None:
        """Hear something."""
        log_line(text)

    def confirm(self, question: str, word: str) -> bool:
        """Say the word."""
        log_line(f"{question}\n> {word}")
        return True

    def act(self, task: Task) -> None:
        """Do it."""
        if task.act is Act.MOVE:
            self._hand = self._hand or MovingHand(self._dds, self._fault)
            self._hand.move(task.joint, ANGLE if task.positive else -ANGLE)
        elif task.act is Act.LET_GO and self._hand is not None:
            self._hand.back()
            if task.joint == len(JOINTS) - 1:
                self.leave()
        elif task.act in (Act.PRESS, Act.RELEASE) and self._fault != "silent_estop":
            self._press(task.act is Act.PRESS)

    def leave(self) -> None:
        """Let go of the robot."""
        if self._hand is not None:
            self._hand.close()
            self._hand = None

    def _press(self, pressed: bool) -> None:
        with member("button", self._dds) as (_, node):
            ask(node, "/estop/press", "std_srvs/srv/SetBool", SetBool_Request(pressed), "start the gate")


def _newest(take: Callable[[int], list]) -> LowState | None:  # type: ignore[type-arg]
    newest = None
    for sample in take(64):
        if sample.alive:
            newest = sample.payload
    try:
        return None if newest is None else convert.decode_low_state(newest)
    except WireError:
        return None


START = 180.0
"""How long the twin's start is waited for [s]."""
STACK = """
robot: {{use: 'golem.evaluation.rehearsal.rehearse:MiswiredTwin', world: open, fault: {fault}}}
profile: bench
"""


@dataclass(frozen=True)
class BringupCommandConfig(BringupConfig):
    """Bring a robot up step by step: each step is checked, and nothing goes on where one fails.

    A report is written at the end. What passed before is not repeated, but for what has to hold each time.
    """

    rehearse: bool = False
    """Do it with a twin on the domain, which is started, and a scripted person."""
    fault: str = "none"
    """What is wrong with the twin: none, swapped_joints, wrong_sign, silent_estop, missing_camera or tilted_imu."""


def run_bringup_command(config: BringupCommandConfig) -> bool:
    """Bring up the robot on the domain, or rehearse it; return whether all checks passed, or found the fault.

    Raises:
        ConfigError: an option is wrong.
        DdsError, OutputError: see `run_bringup`.
    """
    check_known("fault of a bring-up", FAULTS, config.fault)
    if not config.rehearse:
        if config.fault != "none":
            raise ConfigError("A fault is built into a twin only: add --rehearse.")
        return run_bringup(config)
    if config.dds.robot:
        raise ConfigError("A rehearsal needs no robot: leave out --robot, or --rehearse.")
    return rehearse(config, config.fault)


def rehearse(config: BringupConfig, fault: str) -> bool:
    """Do the bring-up with a twin that has `fault`; return whether it passed, or failed at the check that finds it."""
    again = [c.name for c in CHECKS if c.lasting and c.name == FAULTS[fault]]
    with tempfile.TemporaryDirectory() as folder:
        stack = Path(folder) / "miswired.yaml"
        stack.write_text(STACK.format(fault=fault), encoding="utf-8")
        person = ScriptedPerson(config.dds, fault)
        twin = Process("twin", ["twin", str(stack), *config.dds.words()])
        try:
            _wait_for_robot(config.dds)
            run_bringup(replace(config, again=(*config.again, *again)), person)
        finally:
            person.leave()
            twin.end()
    rows = json.loads((Path(config.report) / FILE).read_text(encoding="utf-8"))["checks"]
    failed = next((name for name, row in rows.items() if not row["passed"]), "")
    found = failed == FAULTS[fault]
    what = f"'{failed}' failed" if failed else "everything passed"
    log_line(f"Rehearsal with fault '{fault}': {what}; {'right' if found else 'WRONG'}.")
    return found


def _wait_for_robot(dds: DdsConfig) -> None:
    """Wait until the twin is there; a busy machine takes its time to start one. Raises RosError: it never came."""
    with member("rehearsal", dds) as (participant, node):
        link = RobotLink(participant, node, dds)
        if not link.spin(START, lambda: len(link.states) > 100):
            raise RosError(f"The twin did not start within {START:g} s.")
