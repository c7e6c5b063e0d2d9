"""Rungs `navigate` and `navigate-line`: 6 m through a hall by the robot's own map, or straight over the open floor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import cv2
import numpy as np

from golem.capabilities.navigation.movers import BODY
from golem.dashboard.map_picture import GOAL, TRACK, WAY, MapPicture
from golem.evaluation.base import DONE, Rung, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode, Loss, episode_seed, legs_stack
from golem.evaluation.episodes.last_seconds import FilmStrip
from golem.evaluation.episodes.oracle import ContactWatch, apart, errors
from golem.evaluation.episodes.survey import survey
from golem.evaluation.rungs.leg_rung import NO_WALKER, LegRung, PlantOptions
from golem.interfaces import topics
from golem.interfaces.nav_payloads import NavStep
from golem.provenance import stack_facts
from golem.robots.mujoco.balance import TRACE
from golem.runtime.executor import when_stepped
from golem.runtime.lockstep import build_robot
from golem.skills.navigate import NavigateGoal
from golem.skills.walk import WalkGoal
from golem.stack import Stack
from golem.types import Array, PlanarPose, Twist, wrap

EVERY = 0.2
"""Time between two places of the track [s]."""
SOMEBODY = BODY + 0.4
"""Distance from somebody up to which a walker that the navigator names is that person [m]: both radii, and the gate."""
WALKING = ("follow", "approach")
"""Notes of a navigator that is on its way."""


class HallWalk:
    """Collects what happens on a walk; call it after every tick from the beginning of the walk on.

    Attributes:
        track: true places on the floor, in odom [m].
        stopped: true pose when the legs were last told to stand; None while they never were.
        recoveries: how often the navigator began to recover.
        stood: time for which it was neither following nor approaching [s].
        walkers: those it took to walk about, counted at every step.
        nobody: those of them where nobody was.
    """

    def __init__(self) -> None:
        self.track: list[tuple[float, float]] = []
        self.stopped: PlanarPose | None = None
        self.recoveries = self.walkers = self.nobody = 0
        self.stood = 0.0
        self._step: NavStep | None = None
        self._since = self._drawn = -np.inf

    def due(self) -> float:
        """Return when the next place of the track is due [s]."""
        return self._drawn + EVERY

    def __call__(self, episode: Episode) -> None:
        """Look at the newest step of the navigator, and at the robot."""
        step, before, t = episode.running.bus.latest(topics.NAV_STEP), self._step, episode.t
        if step is None:
            return
        if t >= self._drawn + EVERY:
            self._drawn = t
            pose = episode.robot.truth.pose()
            self.track.append((pose.x, pose.y))
        if step is before:
            return
        if before is not None:
            if before.twist != Twist() and step.twist == Twist():
                self.stopped = episode.robot.truth.pose()
            self.recoveries += step.note == "recover" != before.note
            self.stood += (t - self._since) * (before.note not in WALKING)
        self._step, self._since = step, t
        if len(step.people):
            # Where everybody really is, in odom, which is also the frame of the survey's map [m].
            T = np.linalg.inv(episode.robot.truth.T_world_odom)
            places = [T[:2, :3] @ person.position(episode.t) + T[:2, 3] for person in episode.robot.scene.people]
            off = step.people[:, None, :2] - np.array(places).reshape(-1, 2)
            self.walkers += len(step.people)
            self.nobody += int((np.hypot(off[..., 0], off[..., 1]) > SOMEBODY).all(axis=1).sum())

    def series(self) -> dict[str, float]:
        """Return the figures of it; see `Metric`."""
        found = {"recoveries": float(self.recoveries), "stood": self.stood}
        if self.walkers:
            found["nobody"] = self.nobody / self.walkers
        return found


MapKind = Literal["survey", "none"]
SLOT = "navigator"
"""What the methods of this rung are."""
DISTANCE = 6.0
"""Length of the way as the crow flies, and of the line [m], from the paper."""
SPREAD = (0.2, 0.4, math.radians(20.0))
"""Bounds of where the robot starts, x, y [m] and heading [rad]; the goal is drawn off by it."""
GUESS = (0.4, 0.4, math.radians(15.0))
"""Bounds of the error of the guess where the robot is on the map."""
TOLERANCE, TURNED = 0.25, 0.25
"""True error up to which the robot has arrived [m], [rad]: the tolerance of the paper's authors."""
SETTLE = 4.0
"""Time before the robot sets out [s]."""
TIMEOUT = 120.0
"""Time it gets to arrive [s]."""


@dataclass(frozen=True)
class NavigateOptions:
    """The hall and the rest of the stack."""

    obstacles: int = 4
    """Walls and obstacles in the way."""
    people: int = 0
    """How many people walk about beside the lane."""
    map: tuple[MapKind, ...] = ("survey",)
    """Maps the robot has when it begins: one of the hall without its obstacles, from before; or none."""
    legs: str = "almi"
    """The lower body that walks."""
    odometry: str = "lio"
    """The odometry by which the map is made."""


