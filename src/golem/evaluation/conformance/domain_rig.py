"""A robot on a domain as the checks of robots see it: it listens, and moves only after somebody confirmed."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem.errors import GolemError, ModuleFault
from golem.evaluation.conformance.base import Inapplicable
from golem.evaluation.conformance.domain_mover import RISE, Mover
from golem.evaluation.conformance.robot_rig import Path
from golem.interfaces import images, lidar_convert, public
from golem.interfaces.payloads import GateState
from golem.middleware.dds.participant import CycloneParticipant
from golem.robots.sensors.calibration import calibrations
from golem.robots.sensors.cameras import CAMERAS
from golem.runtime.bringup.base import StepFinding, Workbench
from golem.runtime.bringup.motor_checks import check_estop, check_hoist, check_release
from golem.runtime.live.launch import Process
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.lockstep import start_posture
from golem.types import SIDES, Array, HandCommand, HandState, LowState, Side

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

    def __init__(
        self, bench: Workbench, participant: CycloneParticipant, strict_gate: Callable[[], Process]
    ) -> None:
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
                raise ModuleFault(
                    "robot", str(self.bench.config.dds), f"{topic} is silent for {PATIENCE:g} s"
                )
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
