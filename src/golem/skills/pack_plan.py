"""Where to stand around a pack, in which order, and what to take from there with which hand: little walking, few stops.

Stances are tried along the four sides. One serves a fastener where a hand gets to it, to the place above it and to a
container of its kind, and the head camera sees it. Stops that cover all are chosen greedily from several beginnings
and then exchanged one by one, and two for one, while that saves way (set cover, Chvatal 1979, with local search). All
stops are on one ring around the pack, so the shortest way through them leaves out one gap and turns round at most once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from golem.skills.job_file import PackFastener
from golem.skills.stance_choice import GOOD, LOOK_TURN, OVER_TRAY, VIEWS, seen_from, takes, within_reach
from golem.types import SIDES, Array, PlanarPose, Side

INSET = 0.022
"""Distance of the outer fasteners from the edge of the pack [m]."""
STANDOFFS = (0.36, 0.42, 0.48)
"""Distances of base_link from the edge [m]."""
GRID = 0.06
"""Distance between two stances along an edge [m]."""
CORNER = 0.8
"""Way around a corner, beyond the edge's end, on either side of it [m]."""
THIN = 0.3
"""A list that is less deep than this shows one edge only [m]."""
DOCKING = 4.0
"""Way that a docking is worth [m]: half a minute at a walk between stances [own]."""
WORTH = 1.0
"""Way that it is worth to have all fasteners well within reach instead of just so [m] [own]."""
NEED = 0.25
"""How far within reach a fastener has to be, of `stance_choice.ROOM`, where some stance has it so."""
BARRED = (0.12, 0.3)
"""A stance this near to one from which a fastener was not taken is the same [m, rad]."""
BEGINNINGS = 64
"""Greedy beginnings, of which one in four goes by the gain alone, and the others the more by the way."""
THERE = (0.04, 0.06)
"""How near to its stance the robot stands well [m, rad]: plans have more room than that."""
SPREAD = 0.5
"""How much what a stance gains is varied between them, as a share."""


@dataclass(frozen=True, slots=True)
class PackStop:
    """A place to work from.

    Attributes:
        pose: of base_link in the pack frame.
        picks: numbers of the fasteners and the hands, in order.
        way: way there from the stop before, around the pack [m].
    """

    pose: PlanarPose
    picks: tuple[tuple[int, Side], ...]
    way: float


class PackSides:
    """The four sides of a pack, near, left, far and right, and the ring around it.

    Attributes:
        edges: middle of each, heading across it inwards, in the pack frame.
        halves: half their lengths [m].
        length: of the ring [m].
    """

    def __init__(self, places: Array) -> None:
        """Take the size of the pack from the `places` (n, 3) of all its fasteners in the pack frame."""
        far = float(places[:, 0].max()) + INSET
        right, left = float(places[:, 1].min()) - INSET, float(places[:, 1].max()) + INSET
        x, y, quarter = far / 2.0, (left + right) / 2.0, math.pi / 2.0
        rows = ((0.0, y, 0.0), (x, left, -quarter), (far, y, math.pi), (x, right, quarter))
        self.edges = [PlanarPose(*row) for row in rows][: 1 if far < THIN else 4]
        self.halves = [(left - right) / 2.0, far / 2.0] * 2
        sizes = [2.0 * (half + CORNER) for half in self.halves]
        self._begins = [sum(sizes[:k]) for k in range(4)]
        self.length = sum(sizes)

    def ring(self, pose: PlanarPose) -> float:
        """Return where on the ring a pose in the pack frame is [m]."""
        local = [edge.to(pose) for edge in self.edges]
        k = min(range(len(local)), key=lambda k: local[k].x)
        half = self.halves[k]
        return self._begins[k] + CORNER + half + min(max(local[k].y, -half), half)

    def away(self, pose: PlanarPose) -> float:
        """Return how far a pose in the pack frame is outside the pack [m]."""
        return max(-edge.to(pose).x for edge in self.edges)

    def stances(self) -> list[PlanarPose]:
        """Return the stances that are tried, in the pack frame."""
        found: list[PlanarPose] = []
        for edge, half in zip(self.edges, self.halves, strict=False):
            along = np.arange(-half, half + 1e-9, GRID).tolist()
            found += [edge @ PlanarPose(-d, y, 0.0) for y in along for d in STANDOFFS]
        return found


