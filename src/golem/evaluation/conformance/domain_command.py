"""`golem check robot --domain N`: the suite of robots for whatever robot is on a domain."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
import tyro
from tyro.conf import OmitArgPrefixes

from golem.errors import ConfigError, GolemError
from golem.evaluation.conformance.base import Candidate, Inapplicable, check, gate
from golem.evaluation.conformance.check_command import Output, show
from golem.evaluation.conformance.domain_rig import DomainRig, reaction
from golem.evaluation.conformance.examine import run_suite
from golem.evaluation.conformance.robot_measures import RobotMeasures, between
from golem.evaluation.conformance.robot_rig import RobotRig
from golem.evaluation.rehearsal.scripted_person import ScriptedPerson
from golem.hardware.estop.estop_config import EstopConfig
from golem.interfaces import public
from golem.interfaces.payloads import GateState, Reason
from golem.interfaces.ros_convert import seconds
from golem.interfaces.rows import TopicRow
from golem.middleware.dds import discovery
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.ros import names
from golem.middleware.ros.codec import dds_name
from golem.middleware.ros.future import RosError
from golem.robots.model.table import JOINT_INDEX, JOINT_NAMES
from golem.runtime.bringup.base import Act, BringupConfig, StepFinding, Task, Workbench
from golem.runtime.bringup.bringup_command import Terminal
from golem.runtime.bringup.listening_checks import check_domain, check_state, frozen_groups
from golem.runtime.bringup.robot_link import RobotLink
from golem.runtime.bringup.sensor_checks import check_sensors
from golem.runtime.live.launch import Process
from golem.runtime.live.node_setup import log_line, member
from golem.runtime.lockstep import start_posture

RESETS = 8
"""How often a stopped gate is asked to arm again."""
PRESS, SILENCE, JUMP = 0.5, 0.2, 0.2
"""Within what robot time a pressed button, a stack that fell silent, and a clock that jumped have to stop it [s].

The gate's limit for silence is 0.1 s after the state that the last command answers; the rest is the way of its verdict.
"""
TRIES = 3
"""How often a strict gate is opened."""
STEPPED, STEP, STEP_TIME, STEP_ERROR = JOINT_INDEX["right_elbow_joint"], 0.1, 1.0, 0.03
"""What a robot that was set going again is sent: which joint, how far [rad], for how long [s], how far off [rad]."""
LIMP, LIMP_TIME = 1.0, 0.6
"""Torque below which a motor is limp [N m], and when all have to be after the gate died [s]."""


class DomainStops:
    """Checks of what stops a robot on a domain. Those that end its gate come last."""

    session: DomainRig

    @check
    def button_was_heard(self, candidate: Candidate) -> None:
        """Before the motors were had, the gate heard the emergency stop pressed, and released."""
        self.session.take()
        assert self.session.estop is not None
        judge(candidate, self.session.estop)

    @check
    def button_stops_it(self, candidate: Candidate) -> None:
        """The emergency stop, pressed while the robot moves, stops it."""
        person = self.session.bench.person
        self.session.rest(0.5)
        press = Task(Act.PRESS, "Press the emergency stop.")
        self._stops(candidate, lambda: person.act(press), PRESS, Reason.ESTOP_PRESSED)
        person.act(Task(Act.RELEASE, "Release it again."))

    @check
    def restarts(self, candidate: Candidate) -> None:
        """After a stop the gate is reset and activated again, and the robot goes home and answers a step."""
        self._reopen()
        home = start_posture()
        away = home.copy()
        away[STEPPED] += STEP
        states = self.session.follow(between(home, away, 0.2), STEP_TIME)
        self.session.follow(between(away, home, 0.2), STEP_TIME)
        moved = float(states[-1].q[STEPPED] - states[0].q[STEPPED])
        candidate.figures["step of 0.1 rad [rad]"] = moved
        if abs(moved - STEP) > STEP_ERROR:
            raise candidate.fault(f"{JOINT_NAMES[STEPPED]} was sent by {STEP} rad and moved by {moved:.3f}")

    @check
    def clock_jump_stops_it(self, candidate: Candidate) -> None:
        """A clock of the robot that jumps stops it."""
        if self.session.bench.config.dds.robot:
            raise Inapplicable("nobody makes the clock of a real robot jump")
        self.session.rest(0.5)

        def jump() -> None:
            self.session.bench.link.call("/lowstate/jump", "its clock cannot be made to jump")

        try:
            self._stops(candidate, jump, JUMP, Reason.STATE_JUMPED)
        except RosError as error:
            raise Inapplicable(str(error)) from error

    @check
    def motors_go_limp_alone(self, candidate: Candidate) -> None:
        """Motors that hear no gate any more go limp."""
        self._reopen()
        gate, link = self.session.bench.gate, self.session.bench.link
        assert gate is not None
        died = link.states[-1][1].t
        gate.kill()
        limp = math.inf

        def loose() -> bool:
            nonlocal limp
            limp = next((s.t - died for _, s in link.states if s.t > died and np.abs(s.tau).max() < LIMP), math.inf)
            return limp < math.inf

        link.spin(20.0 * LIMP_TIME, loose)
        candidate.figures["limp after the gate died [s]"] = limp
        if limp > LIMP_TIME:
            raise candidate.fault(f"the motors hold on for {limp:.2f} s after the last command")

    @check
    def silence_stops_it(self, candidate: Candidate) -> None:
        """A stack that falls silent stops it in the time of the gate's limits, also a simulation."""
        for attempt in range(1, TRIES + 1):
            try:  # a strict gate stops a robot for whatever a busy machine holds up
                mover = self.session.guard_strictly()
                break
            except GolemError as error:
                if attempt == TRIES:
                    raise Inapplicable(f"a strict gate does not let it move: {error}") from error
        self._stops(candidate, mover.fall_silent, SILENCE, Reason.COMMAND_STALE)

    def _stops(self, candidate: Candidate, act: Callable[[], None], within: float, why: Reason) -> None:
        took, reason = reaction(self.session, act, 5.0)
        candidate.figures["stopped after [s]"] = took
        if reason != why:
            raise candidate.fault(f"the gate gives the reason '{reason}', not '{why}'")
        if took > within:
            raise candidate.fault(f"it was stopped after {took:.2f} s, later than {within} s")

    def _reopen(self) -> None:
        """Arm the stopped gate again, open it, and go home."""
        self.session.take().close()
        link = self.session.bench.link
        try:
            for _ in range(RESETS):  # the motors damp for a while first, and the robot has to come to rest
                link.pass_time(1.0)
                link.ask("reset")
                if link.spin(2.0, lambda: link.gate is not None and link.gate.state is GateState.ARMED):
                    break
            self.session.open()
        except GolemError as error:
            raise Inapplicable(f"it could not be set going again: {error}") from error


