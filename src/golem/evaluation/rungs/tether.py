"""Rung `tether`: pick one loosened screw with the robot in its hoist; perception and manipulation without balance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from golem import registry
from golem.errors import ConfigError
from golem.evaluation.base import DONE, TrialOutcome, TrialSpec
from golem.evaluation.oracle import GraspTruth, Oracle
from golem.evaluation.provenance import user_files
from golem.middleware import topics
from golem.middleware.bus import News
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.gl import shared_context
from golem.robots.sensors.profiles import PROFILES, load_profile
from golem.runtime.assembly import Running, build
from golem.skills.base import Feedback, SkillResult
from golem.skills.pick import TIMEOUT, Pick, PickConfig, PickGoal
from golem.skills.runner import FAULT
from golem.stack import Stack, load_stack

SETTLE = 0.5
"""Robot time a dropped screw gets to come to rest [s]."""
ABORTED = ("safety", FAULT, "timeout")
"""Stages at which a skill was ended from outside: not a success, wherever the screw is."""
PAD_REACH = 0.008
"""Half width of a finger pad [m]: a hand further off than this cannot hold the screw."""
STRAIGHT = 0.087
"""Tilt beyond which an extraction counts as off axis [rad]: 5 deg."""


class Tether:
    """One screw per trial: seen, approached, grasped, pulled out, dropped in the tray."""

    name = "tether"
    profiles = tuple(PROFILES)

    def methods(self) -> tuple[str, ...]:
        """Return the registered grasp methods."""
        return registry.names("grasp_method")

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        """Return what determines a trial besides its seed; see `Rung`."""
        stack = _stack(method, profile, overrides)
        classes = {slot: registry.load(slot, stack.choice(slot).use) for slot in registry.slots()}
        if not issubclass(classes["robot"], MujocoRobot):
            raise ConfigError(
                f"Rung tether judges on the simulator's truth; robot: {stack.robot.use} is not the twin, 'mujoco'."
            )
        shared_context()
        return {
            "stack": asdict(stack),
            "profile": asdict(load_profile(profile)),
            "goal": asdict(PickGoal()),
            "skill": asdict(PickConfig()),
            "timeout": TIMEOUT,
            "user_files": user_files(stack),
        }

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        """Run one trial; see `Rung`."""
        stack = _stack(spec.method, spec.profile, spec.overrides)
        # Far enough apart that two ladders with neighbouring seeds share no scene.
        running, robot = build(stack, seed=spec.seed * 1_000_003 + spec.index)
        oracle = Oracle(robot)
        try:
            watch = _Watch(running, oracle)
            result = running.execute(Pick(running.method), PickGoal(), TIMEOUT, watch=watch)
            running.executor.run(running.executor.t + SETTLE)
            return _judge(stack, result, oracle, watch)
        finally:
            oracle.close()
            robot.close()


class _Watch:
    """Looks on after every tick and remembers the decisive moments."""

    def __init__(self, running: Running, oracle: Oracle) -> None:
        self._running, self._oracle = running, oracle
        self._news = News(running.bus, topics.FEEDBACK, Feedback)
        self.grasp: GraspTruth | None = None
        self.picture: bytes | None = None

    def __call__(self) -> None:
        feedback = self._news.read()
        if feedback is None:
            return
        if feedback.stage == "grasp" and not feedback.data.get("failed"):
            commanded = self._running.commanded(PickGoal().side)
            self.grasp = self._oracle.grasp(PickGoal().side, commanded)
        if feedback.stage == DONE or feedback.data.get("failed"):
            self.picture = self._oracle.picture()


def _stack(method: str, profile: str, overrides: Mapping[str, str]) -> Stack:
    stack = load_stack("tether", profile=profile).with_choice("grasp_method", method)
    for slot, use in overrides.items():
        stack = stack.with_choice(slot, use)
    return stack


def _judge(stack: Stack, result: SkillResult, oracle: Oracle, watch: _Watch) -> TrialOutcome:
    """Say whether a screw is in the tray, and if not, which module lost it."""
    truth = watch.grasp
    series = {} if truth is None else {f"grasp_{name}": value for name, value in asdict(truth).items()}
    if oracle.screws_in_tray() and result.stage not in ABORTED:
        return TrialOutcome(True, DONE, None, result.reason, result.timings, series, watch.picture)
    # The skill may believe it succeeded: then the screw was lost between the pull and the tray.
    stage = result.stage if result.stage != DONE else "place"
    slot = blame(stage, result.slot, truth)
    module = (
        None if slot is None else f"{slot}: {stack.choice(slot).use}" if slot in registry.slots() else slot
    )
    detail = (
        result.reason if result.stage != DONE else "The skill reports success, but no screw is in the tray."
    )
    picture = watch.picture or oracle.picture()
    return TrialOutcome(False, stage, module, detail, result.timings, series, picture)


def blame(stage: str, slot: str | None, truth: GraspTruth | None) -> str | None:
    """Return the slot that lost a failed trial.

    Where the hand missed the screw, the larger of the two errors is to blame: where it was sent (perception and its
    calibration) or where it went (the arm and its calibration). Where it did not miss, an off-axis pull is the arm's,
    and the rest is the grip's.
    """
    if truth is None or stage in ("detect", "servo", "safety", FAULT):
        return slot
    if truth.miss > PAD_REACH:
        return "localizer" if truth.aim >= truth.reach else "upper_body"
    if stage == "extract" and truth.tilt > STRAIGHT:
        return "upper_body"
    return "localizer" if stage == "place" else "grasp_method"
