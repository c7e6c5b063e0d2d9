"""Antipodal grasps: two points of a cloud between which the line lies in both friction cones (Nguyen 1988).

Pairs are drawn from the object's cloud, by its normals, and from its outline as the coming hand sees it: one camera
shows no more than the front of a thing, and the sides that fingers close on are its outline. Others lie across a rim:
that is how a bowl that is wider than the hand is taken. Hands are laid along each
pair with approaches around the wanted one, and those whose fingers or palm would be where the cloud has something are
dropped (ten Pas et al., GPD, IJRR 2017).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.grasping import object_cloud
from golem.capabilities.grasping.base import Grasp, Gripper, OpenLoop
from golem.capabilities.grasping.centroid import ACROSS, UP
from golem.capabilities.grasping.hand_view import collides, in_hands
from golem.capabilities.grasping.object_cloud import MIN_POINTS, across, fullest, object_points, spaced, thinned
from golem.capabilities.grasping.rims import THIN, outline, rim_pairs
from golem.finite import check_finite
from golem.options import require
from golem.types import Array, LocalizedObject

BETWEEN = 600
"""Points of the object on which hands are fitted."""
DEPTHS = (0.045, 0.025, 0.0)
"""How much deeper than need be the fingertips go where that is free [m]: what is held by its edge turns and slips."""
TIPS = 0.089
"""How far beyond the nearest of a thing the fingertips go at most [m]: the palm stays 6 mm before it."""
NARROW = 0.045
"""Width up to which fingers do not go deepest [m]."""
SHALLOW = 0.8
"""What a grasp counts that goes one of these less deep."""
SLANTED = 0.1
"""Sine of the angle from which on a pair across a rim lies aslant."""
LEANS = (0.0, 0.3, -0.3, 0.6, -0.6)
"""How far hands lean about the closing axis [rad]."""
ROUND = 0.03
"""Greatest half width for which a thing that is seen across is taken to be round [m]: half of the hand's."""
TWISTS: Array = np.array([2.0, 0.5])
"""How much it counts that a thing hangs beside the fingers, across the closing axis and along it."""
HANGS = 0.06
"""Height of the fingertips above the thing's middle at which a grasp counts 1 / e [m]: a bottle that hangs on its neck
swings and slides out."""
LAYER, ABOUT = 0.006, 0.12
"""Thickness of the layer of points that a surface below is, and radius around the thing in which it is [m]."""
SPARE, TIGHT = 0.015, 0.4
"""Opening beyond what a grasp asks for that leaves nothing to be wished [m], and what a grasp without it counts."""
COMPACT = 0.10
"""Greatest width of a thing that is held in its middle [m]."""
SCENE = 20000
"""Points of the surroundings that are looked at."""


@dataclass(frozen=True)
class AntipodalConfig:
    """How grasps are drawn and judged.

    Attributes:
        friction: coefficient of the pads on the object; its arc tangent is half the angle of the cones.
        points: points of the object that are used at most.
        pairs: pairs of points that are drawn.
        laid: the best pairs along which hands are laid.
        most: grasps that are returned at most.
        tilt: how far the approach may lean away from the wanted one [rad].
        depth: how far beyond the pair the fingertips go [m].
        room: what the fingers leave on either side when they arrive [m].
        apart: two grasps nearer than this, and turned by less than `alike`, are one [m].
        alike: angle between approaches of one grasp [rad].
        seed: of the draws.
        latency: declared time of a proposal [s]; `golem bench grasp` measures it.
    """

    friction: float = 0.6
    points: int = 2000
    pairs: int = 20000
    laid: int = 80
    most: int = 64
    tilt: float = 0.6
    depth: float = 0.015
    room: float = 0.012
    apart: float = 0.005
    alike: float = 0.15
    seed: int = 0
    latency: float = 0.06

    def __post_init__(self) -> None:
        require(
            "antipodal ",
            ("friction", self.friction, 0.0 < self.friction <= 2.0, "from 0 to 2"),
            ("tilt", self.tilt, 0.0 <= self.tilt <= math.pi / 2, "from 0 to pi / 2 rad"),
            ("pairs", self.pairs, 1 <= self.pairs <= 1_000_000, "from 1 to 1000000"),
            ("points", self.points, MIN_POINTS <= self.points <= 20000, f"from {MIN_POINTS} to 20000"),
        )


