"""Which objects a pick tries, with which hand, and in which order, and the container they go into."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.arms.reach_map import load_map
from golem.capabilities.grasping.object_cloud import height_above_ground
from golem.capabilities.planning.base import PlanRefused
from golem.interfaces.payloads import Detections
from golem.skills.container import Container
from golem.skills.context import Context
from golem.skills.pick_config import PickConfig, PickFailed, PickGoal, PickOutcome, Tried
from golem.skills.planned_motion import PlannedMotion
from golem.skills.poses import counts_at, floor_places, stands_at
from golem.skills.stance_choice import seen_from
from golem.types import SIDES, Array, Detection, LocalizedObject, Side

AROUND: Array = np.array([[0.0, 0.0, 0.0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], float)
"""Directions in which something may be elsewhere than the head camera says."""


class HandReach:
    """Asks the map of reach, or the box of the configuration, from where the base is now."""

    def __init__(self, context: Context, config: PickConfig) -> None:
        """Take the base from `context`, and slack, box and heights from `config`."""
        self._T, self._config = context.T_odom_base, config
        self._mapped = config.travel == "planned"

    def takes(self, side: Side, position: Array) -> bool:
        """Return whether a hand comes to an object at `position` (3,) in odom, as far as the head camera tells."""
        x, y, z = p = self._in_base(side, position)
        if self._mapped:
            return any(load_map().serves("right", p + d) for d in self._config.slack * AROUND)
        x0, x1, y0, y1, z0, z1 = self._config.workspace
        return x0 <= x <= x1 and y0 <= y <= y1 and z0 <= z <= z1

    def drops(self, side: Side, places: Array, slack: bool) -> NDArray[np.bool_]:
        """Return (n,) above which of `places` (n, 3) in odom a hand can let go.

        Args:
            places: in odom [m].
            slack: whether those count, too, that the head camera may show a little too far away.
        """
        over = self._in_base(side, places + (0.0, 0.0, self._config.drop_height))
        if not self._mapped:
            return over[:, 1] <= self._config.workspace[3]
        around = self._config.slack * AROUND if slack else AROUND[:1]
        return np.array([any(load_map().serves("right", p + d) for d in around) for p in over])

    def drop_order(self, side: Side, places: Array, most: int) -> Array:
        """Return up to `most` of `places` (n, 3) in odom to try: half as they come, surely in reach, then near ones."""
        over = self._in_base(side, places + (0.0, 0.0, self._config.drop_height))
        surely = np.flatnonzero(self.drops(side, places, slack=False)).tolist()
        away = np.hypot(over[:, 0] - self._config.comfort[0], over[:, 1] - self._config.comfort[1])
        return places[list(dict.fromkeys([*surely[: most // 2], *np.argsort(away).tolist()]))[:most]]

    def discomfort(self, side: Side, position: Array) -> float:
        """Return how far an object at `position` (3,) in odom is from where the arm works best [m]."""
        x, y, _ = self._in_base(side, position)
        return float(np.hypot(x - self._config.comfort[0], y - self._config.comfort[1]))

    def _in_base(self, side: Side, position: Array) -> Array:
        """Return (3,) or (n, 3) `position` in base_link [m], mirrored for the left hand as if it were the right."""
        p = (position - self._T[:3, 3]) @ self._T[:3, :3]
        return p if side == "right" else p * (1.0, -1.0, 1.0)


TORSO = 0
"""Column of the torso's yaw among the joints of torso and arms."""
MOST = 0.5
"""A hand that reaches this share of the container's places surely reaches some, however much the head camera is off."""
SAME = 0.04
"""What two looks show this near to each other is one object [m]; screws stand 9 cm apart."""
CLOSE = 0.015
"""The same where it is known which one is wanted [m]: real ones stand 24 mm apart, and one tried twice is only slow."""
WANTED = 0.045
"""How far from where it is wanted, or listed, the head camera may show an object [m]: half a pitch."""
LEVEL = 0.04
"""How far above or below its level an object may be seen [m]: those of a real pack are 65 mm apart."""
FRAMES = 5
"""Frames after which an object of a list that they do not show is not waited for."""
BESIDE = 0.12
"""How far from where it is known to be a container may be seen [m]: half a length, they stand side by side."""
ALIKE = {"screw": ("nut",), "nut": ("screw",)}
"""Classes that cameras mistake for each other."""


def names_of(label: str, wanted: Sequence[float] | Array) -> tuple[str, ...]:
    """Return the classes that count as `label`: where the places are known that are `wanted`, those alike, too."""
    return (label, *(ALIKE.get(label, ()) if len(wanted) else ()))