def make_plan(
    sides: PackSides,
    wanted: Sequence[PackFastener],
    containers: Mapping[str, Array],
    here: PlanarPose,
    rims: Sequence[float],
    keep_off: tuple[Array, float] | None = None,
) -> list[PackStop]:
    """Return the stops, in order, from which everything of `wanted` is served that can be.

    Args:
        wanted: the fasteners to take.
        containers: label of fasteners -> (k, 3) places in the pack frame of what they may be put into; a label without
            is put into what will be seen.
        here: where the robot is, in the pack frame.
        rims: height of the rim above base_link at each height that the robot may stand at [m].
        keep_off: (2,) place in the pack frame and distance from it in which nobody may stand or reach [m].
    """
    poses = sides.stances()
    if keep_off is not None:
        place, distance = keep_off
        poses = [p for p in poses if math.hypot(p.x - place[0], p.y - place[1]) > distance]
        wanted = [one for one in wanted if np.hypot(*(one.place[:2] - place)) > distance]
    if not poses or not wanted:
        return []
    places = np.array([(p.x, p.y, p.yaw) for p in poses])
    at_rims = np.array([_quality(places, wanted, containers, rim) for rim in rims])
    quality = at_rims.max(axis=0)
    for f, one in enumerate(wanted):
        for stance, hand in one.barred:
            gone = [stance.to(p) for p in poses]
            same = [math.hypot(g.x, g.y) < BARRED[0] and abs(g.yaw) < BARRED[1] for g in gone]
            quality[SIDES.index(hand), same, f] *= 0.1 if len(one.barred) == 1 else 0.0  # again, for want of another
    best = quality.max(axis=0)
    served = best > np.where(best.max(axis=0) > NEED, NEED, 0.0)
    ring = np.array([sides.ring(p) for p in poses])
    start = sides.ring(here)
    chosen = choose(served, best, ring, start, sides.length)
    stops: list[PackStop] = []
    owner = np.where(served[chosen], best[chosen], 0.0) if chosen else np.zeros((0, len(wanted)))
    at = start
    for k, s in enumerate(chosen):
        mine = [f for f in range(len(wanted)) if owner[:, f].max() > 0.0 and int(owner[:, f].argmax()) == k]
        hands: dict[int, Side] = {f: SIDES[int(quality[:, s, f].argmax())] for f in mine}
        across = {f: poses[s].to(PlanarPose(wanted[f].listed.x, wanted[f].listed.y, 0.0)).y for f in mine}
        near = {f: at_rims[:, SIDES.index(hands[f]), s, f] for f in mine}
        rim = {f: int((near[f] >= GOOD * near[f].max()).argmax()) for f in mine}  # the first that is good
        mine.sort(key=lambda f: (wanted[f].listed.loose is False, rim[f], hands[f], across[f]))
        way = abs(math.remainder(ring[s] - at, sides.length))
        if mine:
            stops.append(PackStop(poses[s], tuple((wanted[f].number, hands[f]) for f in mine), way))
            at = ring[s]
    return stops


def _quality(stances: Array, wanted: Sequence[PackFastener], containers: Mapping[str, Array], rim: float) -> Array:
    """Return (2, s, n) how far within reach of the hands the fasteners are from stances (s, 3), 0 to 1."""
    lift = np.array([0.0, 0.0, rim])
    quality = np.zeros((len(SIDES), len(stances), len(wanted)))
    for label in {one.label for one in wanted}:
        mine = [f for f, one in enumerate(wanted) if one.label == label]
        places, trays = np.array([wanted[f].place for f in mine]) + lift, containers.get(label)
        turned = seen_from(stances, places, LOOK_TURN) | seen_from(stances, places, -LOOK_TURN)
        seen = np.where(seen_from(stances, places, 0.0), VIEWS[0], VIEWS[1] * turned)
        for k, side in enumerate(SIDES):
            near = takes(stances, places, side) * seen
            if trays is not None:
                near *= within_reach(stances, trays + lift + (0.0, 0.0, OVER_TRAY), side).max(axis=1, keepdims=True)
            quality[k][:, mine] = near
    return quality


