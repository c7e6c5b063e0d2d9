"""The navigator `costmap_astar`: a way by A* over the costmap, twists along it, and what to do when it is blocked.

Close to the goal `goto` takes over, which measures every stop and corrects what is left with small steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.navigation.astar import Cell, Way, astar
from golem.capabilities.navigation.base import NavInputs
from golem.capabilities.navigation.behaviour import Action, BehaviourStatus, Fallback, InSequence
from golem.capabilities.navigation.costmap import INSCRIBED, LETHAL, STEEPEST, Costmap, CostmapConfig
from golem.capabilities.navigation.footprint import HOME, Footprint
from golem.capabilities.navigation.goto import GoTo, GoToConfig
from golem.capabilities.navigation.local_controller import Around, LocalController, LocalControllerConfig
from golem.capabilities.navigation.surroundings import Surroundings
from golem.finite import check_finite
from golem.interfaces.nav_payloads import NavStep, Scan
from golem.options import require
from golem.types import Array, PlanarPose, Twist


@dataclass(frozen=True, slots=True)
class NoWay:
    """That there is no way; `final` where neither time nor a place that the robot backs up to changes that."""

    why: str
    final: bool = False


def find_way(costmap: Costmap, start: PlanarPose, goal: PlanarPose, footprint: Footprint, beta: float) -> Way | NoWay:
    """Return the cheapest way, or why there is none.

    Near the start and the goal the footprint decides, not the distance at which ways keep from obstacles: the robot
    stands there as it does, and may stand close to something beside or behind it.
    """
    places = np.array([[start.x, start.y], [goal.x, goal.y]])
    row, column, inside = costmap.cells(places)
    if not inside[1]:
        return NoWay(f"The goal ({goal.x:.2f}, {goal.y:.2f}) is outside the map.", final=True)
    if not inside[0]:
        return NoWay(f"The robot, at ({start.x:.2f}, {start.y:.2f}), is outside the map.", final=True)
    hit = costmap.free_at(footprint.at(goal)) <= 0.5 * costmap.resolution
    if hit.any():
        at = footprint.at(goal)[int(hit.argmax())]
        return NoWay(
            f"The goal ({goal.x:.2f}, {goal.y:.2f}) is inside an obstacle: there the robot would touch something at "
            f"({at[0]:.2f}, {at[1]:.2f})."
        )
    cost = costmap.cost.copy()
    cells: list[Cell] = [(int(row[i]), int(column[i])) for i in range(2)]
    for cell in cells:
        _open(cost, cell, footprint.reach / costmap.resolution)
    found = astar(cost, cells[0], cells[1], beta, INSCRIBED)
    if found is None:
        return NoWay(
            f"There is no way to ({goal.x:.2f}, {goal.y:.2f}) on the map: it is walled in, or the gaps are narrow."
        )
    points = costmap.places(found[0])
    points[0], points[-1] = places
    return Way(points)


def way_cost(costmap: Costmap, points: Array, beta: float) -> float:
    """Return what places (n, 2) in their order cost by the paper's equation, in cells; infinite where one is closed."""
    cost = costmap.at(points[1:])
    if len(points) < 2 or (cost >= LETHAL).any():
        return float("inf")
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1) / costmap.resolution
    return float((steps * (1.0 + beta * cost)).sum())


def _open(cost: Array, cell: Cell, radius: float) -> None:
    """Let ways lead through what is no obstacle itself within `radius` [cells] of a cell, at the highest cost."""
    n = int(radius) + 1
    r0, r1 = max(0, cell[0] - n), min(cost.shape[0], cell[0] + n + 1)
    c0, c1 = max(0, cell[1] - n), min(cost.shape[1], cell[1] + n + 1)
    part = cost[r0:r1, c0:c1]
    rows: NDArray[np.int64]
    rows, columns = np.ogrid[r0:r1, c0:c1]
    near = (rows - cell[0]) ** 2 + (columns - cell[1]) ** 2 <= radius**2
    part[near & (part >= INSCRIBED) & (part < LETHAL)] = STEEPEST


ZERO = Twist()
KEEP = 0.85
"""Share of the present way's cost below which another one is taken."""
ASIDE = 0.5
"""Distance from the present way from which on another one is taken [m]."""
PROGRESS = 0.2
"""Way within `CostmapAstarConfig.stuck` that counts as progress [m]."""


