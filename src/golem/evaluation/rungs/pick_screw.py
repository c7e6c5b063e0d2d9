"""Rungs `tether` and `stand`: pick one loosened screw, in the hoist or on the robot's own feet.

Both run the same trials: trial `i` of one seed has the same screws, calibration errors and noise on either rung, so
that `golem compare` of two runs says what balancing costs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from golem import registry
from golem.errors import ConfigError
from golem.evaluation.base import DONE, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import HANGS, READY, Loss, episode_seed, lost
from golem.evaluation.episodes.oracle import GraspTruth, Oracle
from golem.interfaces import topics
from golem.middleware.bus import News
from golem.provenance import stack_facts
from golem.robots.mujoco.balance import TRACE, BalanceRecorder, BalanceTrace
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.gl import shared_context
from golem.robots.sensors.profiles import PROFILES
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.base import SkillResult
from golem.skills.pick import TIMEOUT, Pick, PickConfig, PickGoal
from golem.skills.runner import FAULT
from golem.stack import Stack, load_stack

SLOT = "grasp_method"
"""What the methods of these rungs are."""
STANDING = "stand"
"""Name of the rung, and of the stack, whose robot balances."""
RELEASED = 1.0
"""Time between a robot that balances carrying its weight and its errand [s]."""
SETTLE = 0.5
"""Robot time a dropped screw gets to come to rest [s]."""
ABORTED = ("safety", FAULT, "timeout")
"""Stages at which a skill was ended from outside: not a success, wherever the screw is."""
PAD_REACH = 0.008
"""Half width of a finger pad [m]: a hand further off than this cannot hold the screw."""
STRAIGHT = 0.087
"""Tilt beyond which an extraction counts as off axis [rad]: 5 deg."""


class PickRung:
    """One screw per trial: seen, approached, grasped, pulled out, dropped in the tray.

    Attributes:
        name: of the rung, and of the shipped stack it runs.
    """

    name: str
    profiles = tuple(PROFILES)

    def methods(self) -> tuple[str, ...]:
        """Return the registered grasp methods."""
        return registry.names(SLOT)

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        """Return what determines a trial besides its seed; see `Rung`."""
        stack = self._stack(method, profile, overrides)
        classes = {slot: registry.load(slot, stack.choice(slot).use) for slot in registry.slots()}
        if not issubclass(classes["robot"], MujocoRobot):
            raise ConfigError(
                f"Rung {self.name} judges on the simulator's truth; robot: {stack.choice('robot').use} is not the "
                "twin, 'mujoco'."
            )
        shared_context()
        return {
            **stack_facts(stack),
            "goal": asdict(PickGoal()),
            "skill": asdict(PickConfig()),
            "timeout": TIMEOUT,
        }

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        """Run one trial; see `Rung`."""
        stack = self._stack(spec.method, spec.profile, spec.overrides)
        running, robot = build(stack, episode_seed(spec.seed, spec.index))
        oracle = Oracle(robot)
        try:
            if self.balances:
                running.executor.run(READY, lambda: not robot.on_gantry)
                if robot.on_gantry:
                    return TrialOutcome(
                        False, HANGS.stage, f"lower_body: {stack.choice('lower_body').use}", HANGS.detail
                    )
                running.executor.run(running.executor.t + RELEASED)
            watch = _Watch(running, oracle, BalanceRecorder(robot) if self.balances else None)
            result = running.execute(Pick(running.method), PickGoal(), TIMEOUT, watch=watch)
            running.executor.run(running.executor.t + SETTLE, watch.look)
            if artefacts is not None and watch.recorder is not None:
                watch.recorder.trace().save(artefacts / TRACE)
            return _judge(stack, result, oracle, watch, lost(running, watch.recorder))
        finally:
            oracle.close()
            robot.close()

    @property
    def balances(self) -> bool:
        """Whether the robot stands on its own feet."""
        return self.name == STANDING

    def _stack(self, method: str, profile: str, overrides: Mapping[str, str]) -> Stack:
        if SLOT in overrides:
            raise ConfigError(f"The method is what sits in {SLOT}; leave out --use {SLOT}=...")
        stack = load_stack(self.name, profile=profile).with_choice(SLOT, method)
        for slot, use in overrides.items():
            stack = stack.with_choice(slot, use)
        if stack.on_ground != self.balances:
            raise ConfigError(
                f"Rung {self.name} has a robot {'on its feet' if self.balances else 'in its hoist'}, and this one is "
                "not; leave out --use robot=..."
            )
        return stack


class TetherRung(PickRung):
    """The robot hangs in its hoist: perception and manipulation without balance."""

    name = "tether"


class StandRung(PickRung):
    """The robot balances while its arms work; the lower body can be replaced with `--use lower_body=...`."""

    name = STANDING


class _Watch:
    """Looks on after every tick and remembers the decisive moments."""

    def __init__(self, running: LockstepRunner, oracle: Oracle, recorder: BalanceRecorder | None) -> None:
        self._running, self._oracle = running, oracle
        self.recorder = recorder
        self._news = News(running.bus, topics.FEEDBACK)
        self.grasp: GraspTruth | None = None
        self.picture: bytes | None = None

    def look(self) -> bool:
        """Look on after the errand; it is never a reason to end."""
        if self.recorder is not None:
            self.recorder(self._running.executor.t)
        return False

    def __call__(self) -> None:
        self.look()
        feedback = self._news.read()
        if feedback is None:
            return
        if feedback.stage == "grasp" and not feedback.data.get("failed"):
            commanded = self._running.commanded(PickGoal().side)
            self.grasp = self._oracle.grasp(PickGoal().side, commanded)
        if feedback.stage == DONE or feedback.data.get("failed"):
            self.picture = self._oracle.picture()


def _judge(
    stack: Stack, result: SkillResult, oracle: Oracle, watch: _Watch, loss: Loss | None
) -> TrialOutcome:
    """Say whether a screw is in the tray and the robot still there, and if not, which module lost it."""
    truth = watch.grasp
    series = {} if truth is None else {f"grasp_{name}": value for name, value in asdict(truth).items()}
    if watch.recorder is not None:
        series |= balance(watch.recorder.trace())
    if loss is not None and result.stage not in ABORTED:
        module = f"lower_body: {stack.choice('lower_body').use}" if stack.on_ground else None
        detail = f"{loss.detail} The errand itself: {result.reason}"
        return TrialOutcome(False, loss.stage, module, detail, result.timings, series, oracle.picture())
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


def balance(stood: BalanceTrace) -> dict[str, float]:
    """Return how a robot stood that worked."""
    if not len(stood.t):
        return {}
    return {
        "margin_median": float(np.median(stood.margin)),
        "margin_min": float(stood.margin.min()),
        "below_zero": stood.below_zero,
        "sway": stood.sway,
        "steps": float(stood.steps),
    }


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
    return "localizer" if stage == "place" else SLOT
