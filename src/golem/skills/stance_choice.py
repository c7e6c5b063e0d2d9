"""Where to stand before a pack, so that a hand gets to the fasteners that are wanted and to the container."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, map_coordinates

from golem.capabilities.arms.reach_map import ReachMap, load_map
from golem.robots.model.table import FRAMES
from golem.robots.sensors.cameras import HEAD, project
from golem.types import SIDES, Array, PlanarPose, Side

ABOVE = 0.15
"""Height above an object to which a hand has to come as well, with it or before [m]: the clearance of `pick`."""
OVER_TRAY = 0.12
"""Height above the container's middle at which a hand lets go [m]."""
ROOM = 0.10
"""Distance from the end of the reach beyond which more is of no use [m]."""
LOOK_TURN = 0.35
"""How far the torso turns to look for the container [rad]; that of `pick`."""
VIEWS = (1.0, 0.8, 0.2)
"""Share of the quality: container in view, in view of a turned torso, and in neither [own]."""
BORDER = 30.0
"""Distance from the border of the image within which something may not be seen whole [px]."""
COUNT = 3
"""Fasteners that a stance is judged by, the best ones: a pick tries as many."""
STANDOFF = (0.35, 0.52)
"""Distances of base_link from the edge that the legs and the belly leave [m]."""
TURNS = (-0.2, -0.1, 0.0, 0.1, 0.2)
"""Headings that are tried, from straight across the edge [rad]."""
ASIDE = 0.5
"""How far along the edge stances are tried, to both sides [m]."""
GRID = 0.04
"""Distance between two stances that are tried [m]."""
GOOD = 0.8
"""Share of the best quality with which the robot stays where it is, or at its own height."""
PER_METRE, PER_RADIAN = 0.2, 0.2
"""What a metre of way and a radian of turning cost, of a quality from 0 to 1 [own]."""


@dataclass(frozen=True, slots=True)
class PackStance:
    """A place to stand.

    Attributes:
        pose: of base_link, as seen from where the robot stands now.
        quality: 0 to 1: how far within reach the best fasteners and the container are.
        served: fasteners within reach.
        drop: how much lower than now the robot stands there [m].
    """

    pose: PlanarPose
    quality: float
    served: int
    drop: float = 0.0


def stance_here(
    screws: Array, weights: Array, tray: Array | None, drops: Sequence[float] = (0.0,), sides: Sequence[Side] = SIDES
) -> PackStance:
    """Return how well the robot stands where it is, for one of the hands `sides`; see `best_stance`.

    The height of now is kept where another wins little: each change takes 2 to 3 s.
    """
    here, now = [PlanarPose(0.0, 0.0, 0.0)], min(drops, key=abs)
    return _best(here, screws, weights, tray, sorted(drops, key=lambda drop: drop != now), sides)


def best_stance(
    edge: PlanarPose, screws: Array, weights: Array, tray: Array | None, drops: Sequence[float] = (0.0,)
) -> PackStance:
    """Return the best stance before an edge, the nearer of two that are equally good.

    A fastener that the head camera sees counts by how far within reach it and the place above it are, for the hand that
    gets to the container as well; the product of both, of the best fasteners, is the quality. It is less where the
    torso has to turn for the camera to see the container, and little where even that does not help.

    Args:
        edge: a point of the near edge, heading across it away from the robot, in base_link.
        screws: (n, 3) the fasteners in base_link [m].
        weights: (n,) how much each is wanted, 0 to 1.
        tray: (3,) middle of the container in base_link [m]; None where it is not known.
        drops: how much lower than now the robot may stand [m]; the first is kept where another wins little.
    """
    offs = np.arange(-ASIDE, ASIDE + 1e-9, GRID) + edge.to(PlanarPose(0.0, 0.0, 0.0)).y
    standoffs = np.arange(STANDOFF[0], STANDOFF[1] + 1e-9, 0.5 * GRID)
    tried = [edge @ PlanarPose(-d, y, turn) for d, y, turn in itertools.product(standoffs, offs, TURNS)]
    return _best(tried, screws, weights, tray, drops)