class Antipodal(OpenLoop):
    """Grasps on pairs of points that hold by friction, free of what the cloud shows; see `GraspMethod`."""

    def __init__(self, config: AntipodalConfig | None = None) -> None:
        self.config = config or AntipodalConfig()
        self.latency = self.config.latency

    def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:
        check_finite("the object's position", target.position)
        c = self.config
        down = gripper.approach if gripper.approach[2] < -ACROSS else None
        cloud = object_points(target.points, target.position, c.seed, down)
        if len(cloud) < MIN_POINTS:
            return []
        cloud = thinned(cloud, c.points, c.seed)
        middles, axes, widths, quality, rims = self._pairs(cloud, gripper)
        if not len(middles):
            return []
        room = float(np.quantile(cloud @ gripper.approach, 0.01)) + TIPS - middles @ gripper.approach
        T, turned, index, worth = self._hands(middles, axes, widths, room, gripper, rims)
        if not len(T):
            return []
        T, gaps, held = self._fit(T, widths[index], thinned(cloud, BETWEEN, c.seed), index >= len(middles) - rims)
        # What hangs beside the closing axis turns about it, and friction alone is against that; along it, pads are.
        off = np.einsum("nij,ni->nj", T[:, :3, :2], T[:, :3, 3] - cloud.mean(axis=0))
        size = float(np.linalg.norm(cloud.std(axis=0))) + 1e-6
        score = quality[index] * (1.0 - 0.3 * turned / max(c.tilt, 1e-6))
        score *= np.exp(-(off**2) @ TWISTS / size**2)
        score *= np.minimum(held / 6.0, 1.0) * worth
        above = np.maximum(T[:, 2, 3] - _middle_height(cloud, scene, gripper.approach), 0.0)
        score *= np.exp(-((above / HANGS) ** 2))
        # A hand that is as wide as it gets, and a few millimetres off, comes down on what it is to hold.
        score *= np.clip((gripper.max_gap - gaps) / SPARE, TIGHT, 1.0)
        good = np.flatnonzero((gaps <= gripper.max_gap) & (held > 0))
        kept = self._distinct(T, gaps, good[np.argsort(-score[good], kind="stable")], self._around(cloud, scene))
        return [Grasp(T[k].copy(), float(gaps[k]), float(score[k])) for k in kept]

    def _pairs(self, cloud: Array, gripper: Gripper) -> tuple[Array, Array, Array, Array, int]:
        """Return middles (n, 3), closing axes (n, 3), widths (n,) and quality (n,) of the best pairs, best first.

        The last of them, as many as the last number says, lie across a rim.
        """
        c = self.config
        rng = np.random.default_rng(c.seed)
        normals, smooth = object_cloud.normals_of(cloud)
        usable = np.flatnonzero(smooth)
        if len(usable) < 2:
            usable = np.arange(len(cloud))
        a, b = usable[rng.integers(0, len(usable), (2, c.pairs))]
        way = cloud[b] - cloud[a]
        width = np.linalg.norm(way, axis=1)
        fits = (width > 0.003) & (width < gripper.max_gap - 2.0 * c.room)
        a, b, way, width = a[fits], b[fits], way[fits] / width[fits, None], width[fits]
        cosine = np.abs([np.einsum("ij,ij->i", normals[k], way) for k in (a, b)]).min(axis=0)
        # A closing axis along the approach lets no hand come.
        sideways = np.abs(way @ gripper.approach) < math.sin(c.tilt)
        cone = math.cos(math.atan(c.friction))
        held = np.flatnonzero((cosine > cone) & sideways)
        middle = 0.5 * (cloud[a[held]] + cloud[b[held]])
        way, width = way[held], width[held]
        quality = (cosine[held] - cone) / (1.0 - cone) * 0.5 + 0.5
        outline = self._outline_pairs(cloud, gripper, cone)
        middle, way, width, quality = map(np.concatenate, zip((middle, way, width, quality), outline, strict=True))
        # Grasps near the middle of the object hold its weight best, and are seen on both sides.
        off = np.linalg.norm(middle - cloud.mean(axis=0), axis=1) / (float(np.linalg.norm(cloud.std(axis=0))) + 1e-6)
        order = np.argsort(-quality * np.exp(-(off**2)), kind="stable")
        # Half of them of the outline: of a bottle from above the cloud's own pairs lie on neck and shoulder.
        own, outer = order[order < len(held)], order[order >= len(held)]
        best = np.concatenate([own[: max(c.laid // 2, c.laid - len(outer))], outer])[: c.laid]
        rim = rim_pairs(cloud, gripper.approach)
        if (np.abs(rim[1] @ gripper.approach) > SLANTED).any():
            # Other pairs across a leaning wall are by its curve or by noise, and turn out of the hand.
            best = best[width[best] > THIN]
        drawn = (middle[best], way[best], width[best], quality[best])
        middle, way, width, quality = (np.concatenate(pair) for pair in zip(drawn, rim, strict=True))
        return middle, way, width, quality, len(rim[0])

    def _outline_pairs(self, cloud: Array, gripper: Gripper, cone: float) -> tuple[Array, Array, Array, Array]:
        """Return the same of the outline that `cloud` has along the approach, whose walls are taken to be along it.

        Seen across it is more likely round: there they are half of the width behind what is seen.
        """
        c, (u, v) = self.config, across(gripper.approach)
        spots, normals = outline(cloud @ np.column_stack([u, v]))
        if len(spots) < 4:
            return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0)
        a, b = np.random.default_rng(c.seed).integers(0, len(spots), (2, c.pairs // 4))
        way = spots[b] - spots[a]
        width = np.linalg.norm(way, axis=1)
        fits = (width > 0.003) & (width < gripper.max_gap - 2.0 * c.room)
        a, b, way, width = a[fits], b[fits], way[fits] / width[fits, None], width[fits]
        # Outward normals: a pair whose line leaves the outline on the wrong side holds it from within.
        cosine = np.minimum(-np.einsum("ij,ij->i", normals[a], way), np.einsum("ij,ij->i", normals[b], way))
        held = np.flatnonzero(cosine > cone)
        depth = float(np.quantile(cloud @ gripper.approach, 0.3))
        flat = 0.5 * (spots[a[held]] + spots[b[held]])
        behind = np.minimum(0.5 * width[held], ROUND) if gripper.approach[2] > -ACROSS else np.zeros(len(held))
        middle = flat[:, :1] * u + flat[:, 1:] * v + (depth + behind)[:, None] * gripper.approach
        axes = way[held, :1] * u + way[held, 1:] * v
        return middle, axes, width[held], (cosine[held] - cone) / (1.0 - cone) * 0.4 + 0.5

    def _hands(
        self, middles: Array, axes: Array, widths: Array, room: Array, gripper: Gripper, rims: int
    ) -> tuple[Array, Array, NDArray[np.intp], Array]:
        """Return poses (m, 4, 4), how far each leans (m,) [rad], its pair (m,), and what its depth is worth (m,).

        The fingertips go no further beyond a pair than there is `room` (n,) for before the palm [m].

        A hand on one of the last `rims` pairs leans with the pair and no further: the finger that leans over a bowl
        tips it. Nor does it go deepest: there is a bottom; and what is narrow stands on something wider, such as a
        bottle's neck.
        """
        c, approach = self.config, gripper.approach
        z = approach - (axes @ approach)[:, None] * axes
        z /= np.linalg.norm(z, axis=1, keepdims=True)
        x = np.cross(axes, z)
        rows, leans, pairs, worth = [], [], [], []
        # Where a wall leans, the bottom comes towards the hand.
        shallow = (np.arange(len(middles)) >= len(middles) - rims) & (np.abs(axes @ approach) > SLANTED)
        for (less, extra), turn in product(enumerate(DEPTHS), LEANS):
            z_turned = math.cos(turn) * z + math.sin(turn) * x
            lean = np.arccos(np.clip(z_turned @ approach, -1.0, 1.0))
            kept = np.flatnonzero(lean <= c.tilt + 1e-9)
            kept = kept[kept < len(middles) - rims] if turn or not less else kept
            kept = kept if less else kept[widths[kept] > NARROW]
            kept = kept[~shallow[kept]] if extra else kept
            # Where the palm lets them go no deeper than the next depth, that one is enough.
            kept = kept[room[kept] > c.depth + DEPTHS[less + 1]] if extra else kept
            T = np.tile(np.eye(4), (len(kept), 1, 1))
            T[:, :3, 1], T[:, :3, 2] = axes[kept], z_turned[kept]
            T[:, :3, 0] = np.cross(axes[kept], z_turned[kept])
            T[:, :3, 3] = middles[kept] + np.clip(room[kept], c.depth, c.depth + extra)[:, None] * z_turned[kept]
            rows.append(T)
            leans.append(lean[kept])
            pairs.append(kept)
            worth.append(np.full(len(kept), SHALLOW**less))
        hands = upright(np.concatenate(rows), gripper.yaw)
        return hands, np.concatenate(leans), np.concatenate(pairs), np.concatenate(worth)

    def _fit(self, T: Array, widths: Array, cloud: Array, rims: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
        """Return poses centred on what lies between their pads, the openings it takes, and how many points it is.

        A pad is 16 mm wide: one beside the middle of a round thing turns it out. So a thing that is no wider than a
        hand is held in its middle across the fingers, too; a rim, or a long bar, where the pair is.
        """
        local = in_hands(T, cloud)
        before = (local[..., 2] < 0.0) & (local[..., 2] > -0.08)
        reach = 0.5 * widths[:, None] + 0.02
        low, high = _extent(local[..., 0], before & (np.abs(local[..., 1]) < reach))
        off = np.where((high - low < COMPACT) & ~rims, 0.5 * (low + high), 0.0)
        between = before & (np.abs(local[..., 0] - off[:, None]) < 0.008) & (np.abs(local[..., 1]) < reach)
        held = between.sum(axis=1)
        low, high = _extent(local[..., 1], between)
        T = T.copy()
        T[:, :3, 3] += off[:, None] * T[:, :3, 0] + 0.5 * (low + high)[:, None] * T[:, :3, 1]
        return T, np.where(held > 0, high - low, widths) + 2.0 * self.config.room, held

    def _around(self, cloud: Array, scene: Array) -> Array:
        """Return the points (n, 3) that a hand at the object may touch: the object, and what is near it."""
        c = self.config
        low, high = cloud.min(axis=0) - 0.15, cloud.max(axis=0) + 0.15
        finite = scene[((scene > low) & (scene < high)).all(axis=1)] if len(scene) else scene
        return np.concatenate([spaced(cloud), spaced(thinned(finite, SCENE, c.seed))])

    def _distinct(self, T: Array, gaps: Array, order: NDArray[np.intp], around: Array) -> list[int]:
        """Return the first `most` of `order` that are free of `around` (n, 3) and no copies of a better one."""
        c = self.config
        kept: list[int] = []
        for first in range(0, len(order), c.most):
            some = order[first : first + c.most]
            # Most are copies, and to find that out costs less than whether they are free.
            some = some[~self._copies(T, some, kept).any(axis=1)]
            some = some[~collides(T[some], gaps[some], around)] if len(some) else some
            copies, taken = self._copies(T, some, some), list[int]()
            for row, k in enumerate(some.tolist()):
                if not copies[row, taken].any():
                    taken.append(row)
                    kept.append(k)
                if len(kept) == c.most:
                    return kept
        return kept

    def _copies(
        self, T: Array, some: Sequence[int] | NDArray[np.intp], others: Sequence[int] | NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """Return (n, m) whether each of `some` (n,) poses is much the same as each of `others` (m,)."""
        c, one, two = self.config, T[some], T[np.asarray(others, np.intp)]
        away = np.linalg.norm(one[:, None, :3, 3] - two[None, :, :3, 3], axis=2)
        turned = one[:, :3, 2] @ two[:, :3, 2].T
        rolled = np.abs(one[:, :3, 1] @ two[:, :3, 1].T)
        return (away < c.apart) & (np.minimum(turned, rolled) > math.cos(c.alike))


def _middle_height(cloud: Array, scene: Array, approach: Array) -> float:
    """Return the height of the middle of a thing [m]: a hand that comes from above sees no more than its top."""
    low, high = np.quantile(cloud[:, 2], (0.02, 0.98)).tolist()
    if approach[2] < -ACROSS:
        off = np.linalg.norm(scene[:, :2] - cloud[:, :2].mean(axis=0), axis=1)
        below = scene[(off < ABOUT) & (scene[:, 2] < high), 2]
        low = min(low, fullest(below, LAYER)) if len(below) >= MIN_POINTS else low
    return 0.5 * (low + high)


def _extent(values: Array, counted: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the least and the greatest (n,) of those `values` (n, m) that are `counted`; 0 where none is."""
    some = counted.any(axis=1)
    low = np.where(counted, values, np.inf).min(axis=1)
    return np.where(some, low, 0.0), np.where(some, np.where(counted, values, -np.inf).max(axis=1), 0.0)


def upright(T: Array, yaw: float) -> Array:
    """Return hands (n, 4, 4) turned by half a turn about their approach where that suits the arm; fingers are alike.

    A hand that looks across has its x axis down, one that looks down has it within a right angle of the heading `yaw`
    [rad]; see `grasp_pose`.
    """
    wanted = np.where(np.abs(T[:, 2, 2:3]) < ACROSS, -UP, np.array([math.cos(yaw), math.sin(yaw), 0.0]))
    T = T.copy()
    T[np.einsum("ni,ni->n", T[:, :3, 0], wanted) < 0.0, :3, :2] *= -1.0
    return T
