"""What a grasp method promises: see `golem.capabilities.grasping.base`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from golem.capabilities.arms.base import check_pose
from golem.capabilities.grasping.base import Grasp, GraspMethod, Gripper, ServoLaw, ServoStatus, ServoStep
from golem.evaluation.conformance import samples
from golem.evaluation.conformance.base import Candidate, Inapplicable, check
from golem.evaluation.conformance.suite import Suite
from golem.runtime.contract_check import ContractCheck
from golem.types import Array, LocalizedObject

PLACE: Array = np.array([0.43, -0.1, -0.05])
"""Where the ordinary object lies in odom [m]."""
ALLOWED = 0.02
"""CPU time beyond its latency that a proposal and the steps of its servo law may take [s] [own]."""
FAR = 0.1
"""How far from the object a grasp may be [m] [own: more than the hand is wide]."""
FRAMES = 30


HOVER = 0.15
"""How high above the object the hand waits [m]."""


class GraspInput(NamedTuple):
    """An object, the cloud of the scene around it, and the hand."""

    target: LocalizedObject
    scene: Array
    gripper: Gripper


def above(target: LocalizedObject, yaw: float = 0.3) -> GraspInput:
    """Return `target` with its own cloud as the scene, and a right hand above it that points down at `yaw`."""
    T = np.eye(4)
    T[:3, :3] = ((math.cos(yaw), math.sin(yaw), 0.0), (math.sin(yaw), -math.cos(yaw), 0.0), (0.0, 0.0, -1.0))
    T[:3, 3] = np.nan_to_num(target.position) + (0.0, 0.0, HOVER)
    return GraspInput(target, target.points.copy(), Gripper("right", T, yaw))


class GraspAnswer(NamedTuple):
    """The proposals, and what the servo law of the first says to some frames; empty without one."""

    grasps: list[Grasp]
    steps: list[ServoStep]


def propose(module: GraspMethod, given: GraspInput) -> list[Grasp]:
    """Return the proposals; the one place that knows the signature."""
    return list(module.propose(given.target, given.scene, given.gripper))


class GraspSuite(Suite):
    """Inputs are objects, answers proposals with what the servo law of the first says."""

    slot, contracts, forgets = "grasp_method", (GraspMethod,), False
    late, takes = True, ALLOWED

    def inputs(self) -> Sequence[GraspInput]:
        """Return objects within reach."""
        offsets = [(0.05 * i - 0.1, 0.06 * i - 0.1, 0.01 * i) for i in range(5)]
        return [above(samples.seen_object(0.1 * i, PLACE + offset), 0.4 * i - 0.8) for i, offset in enumerate(offsets)]

    def edges(self) -> Mapping[str, Sequence[GraspInput]]:
        """Return objects and scenes with hardly a cloud, objects far away, and headings that wrap."""
        return {
            "an object without points": [above(samples.seen_object(0.1, PLACE, 0))],
            "an object of one point": [above(samples.seen_object(0.1, PLACE, 1))],
            "an object out of reach": [above(samples.seen_object(0.1, 10.0 * PLACE))],
            "a heading that wraps": [above(samples.seen_object(0.1, PLACE), yaw) for yaw in (math.pi, -4.0)],
            "a scene without points": [above(samples.seen_object(0.1, PLACE))._replace(scene=np.zeros((0, 3)))],
        }

    def spoiled(self) -> Mapping[str, GraspInput]:
        return {"the position": above(samples.seen_object(0.1, samples.with_nan(PLACE, 0)))}

    def call(self, module: GraspMethod, given: GraspInput) -> GraspAnswer:
        """Return proposals, and follow the servo law of the first."""
        grasps = propose(module, given)
        if not grasps or not isinstance(grasps[0], Grasp):
            return GraspAnswer(grasps, [])
        start = given.target.t
        law = module.servo(given.target, grasps[0], start)
        return GraspAnswer(grasps, [] if law is None else self._follow(law, given, grasps[0], start))

    def _follow(self, law: ServoLaw, given: GraspInput, grasp: Grasp, start: float) -> list[ServoStep]:
        """Return what `law` says while the palm camera sees the object in every second frame."""
        steps: list[ServoStep] = []
        T = np.array(grasp.T_odom_gripper, dtype=np.float64)
        T[2, 3] += 0.1
        for i in range(FRAMES):
            t = start + 0.033 * (i + 1)
            offset = 0.001 * np.array([math.sin(i), math.cos(i), 0.0])
            seen = samples.seen_object(t, given.target.position + offset)
            step = law.step(t, [seen] if i % 2 else None, T.copy())
            steps.append(step)
            if isinstance(step, ServoStep):
                T[:3, 3] += 0.3 * (np.asarray(step.T_odom_gripper)[:3, 3] - T[:3, 3])
        return steps

    def judge(self, contract: ContractCheck, answer: GraspAnswer) -> None:
        for grasp in answer.grasps:
            contract.kind("a proposal", grasp, Grasp)
            contract.array("T_odom_gripper", grasp.T_odom_gripper, 4, 4)
            contract.number("gap", grasp.gap, minimum=0.0)
            contract.number("score", grasp.score)
        for step in answer.steps:
            contract.kind("the servo step", step, ServoStep)
            contract.kind("status", step.status, ServoStatus)
            contract.array("the step's T_odom_gripper", step.T_odom_gripper, 4, 4)
            contract.array("target", step.target, 3)
            contract.number("sigma", step.sigma, minimum=0.0)

    def _grasps(self, candidate: Candidate) -> list[tuple[GraspInput, list[Grasp]]]:
        """Return the proposals for objects for which there are any."""
        pairs = zip(self.inputs(), self.answers_of(candidate), strict=True)
        found = [(given, answer.grasps) for given, answer in pairs if answer.grasps]
        if not found:
            raise Inapplicable("it proposes nothing for the objects of the suite")
        return found

    @check
    def poses_are_rigid(self, candidate: Candidate) -> None:
        """Every pose is a rotation and a translation."""
        for answer in self.answers_of(candidate):
            for one in (*answer.grasps, *answer.steps):
                candidate.contract.call(check_pose, "T_odom_gripper", one.T_odom_gripper)

    @check
    def best_grasp_comes_first(self, candidate: Candidate) -> None:
        """Proposals come in the order of their scores."""
        for _, grasps in self._grasps(candidate):
            scores = [grasp.score for grasp in grasps]
            if scores != sorted(scores, reverse=True):
                raise candidate.fault(f"its scores are {', '.join(f'{score:.3g}' for score in scores)}")

    @check
    def gap_fits_the_hand(self, candidate: Candidate) -> None:
        """The hand can open as far as a proposal asks."""
        for given, grasps in self._grasps(candidate):
            widest, opens = max(grasp.gap for grasp in grasps), given.gripper.max_gap
            if widest > opens:
                raise candidate.fault(f"it wants a gap of {widest:.3g} m, the hand opens to {opens:g} m")

    @check
    def grasps_the_object(self, candidate: Candidate) -> None:
        """The fingers close near the object."""
        for given, grasps in self._grasps(candidate):
            away = max(float(np.linalg.norm(g.T_odom_gripper[:3, 3] - given.target.position)) for g in grasps)
            if away > FAR:
                raise candidate.fault(f"a grasp is {away:.3g} m from the object")