def _best(
    tried: Sequence[PlanarPose],
    screws: Array,
    weights: Array,
    tray: Array | None,
    drops: Sequence[float],
    sides: Sequence[Side] = SIDES,
) -> PackStance:
    """Return the best of the poses `tried`, at the best height."""
    stances = np.array([(p.x, p.y, p.yaw) for p in tried])
    cost = PER_METRE * np.hypot(stances[:, 0], stances[:, 1]) + PER_RADIAN * np.abs(stances[:, 2])
    found: list[tuple[float, PackStance]] = []
    for drop in drops:
        up = np.array([0.0, 0.0, drop])
        quality, served = _judged(stances, screws + up, weights, None if tray is None else tray + up, sides)
        best = int(np.argmax(quality - cost))
        stance = PackStance(tried[best], float(quality[best]), int(served[best]), drop)
        found.append((float(quality[best] - cost[best] - PER_METRE * abs(drop - drops[0])), stance))
    most = max(found, key=lambda one: one[0])
    return (found[0] if found[0][0] >= GOOD * most[0] else most)[1]


def _judged(
    stances: Array, screws: Array, weights: Array, tray: Array | None, sides: Sequence[Side]
) -> tuple[Array, Array]:
    """Return the (s,) quality of stances (s, 3), and how many fasteners each serves."""
    best = np.zeros((len(stances), len(screws)))
    seen = seen_from(stances, screws, 0.0)
    for side in sides:
        room = takes(stances, screws, side)
        if tray is not None:
            room = room * within_reach(stances, (tray + (0.0, 0.0, OVER_TRAY))[None], side)
        best = np.maximum(best, room)
    best = best * seen
    quality = np.sort(best * weights, axis=1)[:, ::-1][:, :COUNT].sum(axis=1) / COUNT
    if tray is not None:
        turned = [seen_from(stances, tray[None], turn)[:, 0] for turn in (LOOK_TURN, -LOOK_TURN)]
        view = np.where(turned[0] | turned[1], VIEWS[1], VIEWS[2])
        quality *= np.where(seen_from(stances, tray[None], 0.0)[:, 0], VIEWS[0], view)
    return quality, (best > 0.0).sum(axis=1)


def seen_from(stances: Array, points: Array, turn: float) -> NDArray[np.bool_]:
    """Return (s, n) whether the head camera sees points (n, 3) from stances (s, 3) with the torso at `turn` [rad]."""
    yaw = stances[:, 2:] + turn
    x, y = points[:, 0] - stances[:, :1], points[:, 1] - stances[:, 1:2]
    c, s = np.cos(yaw), np.sin(yaw)
    local = np.stack([c * x + s * y, c * y - s * x, np.broadcast_to(points[:, 2], x.shape)], axis=-1)
    T = FRAMES["camera_link"].T_parent_frame
    link = (local - T[:3, 3]) @ T[:3, :3]
    optical = np.stack([-link[..., 1], -link[..., 2], np.maximum(link[..., 0], 1e-3)], axis=-1)
    pixel = project(HEAD, optical)
    low, high = np.full(2, BORDER), np.array([HEAD.width, HEAD.height]) - BORDER
    return ((pixel > low) & (pixel < high)).all(axis=-1) & (link[..., 0] > HEAD.near)


def takes(stances: Array, fasteners: Array, side: Side) -> Array:
    """Return (s, n) how far within reach of a hand fasteners (n, 3), and the places above them, are; 0 to 1."""
    above = fasteners + (0.0, 0.0, ABOVE)
    return np.minimum(within_reach(stances, fasteners, side), within_reach(stances, above, side))


def within_reach(stances: Array, points: Array, side: Side) -> Array:
    """Return (s, n) how far within reach points (n, 3) are from stances (s, 3): 0 out of reach, 1 from `ROOM` on."""
    c, s = np.cos(stances[:, 2:]), np.sin(stances[:, 2:])
    x, y = points[:, 0] - stances[:, :1], points[:, 1] - stances[:, 1:2]
    local = np.stack([c * x + s * y, c * y - s * x, np.broadcast_to(points[:, 2], x.shape)])
    local[1] *= 1.0 if side == "right" else -1.0
    reach = load_map()
    index = (local - reach.origin[:, None, None]) / reach.spacing + 1.0
    room: Array = map_coordinates(_rooms(), index, order=1, mode="constant", cval=0.0)
    return np.clip(room / ROOM, 0.0, 1.0)


@functools.cache
def _rooms() -> Array:
    """Return the distance of each point of the map of reach from the nearest out of reach [m], one more all around."""
    reach: ReachMap = load_map()
    inside = distance_transform_edt(np.pad(reach.served(), 1))
    assert isinstance(inside, np.ndarray)
    return np.maximum(inside - 0.5, 0.0) * reach.spacing