def called(thing: LocalizedObject, label: str) -> LocalizedObject:
    """Return a thing under another class."""
    return thing if thing.label == label else replace(thing, detection=replace(thing.detection, label=label))


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
class PickChoice:
    """What a pick goes for.

    Attributes:
        attempts: the objects to try, in order.
        container: what to drop one into.
        seen: (n, 3) where the head camera saw such objects, those in the container, too, in odom [m].
    """

    attempts: list[Attempt]
    container: Container
    seen: Array


@dataclass(frozen=True, slots=True)
class _View:
    """What is known after a look.

    Attributes:
        objects: all such objects.
        container: the container.
        attempts: the objects that a hand can take which reaches the container.
        problem: what is missing, as a failure.
    """

    objects: list[LocalizedObject] = field(default_factory=list[LocalizedObject])
    container: Container | None = None
    attempts: list[Attempt] = field(default_factory=list[Attempt])
    problem: PickFailed | None = None


class TargetChoice:
    """Looks and chooses."""

    def __init__(self, config: PickConfig) -> None:
        self._config = config

    async def look(self, context: Context, goal: PickGoal) -> PickChoice:
        """Look with the head camera: the reachable objects and the container.

        Where something is missing, or few objects are seen, the torso turns to either side for another look. The hand
        comes first that reaches most of the container; then objects that stand proud, and of them the most comfortable
        ones.

        Raises:
            PickFailed: something is missing, or out of reach, or the container is full.
        """
        context.say("detect", f"Looking for a {goal.label} and a {goal.container}.")
        view = self._or_listed(context, goal, await self._see(context, goal, _View()))
        blind = view.problem is not None and view.problem.outcome is PickOutcome.FAILED
        if not blind and not self._enough(goal, view) and self._config.turn > 0.0:
            view = await self._look_around(context, goal, view)
        if view.problem is not None:
            raise view.problem
        assert view.container is not None  # it would be the problem
        box = view.container.box
        if box is not None and box.full:
            raise PickFailed(PickOutcome.TRAY_FULL, "detect", "localizer", f"The {goal.container} is full.")
        reach = HandReach(context, self._config)
        places = view.container.places(self._config.drop_margin)
        share = {side: float(reach.drops(side, places, slack=False).mean()) for side in SIDES}

        wanted = floor_places("a pick", goal.wanted)

        def order(a: Attempt) -> tuple[bool, float, bool, float]:
            place = a.target.position
            off = float(np.linalg.norm(wanted - place[:2], axis=1).min()) if len(wanted) else 0.0
            return (share[a.side] < MOST, off, self._stands_low(a.target), reach.discomfort(a.side, place))

        chosen = sorted(view.attempts, key=order)[: self._config.candidates]
        text = f"{len(view.attempts)} {goal.label}s in reach."
        context.say("detect", text, target=chosen[0].target.position.tolist())
        return PickChoice(chosen, view.container, np.array([o.position for o in view.objects]))

    def _or_listed(self, context: Context, goal: PickGoal, view: _View) -> _View:
        """Return the view with what is wanted where it is listed, if it shows nothing there: the hand looks better."""
        if view.problem is None or view.problem.outcome is not PickOutcome.NOTHING_THERE or not goal.level:
            return view
        return self._added(context, goal, view, _as_listed(context.t, goal))

    async def _look_around(self, context: Context, goal: PickGoal, view: _View) -> _View:
        """Turn the torso to either side until enough is seen, and back; the arms come along."""
        motion, ahead, turns = PlannedMotion(context), context.commanded_joints.copy(), self._turns(context, goal, view)
        if not turns:
            return view
        context.say("detect", f"{view.problem or f'Few {goal.label}s are seen.'} Looking around.")
        for turn in turns:
            turned = ahead.copy()
            turned[TORSO] += turn
            with suppress(PlanRefused):
                await motion.to_joints(turned, (), self._config.travel_speed)
                view = await self._see(context, goal, view)
            if self._enough(goal, view):
                break
        with suppress(PlanRefused):
            await motion.to_joints(ahead, (), self._config.travel_speed)
        return view

    def _turns(self, context: Context, goal: PickGoal, view: _View) -> list[float]:
        """Return how the torso may turn to see more [rad]; what is wanted may be in view, and not be there."""
        turns, wanted = [self._config.turn, -self._config.turn], floor_places("a pick", goal.wanted)
        if not len(wanted) or not view.objects or view.container is None:
            return turns
        height = float(np.median([o.position[2] for o in view.objects]))
        T, places = context.T_odom_base, np.column_stack([wanted, np.full(len(wanted), height)])
        here, local = np.zeros((1, 3)), (places - T[:3, 3]) @ T[:3, :3]
        return [] if seen_from(here, local, 0.0).any() else [t for t in turns if seen_from(here, local, t).any()]

    def _enough(self, goal: PickGoal, view: _View) -> bool:
        """Return whether nothing is missing, and not so few objects are seen that others may have been overlooked."""
        return view.problem is None and (bool(goal.wanted) or len(view.attempts) >= self._config.few)

    async def _see(self, context: Context, goal: PickGoal, before: _View) -> _View:
        """Look until nothing is missing, adding to what is known from the view `before`."""
        view = _View(
            before.objects,
            before.container,
            problem=PickFailed(
                PickOutcome.FAILED, "detect", "localizer", "The head camera gave no detections in time."
            ),
        )
        names = names_of(goal.label, goal.wanted)
        with context.watch("head", *names, goal.container, doubtful=(goal.container,)) as eye:
            end, frames = context.t + self._config.look_timeout, 0
            while view.problem is not None and not (goal.level and view.container and frames >= FRAMES):
                sightings = await eye.look(end - context.t)
                if sightings is None:
                    break
                view, frames = self._added(context, goal, view, sightings), frames + 1
        return view

    def _added(self, context: Context, goal: PickGoal, view: _View, sightings: Detections) -> _View:
        container, objects, at = view.container, list(view.objects), floor_places("a pick", goal.container_at)
        containers = [
            Container.of(o, self._config.container_radius)
            for o in sightings.objects
            if o.label == goal.container and counts_at(o.position, at, BESIDE)
        ]
        believed = [c for c in containers if c.box is not None or c.sighting.detection.score >= self._config.sure]
        container = max(believed, key=lambda c: c.sighting.detection.score, default=container)
        reach, wanted = HandReach(context, self._config), floor_places("a pick", goal.wanted)
        names, apart = names_of(goal.label, wanted), CLOSE if len(wanted) else SAME
        for new in (o for o in sightings.objects if o.label in names):
            if all(np.linalg.norm(new.position - known.position) > apart for known in objects):
                objects.append(called(new, goal.label))
        mine = [o for o in objects if counts_at(o.position, wanted, WANTED) and not _listed_apart(goal, o.position)]
        mine = [o for o in mine if all(abs(float(o.position[2]) - level) < LEVEL for level in goal.level)]
        attempts = [
            Attempt(goal.label, goal.container, side, o)
            for side in (SIDES if goal.side == "either" else (goal.side,))
            for o in mine
            if reach.takes(side, o.position) and not (container and container.holds(o.position[None])[0])
        ]
        if not attempts:
            outcome = PickOutcome.OUT_OF_REACH if mine else PickOutcome.NOTHING_THERE
            outcome = PickOutcome.TRAY_MISSING if mine and container is None else outcome
            return _View(objects, container, [], _missing(outcome, f"reachable {goal.label}"))
        if container is None:
            return _View(objects, container, [], _missing(PickOutcome.TRAY_MISSING, goal.container))
        places = container.places(self._config.drop_margin)
        left = [a for a in attempts if reach.drops(a.side, places, slack=True).any()]
        if left:
            avoid = floor_places("a pick", goal.avoid)
            others = [a for a in left if not stands_at(a.target.position, avoid, SAME)]
            return _View(objects, container, others or left)
        text = f"No hand that reaches a {goal.label} reaches any place in the {goal.container}."
        problem = PickFailed(PickOutcome.TRAY_OUT_OF_REACH, "detect", "upper_body", text)
        return _View(objects, container, [], problem)

    def _stands_low(self, o: LocalizedObject) -> bool:
        """Return whether an object looks as if it were screwed down; the head camera is not sure of it."""
        height = height_above_ground(o)
        return height is not None and height < self._config.proud


def _listed_apart(goal: PickGoal, position: Array) -> bool:
    """Return whether a place (3,) is nearer to something else of the list than to what is wanted."""
    if not (goal.wanted and goal.level and goal.landmarks):
        return False
    wanted = np.array([*goal.wanted[:2], goal.level[0]])
    away = np.linalg.norm(np.array(goal.landmarks).reshape(-1, 3) - position, axis=1)
    return bool(away.min() < np.linalg.norm(wanted - position) - 1e-3)


def _as_listed(t: float, goal: PickGoal) -> Detections:
    """Return what is wanted as if it were seen where it is listed."""
    position, nowhere = np.array([*goal.wanted[:2], goal.level[0]]), np.zeros(2)
    there = LocalizedObject(Detection(goal.label, 0.0, np.zeros(4), nowhere), t, position, position[None])
    return Detections(t, "head", (there,))


def _missing(outcome: PickOutcome, what: str) -> PickFailed:
    return PickFailed(outcome, "detect", "localizer", f"The head camera shows no {what}.")


def positions(sightings: Detections, labels: Sequence[str]) -> Array:
    """Return (n, 3) where the objects of some classes are, in odom [m]."""
    return np.array([o.position for o in sightings.objects if o.label in labels]).reshape(-1, 3)
