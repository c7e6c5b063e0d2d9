"""How well the robot really stands: CoM margin, lean, sway, steps and falls, read from the simulator's truth.

The CoM margin is the paper's measure (its section "Force-Adaptivity"): the signed horizontal distance from the
projected centre of mass to the edge of the support polygon, positive inside. The polygon is the convex hull of the
corners of every sole that touches something; during a step that is one foot, so that walking and recoveries which
succeed dip below zero: read the minimum together with the time below zero and the final value.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, fields
from itertools import islice
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from golem.kernels import njit
from golem.robots.mujoco.truth import TOUCH, Truth
from golem.true_runs import true_runs
from golem.types import Array

TRACE = "trace.npz"
"""Name of the file that holds a trial's trace among its artefacts."""
PERIOD = 0.01
"""Time between two samples [s]."""
SHORTEST_LIFT = 0.04
"""Time without contact that counts as a foot lifted [s]: less is a sole that chatters."""
QUIET_SPEED = 0.05
"""Horizontal speed of the base below which a robot with both feet down counts as standing quietly [m/s]."""
FINAL = 0.5
"""Length of the end of a trace over which its final margin is averaged [s]."""


@njit(cache=True, nogil=True)
def convex_hull(points: Array) -> Array:
    """Return the (m, 2) corners of the convex hull of `points` (n, 2), counter-clockwise (Andrew's monotone chain).

    Points that are alike count once; of fewer than three there is no hull, and they are returned in order.
    """
    ordered, n = np.empty((len(points), 2)), 0
    for i in range(len(points)):  # by x, then by y
        x, y = points[i, 0], points[i, 1]
        k = n
        while k > 0 and (ordered[k - 1, 0] > x or (ordered[k - 1, 0] == x and ordered[k - 1, 1] > y)):
            k -= 1
        if k > 0 and ordered[k - 1, 0] == x and ordered[k - 1, 1] == y:
            continue
        for j in range(n, k, -1):
            ordered[j, 0], ordered[j, 1] = ordered[j - 1, 0], ordered[j - 1, 1]
        ordered[k, 0], ordered[k, 1] = x, y
        n += 1
    if n < 3:
        return ordered[:n]
    hull, m = np.empty((2 * n, 2)), 0
    for way in range(2):
        first = m
        for step in range(n):
            i = step if way == 0 else n - 1 - step
            x, y = ordered[i, 0], ordered[i, 1]
            while m - first > 1:
                ax, ay, bx, by = hull[m - 2, 0], hull[m - 2, 1], hull[m - 1, 0], hull[m - 1, 1]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0:
                    break
                m -= 1
            hull[m, 0], hull[m, 1] = x, y
            m += 1
        m -= 1  # the last of one chain is the first of the other
    return hull[:m]


@njit(cache=True, nogil=True)
def signed_margin(point: Array, polygon: Array) -> float:
    """Return the distance of `point` (2,) to the edge of the convex `polygon` [m], positive inside.

    Args:
        point: the projected centre of mass.
        polygon: (m, 2) corners, counter-clockwise; fewer than three enclose nothing.
    """
    n = len(polygon)
    inside, nearest = n > 2, math.inf
    for i in range(n):
        j = (i + 1) % n
        ex, ey = polygon[j, 0] - polygon[i, 0], polygon[j, 1] - polygon[i, 1]
        px, py = point[0] - polygon[i, 0], point[1] - polygon[i, 1]
        inside = inside and ex * py - ey * px >= 0.0
        along = min(max((px * ex + py * ey) / max(ex * ex + ey * ey, 1e-18), 0.0), 1.0)
        nearest = min(nearest, math.hypot(px - along * ex, py - along * ey))
    return nearest if inside else -nearest