def surveyed(stack: Stack, spec: TrialSpec, folder: Path) -> Stack:
    """Return a stack whose mapper has the map of a trial's hall from before, kept in `folder`, and a rough guess."""
    seed = episode_seed(spec.seed, spec.index)
    with closing(build_robot(stack, seed)) as robot:
        survey(robot, seed, folder / "hall")
    guess = (spec.rng("guess").uniform(-1.0, 1.0, 3) * GUESS).tolist()
    return stack.with_options("mapper", file=f"{folder}/hall.yaml", guess=guess)


class NavigateRung(Rung[NavigateOptions]):
    """Walk 6 m from a noisy start through a hall whose walls and obstacles are drawn by the seed, and stand at a pose.

    With the case `survey` the robot has a map of the hall from before the obstacles were put up, and a rough guess of
    where it stands in it; the goal is a place on that map. With `none` the goal is given from where the robot stands.
    The error at the goal is that of the true pose. It is split into what the robot believed to be left (planner and
    follower), how far it was from where it believed to be (odometry and mapper), and how far the last stop moved it.
    """

    name = "navigate"
    varied = {"map": "map"}
    Options = NavigateOptions
    default_methods = ("costmap_astar",)
    slot = SLOT
    default_n = 20

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        return {**stack_facts(self._stack(method, profile, overrides)), "distance": DISTANCE, "spread": SPREAD}

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        stack = self._stack(spec.method, spec.profile, spec.overrides)
        seed, known = episode_seed(spec.seed, spec.index), spec.case["map"] == "survey"
        with TemporaryDirectory() as folder:
            if known:
                stack = surveyed(stack, spec, Path(folder))
            with closing(Episode(stack, seed, self.onlooker)) as episode:
                return self._walk(spec, episode, known)

    def _walk(self, spec: TrialSpec, episode: Episode, known: bool) -> TrialOutcome:
        off = spec.rng("start").uniform(-1.0, 1.0, 3) * SPREAD
        goal = PlanarPose(DISTANCE + float(off[0]), float(off[1]), float(off[2]))
        walked, contacts = HallWalk(), ContactWatch(episode.robot)

        def look() -> bool:
            contacts(episode.t)
            walked(episode)
            return episode.result is not None

        episode.stand(SETTLE)
        if not episode.over:
            frame = "map" if known else "odom"
            episode.start("navigate", NavigateGoal(goal.x, goal.y, goal.yaw, frame, TIMEOUT))
        episode.run(TIMEOUT + SETTLE, look, lambda: min(contacts.due(), walked.due()))
        return judge(spec, episode, goal, walked, contacts)

    def _stack(self, method: str, profile: str, overrides: Mapping[str, str]) -> Stack:
        options = self.options
        plant = {"world": "furnished", "obstacles": options.obstacles, "people": options.people}
        use = {"estimator": "invariant_ekf", "odometry": options.odometry, **overrides}
        return legs_stack(options.legs, profile, use, plant).with_choice(SLOT, method)


def judge(
    spec: TrialSpec, episode: Episode, goal: PlanarPose, walked: HallWalk, contacts: ContactWatch
) -> TrialOutcome:
    """Say where the robot ended, and which module lost it."""
    bus, result, loss = episode.running.bus, episode.result, episode.loss
    true = episode.robot.truth.pose()
    left = goal.to(true)
    radial, turned = apart(left), abs(wrap(left.yaw))
    track = np.array(walked.track or [(0.0, 0.0)])
    gone = float(np.linalg.norm(np.diff(track[::5], axis=0), axis=1).sum())
    series = errors("goal", left) | {"goal_yaw": turned, "distance": gone, "contacts": float(len(contacts.touched))}
    series |= walked.series()
    drift, believed = 0.0, bus.latest(topics.ODOMETRY)
    if believed is not None:
        there = PlanarPose.of(believed.T_odom_base)
        series["odometry_error"] = apart(true.to(there))
        place = bus.latest(topics.MAP_POSE)
        there = there if place is None else place.T_odom_map.to(there)
        drift = series["place_error"] = apart(true.to(there))
        series["place_yaw"] = abs(true.to(there).yaw)
        series["follower_error"] = apart(there.to(goal))
    if walked.stopped is not None:
        series["stop_shift"] = apart(walked.stopped.to(true))
    modules = {key: f"{key}: {episode.running.stack.choice(key).use}" for key in ("lower_body", "odometry", "mapper")}
    # With a map the mapper answers for the place, which corrects the odometry by it.
    lost = modules["mapper" if spec.case["map"] == "survey" else "odometry"]
    module = navigator = f"{SLOT}: {spec.method}"
    if contacts.touched:  # a robot that was hit may fall, or be stopped, for that
        pair, t = next(iter(contacts.touched.items()))
        loss = Loss("contact", f"{pair} at {t:.1f} s, {drift:.2f} m beside where it believed to be.")
        module = lost if drift > 0.15 else navigator
    elif loss is not None:
        module = modules["lower_body"]
    elif result is None:
        loss = Loss("timeout", f"It is {radial:.2f} m from the goal after {TIMEOUT:g} s.")
    elif not result.success:
        loss = Loss(result.stage, result.reason, result.trace)
        module = modules.get(result.slot or "", navigator)
    elif radial > TOLERANCE or turned > TURNED:
        loss = Loss("goal", f"It stands {radial:.2f} m beside the goal and believes to be there.")
        module = lost if drift > 0.5 * radial else navigator
    picture = _picture(episode, track, goal) if loss is not None or spec.index == 0 else None
    if loss is not None:
        return TrialOutcome(False, loss.stage, module, loss.detail, series=series, picture=picture, trace=loss.trace)
    detail = f"stands {1e3 * radial:.0f} mm and {math.degrees(turned):.1f} deg from the goal"
    return TrialOutcome(True, DONE, None, detail, result.timings if result else {}, series, picture)


