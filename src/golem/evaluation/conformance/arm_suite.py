"""What an upper body promises: see `golem.capabilities.arms.base`."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from golem.capabilities.arms.base import NUM_UPPER, TargetError, UpperBody
from golem.errors import ModuleFault
from golem.evaluation.conformance import samples
from golem.evaluation.conformance.base import Candidate, check
from golem.evaluation.conformance.suite import Suite, check_fields
from golem.interfaces.payloads import ArmCommand
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.model.table import load_limits
from golem.runtime.contract_check import ContractCheck
from golem.runtime.nodes import ArmLimits
from golem.types import UPPER, Array

TICKS = 60
WAY = 0.05
"""How far the ordinary target of a palm is from where the palm starts [m]."""
REACHED = 0.5
"""Share of that way that may be left after `TICKS` [own: a slow controller passes, one that goes nowhere does not]."""


class ArmInput(NamedTuple):
    """What an upper body is given at one tick."""

    left: Array | None
    right: Array | None
    q: Array
    dt: float


class ArmSuite(Suite):
    """Inputs are palm targets, answers arm commands."""

    slot, contracts = "upper_body", (UpperBody,)
    late = rated = True

    def __init__(self) -> None:
        kinematics = Kinematics()
        kinematics.update(samples.posture())
        self._palms = [kinematics.pose(f"{side}_gripper").copy() for side in ("left", "right")]

    def _to(self, x: float, y: float, z: float, count: int = TICKS) -> list[ArmInput]:
        """Return ticks with a target for the right palm, which lies so far from where it is [m]; the left is free."""
        target = self._palms[1].copy()
        target[:3, 3] += x, y, z
        return [ArmInput(None, target.copy(), samples.posture(), self.dt) for _ in range(count)]

    def inputs(self) -> Sequence[ArmInput]:
        """Return a target a little ahead of the right palm."""
        return self._to(0.0, 0.0, WAY)

    def edges(self) -> Mapping[str, Sequence[ArmInput]]:
        """Return targets out of reach, and behind the robot, and joints at their limits."""
        limits = load_limits()
        wide = {"lower": limits.lower, "upper": limits.upper}
        cases = {
            "a target out of reach": self._to(3.0, 0.0, 0.0),
            "a target behind the robot": self._to(-1.2, 0.0, 0.2),
            "a target at the robot's middle": self._to(*(-self._palms[1][:3, 3])),
            "both palms in one place": [one._replace(left=self._palms[1].copy()) for one in self._to(0.0, 0.2, 0.0)],
            "no target": [ArmInput(None, None, samples.posture(), self.dt)] * 10,
        }
        for name, q in wide.items():
            cases[f"joints at their {name} limits"] = [one._replace(q=q.copy()) for one in self._to(0.0, 0.0, WAY, 20)]
        return cases

    def spoiled(self) -> Mapping[str, ArmInput]:
        sound = self.inputs()[0]
        return {
            "a target": sound._replace(right=samples.with_nan(self._palms[1])),
            "the measured joints": sound._replace(q=samples.with_nan(sound.q)),
        }

    def begin(self, module: UpperBody, first: ArmInput) -> None:
        module.reset(first.q)

    def call(self, module: UpperBody, given: ArmInput) -> ArmCommand:
        return module.step(given.left, given.right, given.q, given.dt)

    def judge(self, contract: ContractCheck, answer: Any) -> None:
        contract.kind("the arm command", answer, ArmCommand)
        check_fields(contract, answer, q=(NUM_UPPER,), error_position=(2,), error_rotation=(2,), limited=())

    @check
    def targets_keep_the_limits(self, candidate: Candidate) -> None:
        """Joint targets keep position and velocity limits, whatever is asked for."""
        for what, inputs in {"an ordinary target": self.inputs(), **self.edges()}.items():
            limits = ArmLimits(candidate.contract, self.dt)
            limits.reset(inputs[0].q)
            for answer in self.run(candidate, inputs):
                try:
                    limits.check(answer.q)
                except ModuleFault as fault:
                    raise candidate.fault(f"{what}: {fault.reason}") from fault

    @check
    def goes_to_the_target(self, candidate: Candidate) -> None:
        """A palm that has a target near by comes nearer to it."""
        q = samples.posture()
        q[UPPER] = self.answers_of(candidate)[-1].q
        kinematics = Kinematics()
        kinematics.update(q)
        target = self.inputs()[-1].right
        assert target is not None
        left = float(np.linalg.norm(kinematics.pose("right_gripper")[:3, 3] - target[:3, 3]))
        if left > REACHED * WAY:
            raise candidate.fault(
                f"after {TICKS * self.dt:.3g} s, {100.0 * left:.3g} cm of {100.0 * WAY:g} cm are left"
            )

    @check
    def tells_what_is_left(self, candidate: Candidate) -> None:
        """The errors are of the arms that have a target; 0 for an arm without one."""
        for answer in self.answers_of(candidate):
            if answer.error_position[0] != 0.0 or answer.error_rotation[0] != 0.0:
                raise candidate.fault("it tells an error of the left arm, which has no target")
        if self.answers_of(candidate)[0].error_position[1] <= 0.0:
            raise candidate.fault("it tells no error of the right arm, which has a target")

    @check
    def keeps_still_without_a_target(self, candidate: Candidate) -> None:
        """An arm without a target keeps its posture."""
        answers = self.run(candidate, self.edges()["no target"])
        moved = float(np.abs(answers[-1].q - samples.posture()[UPPER]).max())
        if moved > 0.01:
            raise candidate.fault(f"without a target a joint moves by {moved:.3g} rad")

    @check
    def refuses_what_is_no_pose(self, candidate: Candidate) -> None:
        """A target that is no rigid transform, and a time step that is not positive, raise `TargetError`."""
        sound = self.inputs()[0]
        sheared = self._palms[1].copy()
        sheared[0, 0] += 0.5
        cases = {
            "a target that is sheared": sound._replace(right=sheared),
            "a target of shape (3, 3)": sound._replace(right=np.eye(3)),
            "a time step of 0": sound._replace(dt=0.0),
        }
        for what, given in cases.items():
            module = candidate.make()
            self.run(candidate, self.inputs()[:2], module)
            try:
                candidate.contract.call(self.call, module, copy.deepcopy(given))
            except ModuleFault as fault:
                if isinstance(fault.__cause__, TargetError):
                    continue
                raise candidate.fault(f"{what} ends in {fault.reason}, not in a TargetError") from fault
            raise candidate.fault(f"{what} is taken for one")