@dataclass(frozen=True, slots=True)
class BalanceTrace:
    """What the base did over one trial, sampled every `PERIOD`; row i is time `t[i]`.

    Attributes:
        t: (n,) time [s].
        margin: (n,) CoM margin [m].
        base: (n, 3) position of base_link in the world [m].
        rpy: (n, 3) roll, pitch and yaw of base_link [rad], yaw continuous.
        tilt: (n,) angle between base_link's and the world's up [rad].
        twist: (n, 3) forward, leftward [m/s] and yaw rate [rad/s] of base_link in its heading frame.
        contact: (n, 2) whether the left and the right foot touch something.
        force: (n, 3) force of the push in the world [N].
    """

    t: Array
    margin: Array
    base: Array
    rpy: Array
    tilt: Array
    twist: Array
    contact: NDArray[np.bool_]
    force: Array

    def window(self, start: float, end: float = math.inf) -> BalanceTrace:
        """Return the samples with `start` <= t < `end` [s]."""
        chosen = (self.t >= start - 1e-9) & (self.t < end - 1e-9)
        return BalanceTrace(*(getattr(self, f.name)[chosen] for f in fields(self)))

    @property
    def steps(self) -> int:
        """How often a foot was lifted, the feet counted together."""
        lifts = np.concatenate([true_runs(~self.contact[:, foot]) for foot in (0, 1)])
        return int((lifts[:, 1] - lifts[:, 0] >= round(SHORTEST_LIFT / PERIOD)).sum())

    @property
    def base_range(self) -> float:
        """Largest horizontal distance between two places of the base [m]."""
        corners = convex_hull(np.ascontiguousarray(self.base[:, :2]))
        return float(np.linalg.norm(corners[:, None] - corners, axis=2).max())

    @property
    def sway(self) -> float:
        """Radial RMS of the base about its mean position [m]."""
        return float(np.sqrt(self.base[:, :2].var(axis=0).sum()))

    @property
    def below_zero(self) -> float:
        """Time during which the margin was negative [s]."""
        return PERIOD * int((self.margin < 0.0).sum())

    @property
    def final_margin(self) -> float:
        """Mean margin over the last `FINAL` seconds [m]."""
        return float(self.margin[-round(FINAL / PERIOD) :].mean())

    def recovery_time(self, since: float) -> float:
        """Return the time [s] from the first to the last negative margin after `since` [s]; 0 where there is none."""
        late = self.t[(self.margin < 0.0) & (self.t >= since)]
        return float(late[-1] - late[0]) + PERIOD if len(late) else 0.0

    def save(self, path: Path) -> None:
        """Write the trace as a compressed npz with one float32 array per attribute; the folder is made."""
        path.parent.mkdir(parents=True, exist_ok=True)
        arrays = {f.name: a if (a := getattr(self, f.name)).dtype == bool else a.astype("f4") for f in fields(self)}
        part = path.with_suffix(".part")
        with part.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)
        part.replace(path)

    @classmethod
    def load(cls, path: Path) -> BalanceTrace:
        """Return the trace that `save` wrote."""
        with np.load(path) as stored:
            return cls(*(stored[f.name] if f.name == "contact" else stored[f.name].astype(float) for f in fields(cls)))


class HasTruth(Protocol):
    """A simulated robot whose truth can be read."""

    truth: Truth


class BalanceRecorder:
    """Samples one twin; call it after every tick.

    Attributes:
        due: when the next sample is due [s].
        fallen: whether the robot has fallen.
        margin, yaw: newest CoM margin [m] and heading [rad].
        contact: (2,) whether the feet touched something at the newest sample.
        quiet: for how long the robot has been standing still, both feet down, margin positive [s].
    """

    def __init__(self, robot: HasTruth, memory: float = math.inf) -> None:
        """Look at `robot`, and keep the samples of the last `memory` [s]."""
        self._truth = robot.truth
        maximum = None if math.isinf(memory) else round(memory / PERIOD)
        self._rows: deque[tuple[float, ...]] = deque(maxlen=maximum)
        self._polygon: Array = _support(self._truth.soles())
        self.due = 0.0
        self.fallen = False
        self.margin = self.yaw = 0.0
        self.quiet = 0.0
        self.contact: NDArray[np.bool_] = np.zeros(2, dtype=bool)

    def __call__(self, t: float, force: Array | None = None) -> None:
        """Sample at time `t` [s], if a sample is due, with the (3,) `force` of the push [N]."""
        if t < self.due - 1e-9:
            return
        self.due = t + PERIOD
        base = self._truth.base()
        R, position = base.T_world_base[:3, :3], base.T_world_base[:3, 3]
        forces = self._truth.foot_forces()
        self.contact = (forces * forces).sum(axis=1) > TOUCH**2
        if self.contact.any():  # in flight the last polygon counts
            self._polygon = _support(self._truth.soles()[self.contact])
        self.margin = signed_margin(self._truth.com_position, self._polygon)
        self.fallen |= self._truth.fallen(base=base)
        roll, pitch = math.atan2(R[2, 1], R[2, 2]), -math.asin(min(max(R[2, 0], -1.0), 1.0))
        yaw = self.yaw = math.atan2(R[1, 0], R[0, 0])
        c, s = math.cos(yaw), math.sin(yaw)
        vx, vy, _ = base.velocity
        forward, left = c * vx + s * vy, c * vy - s * vx
        still = math.hypot(forward, left) < QUIET_SPEED and self.margin > 0.0 and bool(self.contact.all())
        self.quiet = self.quiet + PERIOD if still else 0.0
        self._rows.append(
            (t, self.margin, *position, roll, pitch, yaw, base.tilt, forward, left, float(R[2] @ base.rate))
            + (*self.contact, *(np.zeros(3) if force is None else force))
        )

    def trace(self, last: float = math.inf) -> BalanceTrace:
        """Return the samples of the `last` seconds that are kept."""
        skipped = 0 if math.isinf(last) else max(0, len(self._rows) - round(last / PERIOD))
        rows = np.array(list(islice(self._rows, skipped, None)), dtype=np.float64).reshape(-1, 17)
        rows[:, 7] = np.unwrap(rows[:, 7])
        return BalanceTrace(
            t=rows[:, 0],
            margin=rows[:, 1],
            base=rows[:, 2:5],
            rpy=rows[:, 5:8],
            tilt=rows[:, 8],
            twist=rows[:, 9:12],
            contact=rows[:, 12:14].astype(bool),
            force=rows[:, 14:17],
        )


def _support(soles: Array) -> Array:
    """Return the polygon that `soles` (n, 4, 3) span."""
    return convex_hull(np.ascontiguousarray(soles.reshape(-1, 3)[:, :2]))