@dataclass(frozen=True, slots=True)
class CostmapAstarConfig:
    """Options of `CostmapAstar`.

    Attributes:
        beta: weight of the cost of a cell against the length of the way, in the paper's equation.
        near: distance from the goal within which it is approached in a straight line [m].
        replan: time between two searches for a way [s].
        shy: by how much more it keeps from what is not in the map: that may move [m].
        ahead: time for which the way of those who walk is kept free [s]; 0 takes everything for standing.
        stale: age of the newest scan or map from which on the robot stands [s].
        lost: time it waits for scan or map, or for a place in the costmap, before it gives up [s].
        patience: time without a way on before it recovers [s].
        stuck: time without progress after which it recovers [s].
        wait: time that it waits for the way to become free [s].
        back: how far it backs up [m].
        rounds: recoveries before it gives up.
        costmap, local, stop: options of costmap, local controller and approach.
    """

    beta: float = 0.02
    near: float = 0.8
    replan: float = 1.0
    shy: float = 0.25
    ahead: float = 1.4
    stale: float = 0.6
    lost: float = 5.0
    patience: float = 2.0
    stuck: float = 10.0
    wait: float = 4.0
    back: float = 0.3
    rounds: int = 3
    costmap: CostmapConfig = field(default_factory=CostmapConfig)
    local: LocalControllerConfig = field(default_factory=LocalControllerConfig)
    stop: GoToConfig = field(default_factory=lambda: GoToConfig(speed=(0.3, 0.2, 0.4)))

    def __post_init__(self) -> None:
        times = ("replan", "stale", "lost", "patience", "stuck", "wait", "near", "back")
        rows = ((name, getattr(self, name)) for name in times)
        require(
            "costmap_astar option ",
            *((n, v, 0.0 < v < math.inf, "a positive number") for n, v in rows),
            ("beta", self.beta, 0.0 <= self.beta < math.inf, "not negative"),
            ("shy", self.shy, 0.0 <= self.shy < math.inf, "a distance, not negative"),
            ("ahead", self.ahead, 0.0 <= self.ahead <= 10.0, "a time of at most 10 s"),
            ("rounds", self.rounds, self.rounds >= 0, "not negative"),
        )


