"""A robot on a domain as the checks of robots see it: it listens, and moves only after somebody confirmed.

`DomainMover` keeps it moving along paths, through its safety gate, on a thread of its own. The gate stops a robot that
is sent nothing for a tenth of a second, and who checks it must be free to compute.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem.errors import GolemError, ModuleFault
from golem.evaluation.conformance.base import Inapplicable
from golem.evaluation.conformance.robot_rig import Path
from golem.hardware.safety.base import SafetyLimits
from golem.hardware.servo.gains import default_gains
from golem.interfaces import images, lidar_convert, public
from golem.interfaces.payloads import GateState
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.dds.participant import CycloneParticipant
from golem.robots.sensors.calibration import calibrations
from golem.robots.sensors.cameras import CAMERAS
from golem.runtime.bringup.base import StepFinding, Workbench
from golem.runtime.bringup.motor_checks import check_estop, check_hoist, check_release
from golem.runtime.bringup.robot_link import PERIOD, RobotLink
from golem.runtime.live.launch import Process
from golem.runtime.live.node_setup import member
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.lockstep import start_posture
from golem.types import SIDES, Array, HandCommand, HandState, LowState, Side

RISE = 2.0
"""Time in which the gains rise from nothing [s]."""
SILENT = 5.0
"""How long a state is waited for [s]."""


class Mover:
    """Sends the joints of one robot along paths; the gate has the last word.

    Attributes:
        level: share of the servo's gains that is sent, 0 to 1.
    """

    def __init__(self, dds: DdsConfig) -> None:
        """Hold the joints of the robot on the domain where they are, as soon as the gate lets commands through."""
        self.level = 0.0
        self._dds = dds
        self._job: tuple[Path, float, float] | None = None
        self._done, self._over, self._quiet = threading.Event(), threading.Event(), threading.Event()
        self._states: list[LowState] = []
        self._fault: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="mover", daemon=True)
        self._thread.start()

    def follow(self, path: Path, seconds: float, patience: float) -> list[LowState]:
        """Send the joints along `path` for `seconds` of the robot's time; return its states, from time 0 on.

        Raises:
            GolemError: the robot's time did not pass within `patience` [s].
        """
        self._done.clear()
        self._states = []
        self._job = (path, seconds, -1.0)
        if not self._done.wait(patience) or self._fault is not None:
            raise GolemError(f"The robot's time does not pass: {self._fault or 'it fell silent'}.")
        return self._states

    def fall_silent(self) -> None:
        """Send nothing any more."""
        self._quiet.set()

    def close(self) -> None:
        """End the thread."""
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            with member("check_mover", self._dds) as (participant, node):
                link = RobotLink(participant, node, self._dds)
                if link.spin(SILENT, lambda: link.state is not None):
                    self._send(link)
        except Exception as error:  # told to whoever waits
            self._fault = error
            self._done.set()

    def _send(self, link: RobotLink) -> None:
        limits, gains = SafetyLimits.from_profile(), default_gains()
        at: Array = np.clip(link.states[-1][1].q, limits.lower, limits.upper)
        last = link.states[-1][1].t
        while not self._over.is_set():
            link.spin(10.0 * PERIOD, _newer(link, last))
            fresh = [state for _, state in link.states if state.t > last]
            for state in fresh:
                at = self._step(state, at)
            if not fresh:
                continue
            last = fresh[-1].t
            if not self._quiet.is_set():
                link.command(at, self.level * gains.kp, np.maximum(self.level * gains.kd, limits.damping))

    def _step(self, state: LowState, at: Array) -> Array:
        """Return where the joints are to be sent in answer to `state`."""
        if self._job is None:
            return at
        path, seconds, begin = self._job
        if begin < 0.0:
            begin = state.t
            self._job = (path, seconds, begin)
        passed = state.t - begin
        self._states.append(replace(state, t=passed))
        at = path(passed)
        if passed >= seconds:
            self._job = None
            self._done.set()
        return at


def _newer(link: RobotLink, last: float) -> Callable[[], bool]:
    return lambda: link.states[-1][1].t > last


HOME_PACE = 0.4
"""How fast the joints go home at first [rad/s]."""
ARMED = 20.0
"""How long a gate that was started is waited for [s]."""
REQUESTS = 4
"""How often a strict gate is asked to let commands through."""
PATIENCE = 20.0
"""How many times as long as it should take a motion may take, on a busy machine [1]; and for a picture [s]."""


class DomainRig:
    """See `RobotRig`. Every motion goes through the safety gate, which this starts after a confirmation."""

    def __init__(self, bench: Workbench, participant: CycloneParticipant, strict_gate: Callable[[], Process]) -> None:
        """Listen with the link of `bench`; its person confirms that the robot hangs.

        `strict_gate` starts a gate that stops a simulated robot as early as a real one.
        """
        self.bench, self.participant = bench, participant
        self._strict_gate = strict_gate
        self.cameras = {n: c for n, c in CAMERAS.items() if f"{n} camera" not in bench.config.without}
        self.calibration: dict[str, Array] = {name: np.eye(4) for name in self.cameras}
        self.mover: Mover | None = None
        self.estop: StepFinding | None = None
        self._refused = ""
        self._hands: RoleEndpoints | None = None
        self._at = start_posture()
        row = public.topic("/tf_static", by="robot")
        bench.link.node.subscription(row.name, row.type, self._frames, row.qos)

    def follow(self, path: Path, seconds: float) -> list[LowState]:
        """See `RobotRig`."""
        mover = self.take()
        states = mover.follow(path, seconds, PATIENCE * seconds + 5.0)
        self._at = path(seconds)
        self.spin(0.01)
        gate = self.bench.link.gate
        if gate is None or gate.state is not GateState.ACTIVE:
            raise ModuleFault("robot", str(self.bench.config.dds), f"the gate stopped it: {_why(self.bench)}")
        return states

    def rest(self, seconds: float) -> list[LowState]:
        """See `RobotRig`; a robot that was not moved yet is only listened to."""
        if self.mover is None:
            self.bench.link.states.clear()
            self.bench.link.pass_time(seconds)
            return [state for _, state in self.bench.link.states]
        at = self._at
        return self.follow(lambda t: at, seconds)

    def grip(self, side: Side, gap: float, force: float, seconds: float) -> HandState:
        """See `RobotRig`."""
        if f"{side} hand" in self.bench.config.without:
            raise Inapplicable(f"it has no {side} hand")
        self.take()
        link = self.bench.link
        if self._hands is None:
            only = {public.gripper(s, "command") for s in SIDES}
            self._hands = RoleEndpoints("stack", self.participant, link.node, only)
        hands, begin = self._hands, link.states[-1][1].t

        def passed() -> bool:
            return link.states[-1][1].t >= begin + seconds

        def send() -> None:
            hands.send(public.gripper(side, "command"), HandCommand(link.states[-1][1].t, gap, force))

        link.spin(PATIENCE * seconds, passed, send)
        return self._hear(public.gripper(side, "state"))

    def picture(self, camera: str) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """See `RobotRig`."""
        depth = images.to_depth(self._message(public.image(camera, public.DEPTH)))
        return images.to_rgb(self._message(public.image(camera, public.COLOR))), depth

    def scan(self) -> NDArray[np.float32]:
        """See `RobotRig`."""
        if "lidar" in self.bench.config.without:
            raise Inapplicable("it has no LiDAR")
        return lidar_convert.to_scan(self._message("/livox/pointcloud", skip=2)).points

    def take(self) -> Mover:
        """Return what moves the robot; the first time this asks for a confirmation, starts the gate, and goes home.

        Raises:
            Inapplicable: nobody confirmed, or the robot could not be had.
        """
        if self.mover is not None:
            return self.mover
        if self._refused:
            raise Inapplicable(self._refused)
        for step in (check_hoist, check_estop, check_release):
            try:
                finding = step(self.bench)
            except GolemError as error:
                finding = StepFinding(False, str(error))
            if step is check_estop:
                self.estop = finding
            if not finding.passed:
                self._refused = f"not moved: {finding.text}"
                raise Inapplicable(self._refused)
        return self.open()

    def guard_strictly(self) -> Mover:
        """Open a strict gate in place of the one that runs, or was killed; return what moves the robot, damped so far.

        Raises:
            GolemError: it is not armed, or does not open.
        """
        self.take()
        if self.bench.gate is not None:
            self.bench.gate.end()
        self.bench.gate, link = self._strict_gate(), self.bench.link
        link.gate = None
        if not link.spin(ARMED, lambda: link.offered("/safety/activate")) or not link.spin(
            ARMED, lambda: link.gate is not None and link.gate.state is GateState.ARMED
        ):
            raise GolemError(f"The gate is not armed: {_why(self.bench)}")
        for _ in range(REQUESTS - 1):
            with suppress(GolemError):  # a gate that was just held up asks to be asked again
                return self._activate()
            link.pass_time(1.0)
        return self._activate()

    def open(self) -> Mover:
        """Have the gate opened, let the joints go home as the gains rise, and return what moves them.

        Raises:
            GolemError: the gate does not open.
        """
        mover = self._activate()
        found = self.bench.link.states[-1][1].q.copy()

        def rise(t: float) -> Array:
            mover.level = min(1.0, t / RISE)
            return found

        self.follow(rise, RISE)
        home = start_posture()
        seconds = max(0.5, float(np.abs(home - found).max()) / HOME_PACE)
        self.follow(lambda t: found + min(1.0, t / seconds) * (home - found), seconds + 0.5)
        return mover

    def _activate(self) -> Mover:
        """Have the armed gate let commands through, and return what sends them: joints stay, without stiffness."""
        if self.mover is not None:
            self.mover.close()
        self.mover, link = Mover(self.bench.config.dds), self.bench.link
        link.pass_time(0.5)
        answer = link.ask("activate")
        if not link.spin(5.0, lambda: link.gate is not None and link.gate.state is GateState.ACTIVE):
            raise GolemError(f"The gate does not open: {answer}")
        return self.mover

    def spin(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Take what comes for `seconds`, or until `until()`; return whether that became true."""
        return self.bench.link.spin(seconds, until)

    def close(self) -> None:
        """Stop the robot, and end what was started for it."""
        if self.mover is not None:
            self.mover.close()
        if self.bench.gate is not None:
            self.bench.gate.end()

    def _hear(self, topic: str) -> Any:
        """Return the next value of a stream that the stack reads."""
        decode = public.topic(topic).decode
        assert decode is not None
        return decode(self._message(topic))

    def _message(self, topic: str, skip: int = 0) -> Any:
        """Return the next message of a topic, after `skip` others.

        Raises:
            GolemError: none comes.
        """
        row, heard = public.topic(topic, by="robot"), list[Any]()
        subscription = self.bench.link.node.subscription(row.name, row.type, heard.append, row.qos)
        try:
            if not self.spin(PATIENCE, lambda: len(heard) > skip):
                raise ModuleFault("robot", str(self.bench.config.dds), f"{topic} is silent for {PATIENCE:g} s")
        finally:
            subscription.close()
        return heard[-1]

    def _frames(self, message: Any) -> None:
        self.calibration |= {n: T for n, T in calibrations(message).items() if n in self.cameras}


def _why(bench: Workbench) -> str:
    return "it is silent" if bench.link.gate is None else bench.link.gate.why


def reaction(rig: DomainRig, act: Callable[[], None], patience: float) -> tuple[float, str]:
    """Return how long after `act` the gate stopped the robot, in robot time [s], and why; infinite where it did not.

    A simulation waits a while for a stack that is silent: its time stands still meanwhile.
    """
    link = rig.bench.link
    link.spin(0.01)
    link.stopped_at = None
    began = link.states[-1][1].t
    act()
    link.spin(patience, lambda: link.stopped_at is not None)
    if link.stopped_at is None or link.gate is None or link.gate.reason is None:
        return float("inf"), _why(rig.bench)
    return max(state.t for _, state in link.states) - began, str(link.gate.reason)
