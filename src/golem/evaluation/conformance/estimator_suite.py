"""What a base estimator promises: see `golem.hardware.estimator.base`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from golem.evaluation.conformance import samples
from golem.evaluation.conformance.base import Candidate, check
from golem.evaluation.conformance.suite import Suite, check_fields
from golem.hardware.estimator.base import BaseEstimator
from golem.runtime.contract_check import ContractCheck
from golem.types import TICK, BaseEstimate, LowState

TICKS = 60
LEVEL = 1e-3
"""How far a rotation may be from one, and the start from heading zero [-], [rad]."""


class EstimatorSuite(Suite):
    """Inputs are states, answers estimates."""

    slot, contracts = "estimator", (BaseEstimator,)
    takes = TICK

    def inputs(self) -> Sequence[LowState]:
        """Return a robot that stands and sways."""
        return samples.states(TICKS)

    def edges(self) -> Mapping[str, Sequence[LowState]]:
        """Return robots at the edges of their range, and one that falls."""
        times = [TICK * (i + 1) for i in range(10)]
        falling = [samples.state(t, acc=np.zeros(3), tau=np.zeros(27)) for t in times]
        held = {what: [make(t) for t in times] for what, make in samples.edge_states().items()}
        return held | {"a robot in free fall": falling}

    def spoiled(self) -> Mapping[str, LowState]:
        return samples.spoiled_states(4 * TICK)

    def begin(self, module: BaseEstimator, first: LowState) -> None:
        module.reset(first)

    def call(self, module: BaseEstimator, given: LowState) -> BaseEstimate:
        return module.step(given, TICK)

    def judge(self, contract: ContractCheck, answer: Any) -> None:
        contract.kind("the estimate", answer, BaseEstimate)
        check_fields(contract, answer, T_odom_base=(4, 4), velocity=(3,), contact=(2,), height=(), t=())

    @check
    def poses_are_rigid(self, candidate: Candidate) -> None:
        """Every pose is a rotation and a translation."""
        for answer in self.answers_of(candidate):
            R = answer.T_odom_base[:3, :3]
            if np.abs(R @ R.T - np.eye(3)).max() > LEVEL or np.linalg.det(R) < 0.0:
                raise candidate.fault("T_odom_base is not a rigid transform")

    @check
    def starts_at_the_origin(self, candidate: Candidate) -> None:
        """It starts above the origin of odom, with heading zero."""
        T = self.answers_of(candidate)[0].T_odom_base
        heading = float(np.arctan2(T[1, 0], T[0, 0]))
        if float(np.hypot(T[0, 3], T[1, 3])) > 0.01 or abs(heading) > 0.01:
            raise candidate.fault(f"it starts at x {T[0, 3]:.3g} m, y {T[1, 3]:.3g} m, heading {heading:.3g} rad")

    @check
    def contact_is_a_probability(self, candidate: Candidate) -> None:
        """The contact of each foot lies between 0 and 1."""
        for answer in self.answers_of(candidate):
            if answer.contact.min() < 0.0 or answer.contact.max() > 1.0:
                raise candidate.fault(f"contact is {answer.contact}, the contract asks for 0 to 1")

    @check
    def stamps_are_the_states(self, candidate: Candidate) -> None:
        """An estimate carries the time stamp of the state it is of."""
        for given, answer in zip(self.inputs(), self.answers_of(candidate), strict=True):
            if abs(answer.t - given.t) > 0.5 * TICK:
                raise candidate.fault(f"the estimate of t = {given.t:g} s is stamped {answer.t:g} s")