class CostmapAstar:
    """Finds a way around what is on the map, in `latency` [s], and follows it; see `Navigator`."""

    requires = ("scan",)
    rate = 20.0
    latency = 0.02

    def __init__(self, config: CostmapAstarConfig | None = None) -> None:
        self.config = c = config or CostmapAstarConfig()
        self._local = LocalController(c.local)
        self._approach = GoTo(c.stop)
        self._surroundings = Surroundings(c.costmap, c.shy, c.ahead)
        self._recovery = Fallback(
            InSequence(Action(self._wait), Action(self._replanned)),
            InSequence(Action(self._clear), Action(self._replanned)),
            InSequence(Action(self._back_up), Action(self._replanned)),
        )
        self.start(PlanarPose(0.0, 0.0, 0.0))

    def start(self, goal: PlanarPose) -> None:
        self._goal = goal
        self._way: Way | None = None
        self._why, self._final = "", False
        self._twist = ZERO
        self._near = False
        self._recovering = False
        self._rounds = 0
        self._blocked = self._unseen = self._planned = 0.0
        self._scan: Scan | None = None
        self._scan_age = 0.0
        self._surroundings.forget()
        self._approach.start(goal)
        self._recovery.reset()
        self._pose = PlanarPose(0.0, 0.0, 0.0)
        self._backed: PlanarPose | None = None
        self._mark, self._marked = PlanarPose(math.inf, 0.0, 0.0), 0.0

    def step(self, inputs: NavInputs, dt: float) -> NavStep:
        return replace(self._step(inputs, dt), people=self._around.people)

    def _step(self, inputs: NavInputs, dt: float) -> NavStep:
        pose = self._pose = inputs.pose
        check_finite("the pose", np.array([pose.x, pose.y, pose.yaw]))
        left = pose.to(self._goal)
        self._footprint = inputs.footprint or HOME
        missing = self._look(inputs, dt)
        if missing:
            self._unseen += dt
            if self._unseen > self.config.lost:
                return NavStep.failed(missing, left)
            return NavStep(ZERO, False, left, None, self._path, "wait for scans")
        self._unseen = 0.0
        if self._near:
            return self._finish(inputs, dt)
        if self._recovering:
            self._twist = ZERO
            if self._recovery.tick(dt) is not BehaviourStatus.RUNNING:
                self._recovering, self._marked = False, 0.0
            return NavStep(self._twist, False, left, None, self._path, "recover")
        self._planned += dt
        if self._way is None or self._planned >= self.config.replan:
            self._plan()
        if self._way is None:
            return self._stand(left, dt, self._why)
        if self._may_approach(left):
            self._near = True
            self._approach.start(self._goal)
            return self._finish(inputs, dt)
        twist = self._local.follow(pose, self._way, self._goal, self._footprint, self._around)
        if twist is None:
            return self._stand(left, dt, "The way is blocked.")
        if self._is_stuck(dt):
            self._blocked = math.inf
            return self._stand(left, dt, "It makes no progress.")
        self._blocked = max(0.0, self._blocked - dt)
        return NavStep(twist, False, left, None, self._path, "follow")

    def _is_stuck(self, dt: float) -> bool:
        gone = self._mark.to(self._pose)
        if math.hypot(gone.x, gone.y) > PROGRESS:
            self._mark, self._marked = self._pose, 0.0
        self._marked += dt
        return self._marked > self.config.stuck

    @property
    def _path(self) -> Array | None:
        return None if self._way is None else self._way.points

    def _look(self, inputs: NavInputs, dt: float) -> str:
        """Take map and scan; return what is missing, as one sentence, empty if nothing is."""
        grid, scan = inputs.grid, inputs.scan
        fresh = scan is not None and (self._scan is None or scan.t != self._scan.t)
        self._scan_age = 0.0 if fresh else self._scan_age + dt
        self._scan = scan
        if scan is None:
            return "No scan comes: the stack needs a LiDAR, and an odometry that goes by it, such as lio."
        if self._scan_age > self.config.stale:
            return f"No new scan has come for {self._scan_age:.1f} s."
        if grid is None:
            return "There is no map: the stack needs a mapper, and an odometry that goes by the LiDAR."
        self._surroundings.update(grid, scan if fresh else None, self._pose, self._half_width)
        return ""

    @property
    def _around(self) -> Around:
        s = self._surroundings
        return Around(s.clearance, s.frame, s.people(self._scan_age))

    @property
    def _half_width(self) -> float:
        """Distance that a way keeps from obstacles: the robot walks it facing ahead [m]."""
        return float(abs(self._footprint.corners[:, 1]).max()) + self.config.local.margin

    def _plan(self) -> None:
        self._planned = 0.0
        costmap = self._surroundings.with_new(self._half_width)
        if costmap is None:
            return
        found = find_way(costmap, self._pose, self._goal, self._footprint, self.config.beta)
        if isinstance(found, NoWay):
            self._way, self._why, self._final = None, found.why, found.final
        elif self._way is None or self._better(costmap, found, self._way):
            self._way, self._why, self._final = found, "", False

    def _better(self, costmap: Costmap, new: Way, old: Way) -> bool:
        """Return whether a new way is worth leaving the old one: of two that cost the same one is gone to its end."""
        i, aside = old.nearest(self._pose)
        if aside > ASIDE:
            return True
        beta = self.config.beta
        return way_cost(costmap, new.points, beta) < KEEP * way_cost(costmap, old.points[i:], beta)

    def _may_approach(self, left: PlanarPose) -> bool:
        """Return whether the goal is near, and nothing stands between."""
        distance = math.hypot(left.x, left.y)
        if distance > self.config.near:
            return False
        around = self._around
        steps = max(1, math.ceil(distance / 0.1))
        between = (self._pose.toward(self._goal, i / steps) for i in range(1, steps + 1))
        return min(self._local.room(p, self._footprint, around) for p in between) > 0.5 * self.config.local.margin

    def _finish(self, inputs: NavInputs, dt: float) -> NavStep:
        step = self._approach.step(inputs, dt)
        if step.twist != ZERO and not self._local.clear(step.twist, self._pose, self._footprint, self._around):
            self._blocked += dt
            if self._blocked > self.config.patience:
                self._near, self._way = False, None
            return NavStep(ZERO, False, step.left, None, self._path, "wait")
        self._blocked = 0.0
        return NavStep(step.twist, step.arrived, step.left, step.failure, self._path, "approach")

    def _stand(self, left: PlanarPose, dt: float, why: str) -> NavStep:
        """Stand before what is in the way; after a while begin to recover."""
        self._why = why
        self._blocked += dt
        if self._blocked > self.config.patience:
            if self._final:
                return NavStep.failed(why, left)
            if self._rounds >= self.config.rounds:
                return NavStep.failed(f"{why} It gave up after {self._rounds} recoveries.", left)
            self._rounds += 1
            self._recovering, self._blocked = True, 0.0
            self._recovery.reset()
        return NavStep(ZERO, False, left, None, self._path, "blocked")

    def _wait(self, since: float) -> BehaviourStatus:
        return BehaviourStatus.SUCCESS if since >= self.config.wait else BehaviourStatus.RUNNING

    def _replanned(self, since: float) -> BehaviourStatus:
        self._plan()
        if self._way is None:
            return BehaviourStatus.FAILURE
        twist = self._local.follow(self._pose, self._way, self._goal, self._footprint, self._around)
        return BehaviourStatus.FAILURE if twist is None else BehaviourStatus.SUCCESS

    def _clear(self, since: float) -> BehaviourStatus:
        """Forget what the scan saw beside the map, and look again."""
        self._surroundings.drop_new()
        return BehaviourStatus.SUCCESS

    def _back_up(self, since: float) -> BehaviourStatus:
        if since == 0.0 or self._backed is None:
            self._backed = self._pose
        gone = self._backed.to(self._pose)
        twist = Twist(-self.config.local.backward, 0.0, 0.0)
        if math.hypot(gone.x, gone.y) >= self.config.back or since > 4.0 * self.config.back / -twist.vx:
            self._backed = None
            return BehaviourStatus.SUCCESS
        if not self._local.clear(twist, self._pose, self._footprint, self._around):
            self._backed = None
            return BehaviourStatus.FAILURE
        self._twist = twist
        return BehaviourStatus.RUNNING