def _picture(episode: Episode, track: Array, goal: PlanarPose) -> bytes | None:
    """Return the map with the way and the walk as PNG; None where there is no map."""
    bus = episode.running.bus
    grid, step, place = bus.latest(topics.MAP), bus.latest(topics.NAV_STEP), bus.latest(topics.MAP_POSE)
    if grid is None or place is None:
        return None
    picture = MapPicture(grid.in_map)
    if step is not None and step.path is not None:
        picture.line(step.path, WAY)
    picture.line(track, TRACK)
    picture.pose(goal, GOAL)
    return cv2.imencode(".png", picture.rgb()[..., ::-1])[1].tobytes()


LINE_TOLERANCE = 0.5
"""True radial error up to which the goal of the line counts as reached [m]; the paper's failed run was several metres
off."""
LINE_SETTLE, LINE_TIMEOUT = 2.0, 60.0
"""Time before the robot sets out on the line, and time it gets to arrive [s]."""
PICTURES = 5
"""Moments of the strip of pictures."""


@dataclass(frozen=True)
class LineOptions(PlantOptions):
    """The twin under the lower bodies."""

    latency: float = 0.0
    """Delay of motor commands on top of the profile's [s]."""


class NavigateLine(LegRung[LineOptions]):
    """Walk 6 m straight ahead over the open floor, by odometry; the error is that of the true pose.

    No LiDAR odometry takes part: the robot goes by its base estimator, to whose pose a noise of 1 cm and 1 deg is
    added (`golem.evaluation.episodes.episode`). The drift of legs and IMU over the line is in the error.
    """

    name = "navigate-line"
    Options = LineOptions
    facts = {"distance": DISTANCE, "tolerance": LINE_TOLERANCE}

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        with closing(self.episode(spec)) as episode:
            if episode.running.envelope.vx[1] <= 0.0:
                why = "It does not walk: the greatest forward speed in its envelope is zero."
                return TrialOutcome(False, NO_WALKER, f"lower_body: {spec.method}", why)
            episode.locate(spec.rng("odometry"))
            strip = FilmStrip(episode.robot, 0.0)
            episode.stand(LINE_SETTLE)
            if not episode.over:
                goal = WalkGoal(DISTANCE, 0.0, 0.0, "odom", LINE_TIMEOUT)
                episode.start("walk", goal)
            for _ in range(PICTURES - 1):
                strip.keep(episode.t, np.zeros(3))
                episode.run(DISTANCE / PICTURES / 0.4, until=lambda: episode.result is not None, due=when_stepped)
            episode.run(LINE_TIMEOUT, until=lambda: episode.result is not None, due=when_stepped)
            strip.keep(episode.t, np.zeros(3))
            if artefacts is not None:
                episode.recorder.trace().save(artefacts / TRACE)
            outcome = judge_line(episode, spec.method)
            shown = not outcome.success or spec.index == 0
            return replace(outcome, picture=strip.picture() if shown else None)


def judge_line(episode: Episode, method: str) -> TrialOutcome:
    """Say where the robot ended."""
    trace, true = episode.recorder.trace(), episode.robot.truth.pose()
    left = PlanarPose(DISTANCE, 0.0, 0.0).to(true)
    series = errors("goal", left) | {"steps": float(trace.steps), "margin_min": float(trace.margin.min())}
    believed = episode.running.bus.latest(topics.ODOMETRY)
    if believed is not None:
        series["odometry_error"] = apart(true.to(PlanarPose.of(believed.T_odom_base)))
    loss, result = episode.loss, episode.result
    slot, module = "lower_body", f"lower_body: {method}"
    if loss is None and result is not None and not result.success:
        loss = Loss(result.stage, result.reason, result.trace)
        slot = "navigator" if result.slot == "navigator" else slot
    if loss is None and apart(left) > LINE_TOLERANCE:
        loss = Loss("goal", f"It stands {apart(left):.2f} m beside the goal and believes to be there.")
        slot = "estimator"
    if loss is not None:
        module = module if slot == "lower_body" else f"{slot}: {episode.running.stack.choice(slot).use}"
        return TrialOutcome(False, loss.stage, module, loss.detail, series=series, trace=loss.trace)
    detail = f"stands {1e3 * apart(left):.0f} mm from the goal"
    return TrialOutcome(True, DONE, None, detail, result.timings if result else {}, series)
