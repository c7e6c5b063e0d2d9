"""What a lower body promises: see `golem.capabilities.legs.base`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from golem.capabilities.legs.base import STANDING, Envelope, LocomotionCommand, LowerBody
from golem.capabilities.legs.gait import GaitConfig
from golem.evaluation.conformance import samples
from golem.evaluation.conformance.base import Candidate, check
from golem.evaluation.conformance.still_robot import StillOnboard
from golem.evaluation.conformance.suite import Suite, check_fields
from golem.interfaces.payloads import LegCommand
from golem.robots.model.table import load_limits
from golem.runtime.contract_check import ContractCheck
from golem.runtime.lower_body_node import MAX_LATENCY
from golem.types import LEGS, BaseEstimate, LowState, Twist

TICKS = 24
JOINTS = LEGS.stop
BEYOND = 0.2
"""How far targets may lie beyond a position limit [rad] [own: a policy presses a joint against its end; further away it
is a mistake, such as degrees]."""
MAX_STIFFNESS = 2000.0
"""Stiffness that no motor of the robot takes [N m/rad] [own]."""


class LegInput(NamedTuple):
    """What a lower body is given at one tick; `dt` [s]."""

    state: LowState
    base: BaseEstimate
    motion: LocomotionCommand
    dt: float


class LegSuite(Suite):
    """Inputs are states with twists and gait phases, answers leg commands."""

    slot, contracts = "lower_body", (LowerBody,)
    late = rated = True

    def __init__(self) -> None:
        self._envelope = Envelope()

    def context(self) -> Mapping[str, object]:
        """Return an on-board controller that answers every call."""
        return {"onboard": StillOnboard()}

    def declared(self, contract: ContractCheck, module: Any) -> None:
        super().declared(contract, module)
        if module.latency > MAX_LATENCY:
            raise contract.fault(f"its latency is {module.latency:g} s, legs need at most {MAX_LATENCY:g} s")
        self._envelope = contract.kind("envelope", module.envelope, Envelope)
        contract.kind("gait", module.gait, GaitConfig)

    def _ticks(self, motion: LocomotionCommand, count: int = TICKS, **changes: Any) -> list[LegInput]:
        times = [self.dt * (i + 1) for i in range(count)]
        return [LegInput(samples.state(t), samples.base(t, **changes), motion, self.dt) for t in times]

    def inputs(self) -> Sequence[LegInput]:
        """Return a robot that stands."""
        return self._ticks(STANDING)

    def edges(self) -> Mapping[str, Sequence[LegInput]]:
        """Return the corners of the envelope, and robots at the edges of their range."""
        e = self._envelope
        corners = {
            "the fastest twist": Twist(e.vx[1], e.vy[1], e.wz[1]),
            "the slowest twist": Twist(e.vx[0], e.vy[0], e.wz[0]),
        }
        cases = {what: self._walk(twist) for what, twist in corners.items()}
        cases["both feet in the air"] = self._ticks(STANDING, 6, contact=np.zeros(2), height=0.0)
        cases["a stale estimate of the base"] = self._ticks(STANDING, 6, stale=True)
        for what, make in samples.edge_states().items():
            cases[what] = [one._replace(state=make(one.state.t)) for one in self._ticks(STANDING, 6)]
        return cases

    def _walk(self, twist: Twist) -> list[LegInput]:
        count = round(1.2 / self.dt)
        walking = self._ticks(STANDING, count)
        phases = [np.array([0.0, 0.5]) + 1.25 * self.dt * i for i in range(count)]
        motions = [LocomotionCommand(twist, phase % 1.0, True, twist != Twist()) for phase in phases]
        return [one._replace(motion=motion) for one, motion in zip(walking, motions, strict=True)]

    def spoiled(self) -> Mapping[str, LegInput]:
        sound = self.inputs()[3]
        cases = {where: sound._replace(state=s) for where, s in samples.spoiled_states(sound.state.t).items()}
        cases["the pose of the base"] = sound._replace(
            base=replace(sound.base, T_odom_base=samples.with_nan(sound.base.T_odom_base))
        )
        cases["the velocity of the base"] = sound._replace(
            base=replace(sound.base, velocity=samples.with_nan(sound.base.velocity, 0))
        )
        return cases

    def begin(self, module: LowerBody, first: LegInput) -> None:
        module.reset(first.state)

    def call(self, module: LowerBody, given: LegInput) -> Any:
        return module.step(given.state, given.base, given.motion, given.dt)

    def judge(self, contract: ContractCheck, answer: Any) -> None:
        contract.kind("the leg command", answer, LegCommand)
        own = {} if answer.tau is None else {"tau": (JOINTS,)}
        check_fields(contract, answer, q=(JOINTS,), kp=(JOINTS,), kd=(JOINTS,), **own)

    @check
    def targets_are_angles_of_joints(self, candidate: Candidate) -> None:
        """Joint targets of a robot that stands lie inside the position limits, or little beyond."""
        limits = load_limits()
        for answer in self.answers_of(candidate):
            outside = np.maximum(limits.lower[LEGS] - answer.q, answer.q - limits.upper[LEGS])
            if outside.max() > BEYOND:
                raise candidate.fault(f"a target is {outside.max():.3g} rad outside of its joint's position limits")

    @check
    def gains_are_possible(self, candidate: Candidate) -> None:
        """Stiffness and damping are not negative, and such as motors take."""
        for answer in self.answers_of(candidate):
            if min(answer.kp.min(), answer.kd.min()) < 0.0 or answer.kp.max() > MAX_STIFFNESS:
                raise candidate.fault(
                    f"kp is {answer.kp.min():.3g} to {answer.kp.max():.3g}, kd {answer.kd.min():.3g} to "
                    f"{answer.kd.max():.3g}; from 0 to {MAX_STIFFNESS:g} N m/rad is possible"
                )