def choose(served: NDArray[np.bool_], best: Array, ring: Array, start: float, length: float) -> list[int]:
    """Return the stances to stop at, in order: they cover what any does, for little way and few dockings.

    Args:
        served: (s, n) what each serves.
        best: (s, n) how well, 0 to 1.
        ring: (s,) where they are on the ring [m].
        start: where the robot is on it [m].
        length: of the ring [m].
    """
    todo = served.any(axis=0)
    if not todo.any():
        return []

    def costs(stops: NDArray[np.intp]) -> Array:
        """Return (m,) what each row of `stops` (m, k) costs, as a way [m]."""
        well = np.where(served[stops], best[stops], 0.0).max(axis=1).mean(axis=1)
        return DOCKING * stops.shape[1] + way(ring[stops], start, length)[0] - WORTH * well

    found, rng = list[tuple[float, list[int]]](), np.random.default_rng(0)
    for begin in range(BEGINNINGS):
        stops, left, eager = list[int](), todo.copy(), 0.5 * (begin % 4)
        luck = rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, len(served)) if begin > 3 else np.ones(len(served))
        while left.any():
            gain = luck * (served[:, left] * (1.0 + 0.1 * best[:, left])).sum(axis=1)
            from_here = np.abs((ring[:, None] - [start, *ring[stops]] + length / 2) % length - length / 2).min(axis=1)
            stops.append(int(np.argmax(gain / (DOCKING + eager * from_here))))
            left &= ~served[stops[-1]]
        found.append(_improved(stops, served & todo, costs))
    stops = min(found)[1]
    return [stops[k] for k in way(ring[stops], start, length)[1]]


def _improved(
    stops: list[int], served: NDArray[np.bool_], costs: Callable[[NDArray[np.intp]], Array]
) -> tuple[float, list[int]]:
    """Return stops that cover the same, after every exchange of two or one for none or one that costs less."""
    todo = served.any(axis=0)
    cost, again = float(costs(np.array([stops], np.intp))[0]), True
    while again:
        again = False
        for out in [out for count in (1, 2) for out in combinations(range(len(stops)), count)]:
            kept = np.array([s for k, s in enumerate(stops) if k not in out], np.intp)
            need = todo & ~served[kept].any(axis=0)
            fits = np.flatnonzero(served[:, need].all(axis=1))
            groups = [np.column_stack([np.tile(kept, (len(fits), 1)), fits])] if len(fits) else []
            for group in [*groups, *([kept[None]] if len(kept) and not need.any() else [])]:
                tried = costs(group)
                k = int(tried.argmin())
                if tried[k] < cost - 1e-9:
                    stops, cost, again = group[k].tolist(), float(tried[k]), True
            if again:
                break
    return cost, stops


def way(places: Array, start: float, length: float) -> tuple[Array, NDArray[np.intp]]:
    """Return how long the shortest way along a ring through places (..., k) is [m], and their order (..., k) on it."""
    ahead = (places - start) % length
    order = np.argsort(ahead, axis=-1, kind="stable")
    ahead = np.take_along_axis(ahead, order, axis=-1)
    nothing = np.zeros((*places.shape[:-1], 1))
    forth = np.concatenate([nothing, ahead], axis=-1)
    back = np.concatenate([length - ahead, nothing], axis=-1)
    total = forth + back + np.minimum(forth, back)
    gap = total.argmin(axis=-1)
    if places.ndim == 1:
        first, rest = order[:gap], order[gap:][::-1]
        order = np.concatenate([first, rest] if forth[gap] <= back[gap] else [rest, first])
    return total.min(axis=-1), order


def stands_well(left: PlanarPose) -> bool:
    """Return whether a robot stands near enough to its stance that has `left` to go."""
    return math.hypot(left.x, left.y) < THERE[0] and abs(left.yaw) < THERE[1]
