"""Which objects a pick tries, with which hand, and in which order: looks with the head camera."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np

from golem.capabilities.arms.reach_map import load_map
from golem.capabilities.grasping.ground import height_above_ground
from golem.capabilities.planning.base import PlanRefused
from golem.interfaces.payloads import Detections
from golem.skills.context import Context
from golem.skills.pick_config import PickConfig, PickGoal
from golem.skills.pick_report import PickFailed, PickOutcome, Tried
from golem.skills.planned_motion import PlannedMotion
from golem.types import SIDES, Array, LocalizedObject, Side

TORSO = 0
"""Column of the torso's yaw among the joints of torso and arms."""


@dataclass(frozen=True, slots=True)
class Attempt:
    """An object to take, where to, and with which hand."""

    label: str
    container: str
    side: Side
    target: LocalizedObject

    @property
    def first_seen(self) -> Tried:
        """What is known of it before it was tried."""
        x, y, z = (float(v) for v in self.target.position)
        return Tried(self.side, x, y, z)


@dataclass(frozen=True, slots=True)
class _View:
    """What is known after a look.

    Attributes:
        attempts: the reachable objects.
        container: the container.
        problem: what is missing, as a failure.
    """

    attempts: list[Attempt] = field(default_factory=list[Attempt])
    container: LocalizedObject | None = None
    problem: PickFailed | None = None


def _missing(
    goal: PickGoal, container: LocalizedObject | None, attempts: list[Attempt], seen: bool
) -> PickFailed | None:
    """Return what a look lacks; `seen`: whether it showed such an object at all."""
    if attempts and container is not None:
        return None
    missing = goal.container if attempts else f"reachable {goal.label}"
    outcome = PickOutcome.OUT_OF_REACH if seen else PickOutcome.NOTHING_THERE
    outcome = PickOutcome.TRAY_MISSING if container is None and seen else outcome
    return PickFailed(outcome, "detect", "localizer", f"The head camera shows no {missing}.")


class TargetChoice:
    """Looks and chooses."""

    def __init__(self, config: PickConfig) -> None:
        """Take workspace and comfort from `config`."""
        self._config = config

    async def look(self, context: Context, goal: PickGoal) -> tuple[list[Attempt], LocalizedObject]:
        """Look with the head camera: the reachable objects and the container.

        Where one of them is not in view, the torso turns to either side for another look. Objects that stand proud
        come first, and of them the most comfortable ones.
        """
        context.say("detect", f"Looking for a {goal.label} and a {goal.container}.")
        view = await self._see(context, goal, _View())
        unseen = view.problem is not None and view.problem.outcome is not PickOutcome.FAILED
        if unseen and self._config.turn > 0.0:
            view = await self._look_around(context, goal, view)
        if view.problem is not None:
            raise view.problem
        assert view.container is not None  # it would be the problem
        attempts = view.attempts
        if goal.side == "either":
            attempts = [a for a in attempts if self._serves(context, a.side, view.container)] or attempts
        attempts.sort(key=lambda a: (self._stands_low(a.target), self._discomfort(context, a.side, a.target)))
        chosen = attempts[: self._config.candidates]
        text = f"{len(attempts)} {goal.label}s in reach."
        context.say("detect", text, target=chosen[0].target.position.tolist())
        return chosen, view.container

    async def _look_around(self, context: Context, goal: PickGoal, view: _View) -> _View:
        """Turn the torso to either side until both are seen, and back; the arms come along."""
        motion, ahead = PlannedMotion(context), context.commanded_joints.copy()
        context.say("detect", f"{view.problem} Looking around.")
        for turn in (self._config.turn, -self._config.turn):
            turned = ahead.copy()
            turned[TORSO] += turn
            with suppress(PlanRefused):
                await motion.to_joints(turned, (), self._config.travel_speed)
                view = await self._see(context, goal, view)
            if view.problem is None:
                break
        with suppress(PlanRefused):
            await motion.to_joints(ahead, (), self._config.travel_speed)
        return view

    async def _see(self, context: Context, goal: PickGoal, before: _View) -> _View:
        """Look until object and container are known, from this view or from those `before`."""
        sides: tuple[Side, ...] = SIDES if goal.side == "either" else (goal.side,)
        container, attempts = before.container, before.attempts
        problem: PickFailed | None = PickFailed(
            PickOutcome.FAILED, "detect", "localizer", "The head camera gave no detections in time."
        )
        with context.watch("head", goal.label, goal.container) as eye:
            end = context.t + self._config.look_timeout
            while problem is not None:
                sightings = await eye.look(end - context.t)
                if sightings is None:
                    break
                containers = [o for o in sightings.objects if o.label == goal.container]
                container = max(containers, key=lambda o: o.detection.score, default=before.container)
                attempts = before.attempts or [
                    Attempt(goal.label, goal.container, side, o)
                    for side in sides
                    for o in self._reachable(context, goal, side, sightings, container)
                ]
                seen = bool(before.attempts) or any(o.label == goal.label for o in sightings.objects)
                problem = _missing(goal, container, attempts, seen)
        return _View(attempts, container, problem)

    def _reachable(
        self,
        context: Context,
        goal: PickGoal,
        side: Side,
        sightings: Detections,
        container: LocalizedObject | None,
    ) -> list[LocalizedObject]:
        """Return the objects within the workspace of a hand, without those that lie in the container already."""
        x0, x1, y0, y1, z0, z1 = self._config.workspace

        def wanted(o: LocalizedObject) -> bool:
            if o.label != goal.label:
                return False
            if container is not None:
                apart = np.hypot(*(o.position - container.position)[:2])
                if apart < self._config.container_radius:
                    return False
            x, y, z = p = _in_base(context, side, o.position)
            if self._config.travel == "planned":
                return load_map().serves("right", p)
            return x0 <= x <= x1 and y0 <= y <= y1 and z0 <= z <= z1

        return [o for o in sightings.objects if wanted(o)]

    def _serves(self, context: Context, side: Side, container: LocalizedObject) -> bool:
        """Return whether a hand need not reach across the body to the container."""
        return bool(_in_base(context, side, container.position)[1] <= self._config.workspace[3])

    def _stands_low(self, o: LocalizedObject) -> bool:
        """Return whether an object looks as if it were screwed down; the head camera is not sure of it."""
        height = height_above_ground(o)
        return height is not None and height < self._config.proud

    def _discomfort(self, context: Context, side: Side, o: LocalizedObject) -> float:
        x, y, _ = _in_base(context, side, o.position)
        return float(np.hypot(x - self._config.comfort[0], y - self._config.comfort[1]))


def _in_base(context: Context, side: Side, position: Array) -> Array:
    """Return (3,) `position` in base_link [m], mirrored for the left hand as if it were the right."""
    T = context.T_odom_base
    p = T[:3, :3].T @ (position - T[:3, 3])
    return p if side == "right" else p * (1.0, -1.0, 1.0)
