"""What motor control promises: see `golem.hardware.servo.base`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from golem.evaluation.conformance import samples
from golem.evaluation.conformance.base import Candidate, check
from golem.evaluation.conformance.suite import Suite, check_fields
from golem.hardware.servo.base import MotorServo
from golem.runtime.contract_check import ContractCheck
from golem.types import LEGS, NUM_JOINTS, TICK, Array, LowCommand, LowState

TICKS = 40
SOFT = 0.2
"""Share of its later stiffness that a joint may have at the first tick."""


class ServoInput(NamedTuple):
    """What motor control is given at one tick; see `MotorServo.step`."""

    state: LowState
    q: Array
    leg_gains: tuple[Array, Array] | None = None
    leg_tau: Array | None = None


class ServoSuite(Suite):
    """Inputs are states with targets, answers commands to the motors."""

    slot, contracts = "servo", (MotorServo,)
    takes = TICK

    def inputs(self) -> Sequence[ServoInput]:
        """Return a robot in the hoist whose targets are a little ahead of its joints."""
        return [ServoInput(s, samples.posture() + 0.01 * np.sin(20.0 * s.t)) for s in samples.states(TICKS)]

    def edges(self) -> Mapping[str, Sequence[ServoInput]]:
        """Return robots at the edges of their range, and one on its legs."""
        times = [TICK * (i + 1) for i in range(5)]
        held = {w: [ServoInput(make(t), samples.posture()) for t in times] for w, make in samples.edge_states().items()}
        legs = LEGS.stop
        gains, tau = (np.full(legs, 200.0), np.full(legs, 4.0)), np.full(legs, 10.0)
        standing = [ServoInput(samples.state(t), samples.posture(), gains, tau) for t in times]
        return held | {"legs with gains and torques of their own": standing}

    def spoiled(self) -> Mapping[str, ServoInput]:
        t = 4 * TICK
        q = samples.posture()
        cases = {where: ServoInput(s, q) for where, s in samples.spoiled_states(t).items()}
        return cases | {"the targets": ServoInput(samples.state(t), samples.with_nan(q))}

    def begin(self, module: MotorServo, first: ServoInput) -> None:
        module.reset(first.state)

    def call(self, module: MotorServo, given: ServoInput) -> LowCommand:
        return module.step(given.state, given.q, TICK, given.leg_gains, given.leg_tau)

    def judge(self, contract: ContractCheck, answer: Any) -> None:
        contract.kind("the motor command", answer, LowCommand)
        n = (NUM_JOINTS,)
        check_fields(contract, answer, t=(), q=n, dq=n, tau=n, kp=n, kd=n)

    @check
    def gains_are_not_negative(self, candidate: Candidate) -> None:
        """No stiffness and no damping is negative: it would drive a joint away from its target."""
        for answer in self.answers_of(candidate):
            for name in ("kp", "kd"):
                if getattr(answer, name).min() < 0.0:
                    raise candidate.fault(f"{name} is {getattr(answer, name).min():.3g}")

    @check
    def starts_softly(self, candidate: Candidate) -> None:
        """After a reset the gains ramp up from zero."""
        answers = self.run(candidate, [self.inputs()[0]] * 500)
        first, later = float(answers[0].kp.max()), float(answers[-1].kp.max())
        if first > SOFT * later:
            raise candidate.fault(f"its first stiffness is {first:.3g} N m/rad, {later:.3g} N m/rad a second later")

    @check
    def obeys_the_gains_of_the_legs(self, candidate: Candidate) -> None:
        """Legs with gains and torques of their own get them in full, from the first tick."""
        given = self.edges()["legs with gains and torques of their own"]
        answer = self.run(candidate, given)[0]
        kp, kd = given[0].leg_gains or (np.zeros(0), np.zeros(0))
        if not (np.allclose(answer.kp[LEGS], kp) and np.allclose(answer.kd[LEGS], kd)):
            raise candidate.fault("legs that carry the robot do not get the gains of their controller")
