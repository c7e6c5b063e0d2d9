"""What stops a robot on a domain, and that it goes on after a stop: the part of its suite that asks the safety gate."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from golem.errors import GolemError
from golem.evaluation.conformance.base import Candidate, Inapplicable, check
from golem.evaluation.conformance.domain_rig import DomainRig, reaction
from golem.evaluation.conformance.robot_measures import between
from golem.interfaces.payloads import GateState, Reason
from golem.middleware.ros.future import RosError
from golem.robots.model.table import JOINT_INDEX, JOINT_NAMES
from golem.runtime.bringup.base import Act, StepFinding, Task
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
            limp = next(
                (s.t - died for _, s in link.states if s.t > died and np.abs(s.tau).max() < LIMP), math.inf
            )
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
