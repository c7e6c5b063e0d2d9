"""What the palm camera shows below the fingertips: how far they can go down before they stand on something.

Palm camera and fingers sit on one hand. What the head camera and the encoders are off by drops out, as for the servo.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.grasping.hand_view import FINGER
from golem.interfaces import topics
from golem.robots.model.magpie_model import T_HAND_CAMERA, T_HAND_GRIPPER
from golem.robots.sensors.cameras import rays
from golem.skills.context import Context
from golem.skills.poses import at_height, lifted, moved, turned
from golem.types import Array, RgbdImage, Side

CELL = 0.004
"""Side of a cell of the height map [m]."""
HALF = 75
"""Cells from the middle of the map to its edge."""
STRIDE = 3
"""Every so manieth row and column of the image is read."""
TIPS: float = float(T_HAND_GRIPPER[2, 3] - T_HAND_CAMERA[2, 3]) + 0.004
"""Depth up to which the image may show the fingers themselves [m]."""
MARGIN = 0.003
"""What is this near to a finger is in its way [m]: base and encoders move by that much on the way down."""
CLOSE = 0.008
"""What is this near to a finger it may meet: there the hand is slow [m]."""
STRAYS = 3
"""So many cells may stand higher than what counts: noise of the depth comes alone."""
ROUGH = 0.006
"""How far the tips may seem to be within the ground at their goal [m]: tilt of hand and ground, noise of the depth."""
PRESSED = (0.008, 0.003, 1)
"""`MARGIN`, outside, `ROUGH` and `STRAYS` after they have pressed on something: a finger squeezed itself beside a head,
or stood on a stud, which fills two cells."""
KEPT, RAISED = 0.001, 0.002
"""Room that the tips keep to the ground at their goal, and how far they are raised for that at most [m]."""
ABOVE = 0.015
"""How far the tips stay above what is in their way [m]."""
TURNS = (0.2, -0.2, 0.4, -0.4, 0.6, -0.6)
"""Turns about the vertical that are tried, in order, where the fingers have no room [rad]."""
ASIDE, FAR_ASIDE = (0.004, -0.004), (0.007, -0.007)
"""How far the hand keeps aside along the width of its fingers [m], tried first, and where no turn gives room: pads of
24 mm held one of three screws that they were 8 to 9 mm off [own]."""
ACROSS = tuple(sign * float(turn) for turn in np.arange(0.7, 1.6, 0.1) for sign in (1.0, -1.0))
"""Turns of a hand that comes anew, for which a servo is too near [rad]: beside a wall the fingers fit along it."""
WAYS = (
    *((0.0, aside) for aside in (0.0, *ASIDE)), *((turn, 0.0) for turn in TURNS), *((0.0, far) for far in FAR_ASIDE)
)  # fmt: skip
"""Turn [rad] and way aside [m] of the hand where its fingers have no room, in order."""
AGO = 3.0
"""Time that a servo takes to look again from above before it says that it gave up [s]."""
PATIENCE = 0.5
"""Time for which something is in the way before the hand comes anew [s]."""
TURN_RATE = 0.6
"""How fast the hand turns [rad/s]."""
SLOW, GAIN = 0.03, 3.0
"""Speed that an impact may have [m/s], and speed per metre of room down to it [1/s]."""


class FingerRoom:
    """A map of heights around where the hand began, filled by the palm camera from above, kept while it comes down.

    The fingers hide what is straight below their tips from nearby; from further above it was seen.

    Attributes:
        blocked: whether something is in the way of the fingers at the last goal that was asked about, however the hand
            turns.
        across: heading with which the fingers would have room, where that has been so for a while [rad].
        shift: (3,) by how much the hand keeps aside of its goal, in odom [m].
    """

    def __init__(self, context: Context, side: Side, gap: float, pressed: bool = False) -> None:
        """Begin where the hand is now, with its fingers open by `gap` [m]; `pressed`: they pressed on something."""
        margin, self._rough, self._strays = PRESSED if pressed else (MARGIN, ROUGH, STRAYS)
        self._context, self._camera = context, f"{side}_hand"
        self._middle = context.arms[side].commanded[:2, 3].copy()
        self._heights = np.full((2 * HALF, 2 * HALF), np.nan)
        self._tips, self._around = _fingertips(gap, MARGIN, margin), _fingertips(gap, CLOSE, CLOSE)
        self._turn = self._blocked_for = 0.0
        self._blocked_at = -np.inf
        self._wanted = WAYS[0]
        self.blocked = False
        self.across: float | None = None
        self.shift: Array = np.zeros(3)

    @property
    def kept_off(self) -> bool:
        """Whether something was in the way of the fingers before the servo went up to look again."""
        return self._context.t - self._blocked_at < AGO

    def look(self) -> None:
        """Take over what the newest image of the palm camera shows; newer is nearer, and replaces what was there."""
        frame = self._context.bus.latest(topics.rgbd_images(self._camera))
        if frame is None:
            return
        points = _ground(frame)
        cells = self._cells(points)
        kept = ((cells >= 0) & (cells < 2 * HALF)).all(axis=1)
        flat = cells[kept] @ (2 * HALF, 1)
        counts = np.bincount(flat, minlength=self._heights.size)
        sums = np.bincount(flat, points[kept, 2], minlength=self._heights.size)
        seen = counts > 0
        self._heights.ravel()[seen] = sums[seen] / counts[seen]

    def way(self, T_goal: Array, T_now: Array, speed: float) -> tuple[Array, float]:
        """Return where a hand that is to go to `T_goal` shall go, and how fast it may [m/s].

        Where something is in the way of the fingers at the goal, the hand keeps aside or turns until they have room,
        and stays above until then; where none of `WAYS` gives room, `blocked` is set.

        Args:
            T_goal: (4, 4) where the servo wants the hand, in odom.
            T_now: (4, 4) where it is.
            speed: limit of its speed [m/s].
        """
        fits = self._misses(T_goal, self._wanted) <= self._rough
        better = WAYS[: WAYS.index(self._wanted)] if fits else WAYS  # from nearer the camera sees more
        wanted = next((way for way in better if self._misses(T_goal, way) < 0.5 * self._rough), None)
        self.blocked = wanted is None and not fits
        self._blocked_at = self._context.t if self.blocked else self._blocked_at
        self._wanted = wanted or self._wanted
        self._blocked_for = self._blocked_for + self._context.period if self.blocked else 0.0
        if self._blocked_for > PATIENCE:
            self._blocked_for = 0.0
            ways = ((turn, aside) for some in ((0.0, *ASIDE), FAR_ASIDE) for turn in ACROSS for aside in some)
            free = next((way for way in ways if self._misses(T_goal, way) < 0.5 * self._rough), None)
            self.across = None if free is None else math.atan2(T_goal[1, 0], T_goal[0, 0]) + free[0]
        step = TURN_RATE * self._context.period
        turn, aside = self._wanted
        self._turn += min(max(turn - self._turn, -step), step)
        T = _varied(T_goal, (self._turn, aside))
        self.shift = T[:3, 3] - T_goal[:3, 3]
        missing = -self.below(T)
        up = ABOVE + missing if missing > self._rough else min(max(KEPT + missing, 0.0), RAISED)
        T = lifted(T, up)
        room = min(self._room(self._around, T_now), self._room(self._around, at_height(T, T_now[2, 3])))
        return T, min(max(GAIN * room, SLOW), speed)

    def _misses(self, T_goal: Array, way: tuple[float, float]) -> float:
        """Return by how much fingers miss the room they need at a goal (4, 4), turned and aside as in `WAYS` [m]."""
        return -self.below(_varied(T_goal, way))

    def below(self, T: Array) -> float:
        """Return how far the fingertips of a hand at `T` (4, 4) in odom are above what is below them [m].

        Negative: they would be within it. inf: nothing was seen there.
        """
        return self._room(self._tips, T)

    def _room(self, tips: Array, T: Array) -> float:
        tips = tips @ T[:3, :3].T + T[:3, 3]
        cells = self._cells(tips).clip(0, 2 * HALF - 1)
        room = tips[:, 2] - self._heights[cells[:, 0], cells[:, 1]]
        room = np.sort(room[np.isfinite(room)])
        return float(room[self._strays]) if len(room) > self._strays else np.inf

    def _cells(self, points: Array) -> NDArray[np.int64]:
        """Return the (n, 2) cells of points (n, 3) in odom."""
        return np.floor((points[:, :2] - self._middle) / CELL).astype(np.int64) + HALF


def _varied(T_goal: Array, way: tuple[float, float]) -> Array:
    """Return a goal (4, 4) turned and aside by a `way`, as in `WAYS`."""
    T = turned(T_goal, way[0])
    return moved(T, way[1] * T[:3, 0])


def _fingertips(gap: float, inside: float, outside: float) -> Array:
    """Return (n, 3) points that cover the ends of both open fingers and margins around, in the grasp frame [m]."""
    x = np.arange(-FINGER[0] - outside, FINGER[0] + outside + 1e-9, CELL)
    y = np.arange(0.5 * gap - inside, 0.5 * gap + FINGER[1] + outside + 1e-9, CELL)
    xy = np.stack(np.meshgrid(x, np.concatenate((-y, y))), axis=-1).reshape(-1, 2)
    return np.column_stack((xy, np.zeros(len(xy))))


def _ground(frame: RgbdImage) -> Array:
    """Return the (n, 3) points in odom beyond the fingertips, without those at the fingers' edges."""
    depth = frame.depth[::STRIDE, ::STRIDE]
    clear, fingers = depth > TIPS, (depth > 0.0) & (depth <= TIPS)
    # At the edge of a finger a depth camera mixes finger and ground.
    clear[1:] &= ~fingers[:-1]
    clear[:-1] &= ~fingers[1:]
    clear[:, 1:] &= ~fingers[:, :-1]
    clear[:, :-1] &= ~fingers[:, 1:]
    optical = rays(frame.info)[::STRIDE, ::STRIDE][clear] * depth[clear][:, None]
    T = frame.T_odom_optical
    return optical.astype(float) @ T[:3, :3].T + T[:3, 3]