def judge(candidate: Candidate, finding: StepFinding) -> None:
    """Take over what a check of a bring-up found; raises `ModuleFault` where it did not pass."""
    candidate.figures |= {name: v for name, v in finding.figures.items() if isinstance(v, float)}
    if not finding.passed:
        raise candidate.fault(finding.text)


OWN_COMPUTER = ("/onboard/lowcmd", "/api/loco/response", "/api/sport/response")
"""What a robot offers only where its own legs are used."""
DISCOVERY = 30.0
"""How long topics are waited for [s]: a simulation starts its cameras after its motors."""
STALE, EARLY = 0.5, 0.05
"""How old a stamp may be when its message comes, and how far ahead of the robot's time it may be [s]."""
STAMPED = ("/livox/imu", "/left/gripper/state", "/right/gripper/state", "/realsense/head/color/camera_info")


class DomainListening:
    """What a robot on a domain promises to whoever only listens."""

    def __init__(self, session: DomainRig) -> None:
        """Ask the robot of `session`."""
        self.session = session

    @property
    def bench(self) -> Workbench:
        """What the checks of a bring-up work with."""
        return self.session.bench

    @gate
    def is_alone(self, candidate: Candidate) -> None:
        """One robot is on the domain, and neither gate nor stack commands it."""
        judge(candidate, check_domain(self.bench))

    @gate
    def offers_its_topics(self, candidate: Candidate) -> None:
        """Every topic that a gate or a stack reads of it is offered, with the type of the table."""
        without = self.bench.config.without
        rows = [r for r in public.TOPICS if r.by == "robot" and _needed(r) and not _absent(r.name, without)]
        candidate.figures["topics [1]"] = float(len(rows))
        offered: dict[str, set[str]] = {}

        def complete() -> bool:
            offered.clear()
            for writer in discovery.writers(self.session.participant):
                offered.setdefault(writer.topic, set()).add(writer.type_name)
            return all(names.topic(row.name) in offered for row in rows)

        self.bench.link.spin(DISCOVERY, complete)
        for row in rows:
            kinds = offered.get(names.topic(row.name))
            if kinds is None:
                raise candidate.fault(f"{row.name} is not offered; is its driver running?")
            if dds_name(row.type) not in kinds:
                raise candidate.fault(f"{row.name} is {min(kinds)}, the table says {dds_name(row.type)}")

    @check
    def reports_its_state(self, candidate: Candidate) -> None:
        """Its state comes at 500 Hz with sound checksums, says what can be true, and its stamps rise by 2 ms."""
        link = self.bench.link
        link.states.clear()
        link.spin(DISCOVERY, lambda: len(link.states) > 100)  # a simulation stands still while its cameras start
        judge(candidate, check_state(self.bench))
        steps = np.diff([state.t for _, state in link.states])
        candidate.figures["longest step of the stamps [s]"] = float(steps.max())
        if steps.min() < 0.0015:
            raise candidate.fault(f"stamps of the state rise by {1e3 * steps.min():.1f} ms")

    @check
    def devices_deliver(self, candidate: Candidate) -> None:
        """Cameras, LiDAR and hands deliver images, points and openings of their size and at their rate."""
        judge(candidate, check_sensors(self.bench))

    @check
    def stamps_by_its_own_time(self, candidate: Candidate) -> None:
        """Messages of its devices are stamped with the time of its state."""
        link = self.bench.link
        for name in STAMPED:
            if _absent(name, self.bench.config.without):
                continue
            row, ages = public.topic(name, by="robot"), list[float]()

            def add(message: object, ages: list[float] = ages) -> None:
                ages.append(link.states[-1][1].t - seconds(message.header.stamp))  # type: ignore[attr-defined]

            subscription = link.node.subscription(row.name, row.type, add, row.qos)
            link.spin(10.0, lambda ages=ages: len(ages) >= 5)  # type: ignore[misc]
            subscription.close()
            if not ages:
                raise candidate.fault(f"{name} is silent")
            candidate.figures[f"{name} age [s]"] = float(np.median(ages))
            if not -EARLY <= np.median(ages) <= STALE:
                raise candidate.fault(f"{name} is stamped {np.median(ages):+.3f} s before the robot's time")


