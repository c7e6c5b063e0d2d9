"""What a planner promises: see `golem.capabilities.planning.base`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from golem.capabilities.arms.postures import posture
from golem.capabilities.arms.trajectory import check_trajectory, interpolate
from golem.capabilities.collision.obstacles import Obstacle, World
from golem.capabilities.planning.base import STRONGEST, ArmPlanner, Plan, PlanRefused, PlanRequest
from golem.capabilities.planning.joint_space import JointSpace, PlanningRobot
from golem.capabilities.planning.path_planner import fine_points
from golem.evaluation.conformance import samples
from golem.evaluation.conformance.base import Candidate, check
from golem.evaluation.conformance.suite import Suite, check_fields
from golem.interfaces.payloads import JointTrajectory
from golem.runtime.contract_check import ContractCheck

MEETS = 1e-6
"""How far a trajectory may begin and end from where it shall [rad]."""
SLOW, INSTANT = 0.1, 0.005
"""A speed of the hands that a request asks for [m/s], and the time over which it is measured [s]."""
ALLOWED = 1.0
"""CPU time beyond its latency that a plan may take [s], as the bench of the shipped planner has it."""


class PlannerSuite(Suite):
    """Inputs are requests, answers plans, or the refusal."""

    slot, contracts, forgets = "planner", (ArmPlanner,), False
    late, takes = True, ALLOWED

    def inputs(self) -> Sequence[PlanRequest]:
        """Return ways between named postures, before a pack."""
        names = ("home", "ready_right", "ready", "ready_left", "home", "ready", "home")
        return [PlanRequest(posture(a), posture(b), _pack()) for a, b in zip(names, names[1:], strict=False)]

    def edges(self) -> Mapping[str, Sequence[PlanRequest]]:
        """Return ways of no length, goals that cannot be gone to, and no effort."""
        one = self.inputs()[0]
        beyond = one.goals + 3.0
        return {
            "a way of no length": [replace(one, goals=one.q)],
            "a goal beyond the joints' range": [replace(one, goals=beyond)],
            "two goals, one of which cannot be gone to": [replace(one, goals=np.array([beyond, one.goals]))],
            "a start in the pack": [replace(one, world=_pack(0.3))],
            "no effort": [replace(one, effort=0)],
        }

    def spoiled(self) -> Mapping[str, PlanRequest]:
        one = self.inputs()[0]
        return {
            "the start": replace(one, q=samples.with_nan(one.q)),
            "the goal": replace(one, goals=samples.with_nan(one.goals)),
        }

    def call(self, module: ArmPlanner, given: PlanRequest) -> Plan | PlanRefused:
        """Return its plan or its refusal; of what is not finite, raise the refusal."""
        try:
            return module.plan(given)
        except PlanRefused as refusal:
            if not (np.isfinite(given.q).all() and np.isfinite(given.goals).all()):
                raise
            return refusal

    def judge(self, contract: ContractCheck, answer: Any) -> None:
        if isinstance(answer, PlanRefused):
            return
        contract.kind("the plan", answer, Plan)
        n = len(answer.times)
        check_fields(contract, answer, times=(n,), q=(n, 15), dq=(n, 15))

    @check
    def meets_start_and_goal(self, candidate: Candidate) -> None:
        """A trajectory begins where the arms are and ends at a goal, at rest at both ends."""
        for given, plan in self._plans(candidate):
            goals = np.atleast_2d(given.goals)
            off = (float(np.abs(plan.q[0] - given.q).max()), float(np.abs(goals - plan.q[-1]).max(axis=1).min()))
            if max(off) > MEETS or float(np.abs(plan.dq[[0, -1]]).max()) > MEETS:
                raise candidate.fault(f"it begins {off[0]:.2g} rad off and ends {off[1]:.2g} rad off, or moves there")

    @check
    def can_be_followed(self, candidate: Candidate) -> None:
        """A trajectory keeps the range and the speed that the safety gate lets through."""
        for given, plan in self._plans(candidate):
            trajectory = JointTrajectory(0.0, plan.times, plan.q, plan.dq)
            candidate.contract.call(check_trajectory, trajectory, given.q)

    @check
    def keeps_the_hands_speed(self, candidate: Candidate) -> None:
        """The hands move no faster than the request's `hand_speed`."""
        robot, module = PlanningRobot(), candidate.make()
        for given in self.inputs()[:2]:
            slow = replace(given, hand_speed=SLOW)
            plan = candidate.contract.call(self.call, module, slow)
            if not isinstance(plan, Plan):
                raise candidate.fault(f"it finds no way at a hand_speed of {SLOW} m/s that it finds at 0.5")
            s = np.arange(0.0, float(plan.times[-1]), INSTANT)
            hands = JointSpace(robot, slow.q, None).hands(interpolate(plan.times, plan.q, plan.dq, s))
            fastest = float(np.linalg.norm(np.diff(hands, axis=0), axis=2).max(initial=0.0)) / INSTANT
            if fastest > 1.05 * SLOW:
                raise candidate.fault(f"a hand moves at {fastest:.2f} m/s where hand_speed asks for {SLOW} m/s")

    @check
    def accelerates_gently(self, candidate: Candidate) -> None:
        """No joint accelerates faster than 8 rad/s^2."""
        for _, plan in self._plans(candidate):
            gap, step = np.diff(plan.times)[:, None], np.diff(plan.q, axis=0)
            a, b = plan.dq[:-1], plan.dq[1:]
            # A cubic's acceleration is largest at its ends.
            ends = 6.0 * step / gap - (4.0 * a + 2.0 * b), -6.0 * step / gap + (2.0 * a + 4.0 * b)
            most = float(np.abs(np.array(ends) / gap).max())
            if most > STRONGEST:
                raise candidate.fault(f"a joint accelerates with {most:.3g} rad/s^2, more than {STRONGEST:g}")

    @check
    def touches_nothing(self, candidate: Candidate) -> None:
        """No posture of a trajectory touches the robot itself or the world."""
        model = PlanningRobot().model()
        for given, plan in self._plans(candidate):
            Q = fine_points(plan.times, plan.q, plan.dq)
            hit = model.collides_each(Q, 0.0, given.world)
            if hit.any():
                raise candidate.fault(f"{int(hit.sum())} of {len(Q)} postures of a trajectory touch something")

    @check
    def gives_up_when_told(self, candidate: Candidate) -> None:
        """A caller that has given up gets a refusal, not a plan."""
        given = replace(self.inputs()[0], stop=lambda: True)
        answer = candidate.contract.call(self.call, candidate.make(), given)
        if not isinstance(answer, PlanRefused):
            raise candidate.fault("it plans on though `stop` says True")

    def _plans(self, candidate: Candidate) -> list[tuple[PlanRequest, Plan]]:
        pairs = zip(self.inputs(), self.answers_of(candidate), strict=True)
        found = [(given, answer) for given, answer in pairs if isinstance(answer, Plan)]
        if not found:
            raise candidate.fault("it finds no way between named postures, none of which is barred")
        return found


def _pack(near: float = 1.02) -> World:
    T = np.eye(4)
    T[:3, 3] = near, 0.0, -0.15 if near > 0.9 else 0.25
    return World([Obstacle("box", T, (0.6, 1.0, 0.075))])