class DomainSuite(DomainStops, RobotMeasures, DomainListening):
    """The promises of a robot on a domain. The last ones end its gate."""

    @contextmanager
    def rig(self, candidate: Candidate) -> Iterator[RobotRig]:
        """Return the robot; it moves where somebody confirms that it may."""
        yield self.session


def _needed(row: TopicRow) -> bool:
    return bool({"stack", "safety"} & set(row.to)) and row.name not in OWN_COMPUTER


def _absent(topic: str, without: tuple[str, ...]) -> bool:
    """Return whether a topic is of a device that was declared absent."""
    parts = topic.strip("/").split("/")
    device = {"realsense": f"{parts[1] if len(parts) > 1 else ''} camera", "livox": "lidar"}
    return device.get(parts[0], f"{parts[0]} hand") in without


FIRST = 20.0
"""How long a robot is waited for [s]."""


@dataclass(frozen=True)
class DomainCheckConfig(Output):
    """Check the robot on a domain against the promises of robots.

    It is listened to first. Then it is moved, through a safety gate that this starts, once somebody has typed that it
    hangs in its hoist. Exit code 0: all promises are kept. 1: one is broken.
    """

    slot: Annotated[str, tyro.conf.Positional] = "robot"
    """What is on the domain: robot."""
    yes: bool = False
    """Say that the robot hangs: it is moved without a further question."""
    without: tuple[str, ...] = ()
    """Devices that this robot does not have, e.g. "lidar" "left hand"."""
    estop: EstopConfig = field(default_factory=EstopConfig)
    """The emergency stop; a real robot has a serial one."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


class _Beside(Terminal):
    """Whoever is beside a robot: at a terminal; a virtual button is pressed for them."""

    def __init__(self, config: DomainCheckConfig) -> None:
        self._yes = config.yes
        self._button = ScriptedPerson(config.dds, "none") if config.estop.use == "virtual" else None

    def confirm(self, question: str, word: str) -> bool:
        """Ask, unless --yes has answered."""
        return self._yes or super().confirm(question, word)

    def act(self, task: Task) -> None:
        """Have it done."""
        (self._button or super()).act(task)


def run_domain_check(config: DomainCheckConfig) -> bool:
    """Check the robot and print the report; return whether it keeps all promises.

    Raises:
        ConfigError: an option is wrong.
        DdsError: the domain cannot be joined.
    """
    if config.slot != "robot":
        raise ConfigError(f"On a domain a robot is checked, not '{config.slot}': golem check robot --domain N.")
    bringup = BringupConfig(without=config.without, estop=config.estop, dds=config.dds)
    with member("check", config.dds) as (participant, node):
        link = RobotLink(participant, node, config.dds)
        link.spin(FIRST, lambda: len(link.states) > 200)
        still = not config.dds.robot and bool(frozen_groups([state for _, state in link.states]))
        words = ["safety", "--black-box", "None", *(["--still"] if still else [])]
        words += [*config.estop.words(), *config.dds.words()]
        bench = Workbench(link, _Beside(config), bringup, lambda: Process("safety", words))
        rig = DomainRig(bench, participant, lambda: Process("safety", [*words, "--strict"]))
        subject = Candidate("robot", str(config.dds), lambda: rig)
        try:
            report = run_suite(DomainSuite(rig), subject, lambda check: log_line(f"{check.promise}"))
        finally:
            rig.close()
    show([report], config, whole=True)
    return report.passed
