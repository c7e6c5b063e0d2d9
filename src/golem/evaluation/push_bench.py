"""`golem bench push`: the largest push that each lower body survives, by direction and gait phase, side by side."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from tyro.conf import arg

from golem.errors import ConfigError, ModuleFault, unknown_name
from golem.evaluation.campaign import Done, Job, Result, run_campaign, write_files
from golem.evaluation.episodes.episode import LATENCY, Episode
from golem.evaluation.episodes.scripted_motion import ArmMotion, ScriptedMotion
from golem.evaluation.harness.arguments import replaced_modules, robot_options
from golem.evaluation.harness.pool import CAN_COPY, in_a_copy
from golem.evaluation.leg_tests import can_walk
from golem.evaluation.subject import Subject, labels
from golem.provenance import commit
from golem.robots.mujoco.shoves import DIRECTIONS, rod, shove
from golem.robots.sensors.profiles import load_profile
from golem.skills.base import FAULT
from golem.types import Twist

DOES_NOT_WALK = "does not walk"
"""Loss of a lower body that only stands, in a phase of walking."""
Kind = Literal["shove", "rod"]
Phase = Literal["standing", "left_swing", "right_swing"]

SURVIVED = 0.95
"""Share of the trials of a level that has to be survived."""
SETTLE = (2.0, 3.0)
"""Range of the time of standing before the push or before walking, and of walking before the push [s]."""
WALK = Twist(vx=0.3)
"""Twist of the trials in which the robot walks."""
SWING = 0.15
"""The push meets a swinging foot up to so long after it was lifted [s]."""
STEP = 2.0
"""Time in which a robot that walks lifts each foot [s]."""
TRIES = 5
"""Swings of that foot that may end before the push: a sole chatters, or a step is short."""
PATIENCE = 4.0
"""Time after the push that has to be survived [s]."""
QUIET = 0.5
"""Time of quiet standing after which nothing more can happen [s]."""


@dataclass(frozen=True)
class PushBenchConfig:
    """Find the largest push each lower body survives: a shove of 0.2 s against the torso, or the rod at the pelvis.

    Levels ascend until one is not survived in 95 % of its trials; where the first level fails they descend instead.
    """

    method: tuple[str, ...] = ("almi",)
    """Lower bodies: names, file.py:Class, policy:DESCRIPTION:NETWORK, or with options "{use: NAME, option: value}"."""
    kind: Kind = "shove"
    """shove: constant force on the torso for 0.2 s, levels in N s. rod: half a sine of 1 s at the pelvis, in N."""
    phase: tuple[Phase, ...] = ("standing", "left_swing", "right_swing")
    """When the push comes: standing, or walking while that foot is in the air."""
    direction: tuple[str, ...] = DIRECTIONS
    """Where the push drives the robot."""
    n: Annotated[int, arg(aliases=("-n",))] = 20
    """Trials per level."""
    first: float = 10.0
    """First level."""
    step: float = 10.0
    """Distance between levels."""
    last: float = 200.0
    """Highest level."""
    profile: str = "bench"
    """Realism of sensors and actuators: ideal, bench or field."""
    latency: float = LATENCY
    """Delay of motor commands on top of the profile's [s]."""
    robot: tuple[str, ...] = ()
    """Further options of the twin, e.g. feet=box cone=elliptic, or mjcf=../h1_2.xml."""
    use: tuple[str, ...] = ()
    """Replace other modules of the stack: slot=implementation, e.g. estimator=invariant_ekf, or =mine.py:Mine."""
    seed: int = 0
    """Seed; trial i of every method meets the same draws."""
    out: Path = Path("runs/push-bench")
    """Folder for jobs.jsonl, table.md and results.json; the same command continues an interrupted run."""
    j: Annotated[int, arg(aliases=("-j",))] = 1
    """Processes."""
    json: bool = False
    """Print the results as a last line of JSON."""


@dataclass(frozen=True, slots=True)
class Trial:
    """One robot, pushed in several directions: up to the push they all share one past.

    Attributes:
        subject: what is tested.
        kind, phase: of the push.
        directions: where it drives the robot, one after the other, each time from the same moment.
        level: impulse [N s] of a shove, peak force [N] of the rod.
        index, seed: the draws.
    """

    subject: Subject
    kind: str
    phase: str
    directions: tuple[str, ...]
    level: float
    index: int
    seed: int

    def run(self) -> Result:
        """Return the stage in which the robot was lost, by direction; None where it survived."""
        starts = [self.directions] if CAN_COPY else [(direction,) for direction in self.directions]
        found: Result = {}
        for directions in starts:
            found |= self._from_one_start(directions)
        return found

    def _from_one_start(self, directions: Sequence[str]) -> Result:
        try:
            with closing(self.subject.episode(self.seed, self.index)) as episode:
                lost = self._before(episode)
                if lost is not None:
                    return dict.fromkeys(directions, lost)
                if len(directions) == 1:
                    return {directions[0]: self._after(episode, directions[0])}
                return {d: in_a_copy(partial(self._after, episode, d)) for d in directions}
        except ModuleFault:
            return dict.fromkeys(directions, FAULT)

    def _before(self, episode: Episode) -> str | None:
        """Bring the robot to the moment of the push; return the stage in which it was lost, or None."""
        draw = self.subject.draw(self.seed, self.index)
        times = draw.rng("times")
        settle, late = times.uniform(*SETTLE), times.uniform(0.0, SWING)
        exercise = ScriptedMotion(ArmMotion(draw.rng("arms")))
        episode.start(exercise)
        episode.stand(settle)
        if self.phase != "standing":
            if not can_walk(episode.running.envelope):
                return DOES_NOT_WALK
            exercise.twist = lambda t: WALK
            episode.run(settle)
            if not self._swing(episode, late):
                return "no step"
        return None if episode.loss is None else episode.loss.stage

    def _after(self, episode: Episode, direction: str) -> str | None:
        """Push the robot and wait; return the stage in which it was lost, or None."""
        push = (shove if self.kind == "shove" else rod)(direction, self.level)
        try:
            episode.push(push)
            episode.run(push.duration)
            episode.recorder.quiet = 0.0
            standing = self.phase == "standing"
            episode.run(PATIENCE, until=lambda: standing and episode.recorder.quiet >= QUIET)
        except ModuleFault:
            return FAULT
        return None if episode.loss is None else episode.loss.stage

    def _swing(self, episode: Episode, late: float) -> bool:
        """Walk until the foot of the phase was lifted `late` [s] ago and is still in the air; False if it never is."""
        air = [self.phase != "left_swing", self.phase != "right_swing"]

        def swings() -> bool:
            return episode.recorder.contact.tolist() == air

        for _ in range(TRIES):
            episode.run(STEP, until=lambda: not swings())
            episode.run(STEP, until=swings)
            episode.run(late)
            if episode.over or swings():
                return True
        return False


def allowed(n: int) -> int:
    """Return how many of `n` trials a level may lose."""
    return math.floor((1.0 - SURVIVED) * n + 1e-9)


class Search:
    """Gathers the trials of a level until it is complete, and says which are next."""

    def __init__(self, config: PushBenchConfig) -> None:
        """Search as `config` says."""
        self._config = config
        self._found: dict[tuple[str, str, float], list[Result]] = {}

    def first(self, subjects: Sequence[Subject]) -> list[Trial]:
        """Return the trials to begin with."""
        c = self._config
        return [
            Trial(subject, c.kind, phase, c.direction, c.first, index, c.seed)
            for phase in c.phase
            for index in range(c.n)
            for subject in subjects
        ]

    def following(self, job: Job, result: Result) -> list[Trial]:
        """Return the trials that follow from another result: of the levels to which its own leads, if complete."""
        assert isinstance(job, Trial)
        found = self._found.setdefault((job.subject.method, job.phase, job.level), [])
        found.append(result)
        if len(found) < self._config.n:
            return []
        wanted: dict[float, list[str]] = {}
        for direction in job.directions:
            level = self.next([r[direction] for r in found], job.level)
            if level is not None:
                wanted.setdefault(level, []).append(direction)
        return [
            replace(job, directions=tuple(directions), level=level, index=index)
            for level, directions in wanted.items()
            for index in range(self._config.n)
        ]

    def next(self, losses: Sequence[str | None], level: float) -> float | None:
        """Return the level to try after `level` in one direction: up as long as they pass, down if the first fails.

        Args:
            losses: how each robot was lost at this level; None where it survived.
            level: present one.
        """
        c = self._config
        lost = [loss for loss in losses if loss is not None]
        passed = len(lost) <= allowed(c.n)
        if level < c.first:
            following = None if passed else level - c.step
        elif passed:
            following = level + c.step
        else:
            following = c.first - c.step if level == c.first and DOES_NOT_WALK not in lost else None
        return following if following is not None and 1e-9 < following <= c.last + 1e-9 else None


def run_push_bench(config: PushBenchConfig) -> list[dict[str, Any]]:
    """Search every cell, write and print the table.

    Returns:
        One entry per cell, see `cells`.

    Raises:
        GolemError: an option is wrong, the folder cannot be written, or a method cannot run.
        CampaignInterrupted: Ctrl-C.
    """
    _check(config)
    robot = {"latency": config.latency, **robot_options(config.robot)}
    use = replaced_modules(config.use)
    subjects = [Subject.of(method, config.profile, robot, use) for method in config.method]
    search = Search(config)
    found = cells(run_campaign(config.out, search.first(subjects), config.j, search.following))
    text = table(found, config)
    results = {"config": _jsonable(config), "commit": commit(), "cells": found}
    write_files(config.out, {"table.md": text, "results.json": json.dumps(results, indent=1) + "\n"})
    print(text)
    if config.json:
        print(json.dumps(results))
    return found


def cells(done: Sequence[Done]) -> list[dict[str, Any]]:
    """Return one entry per cell: its levels with trials and losses, the largest survived, the least that was not."""
    levels: dict[tuple[str, str, str], dict[float, list[str | None]]] = {}
    for item in done:
        job = item.job
        assert isinstance(job, Trial)
        for direction in job.directions:
            cell = levels.setdefault((job.subject.method, job.phase, direction), {})
            cell.setdefault(job.level, []).append(item.result[direction])
    found: list[dict[str, Any]] = []
    for (method, phase, direction), tried in levels.items():
        lost = {level: Counter(x for x in tried[level] if x is not None) for level in sorted(tried)}
        passed = [level for level in lost if lost[level].total() <= allowed(len(tried[level]))]
        failed = [level for level in lost if level not in passed]
        found.append(
            {
                "method": method,
                "phase": phase,
                "direction": direction,
                "survived": max(passed, default=0.0),
                "failed": min(failed, default=None),
                "losses": dict(lost[min(failed)]) if failed else {},
                "levels": [
                    {"level": level, "n": len(tried[level]), "lost": lost[level].total()} for level in lost
                ],
            }
        )
    return found


def table(found: Sequence[dict[str, Any]], config: PushBenchConfig) -> str:
    """Return the results as a Markdown table with a row per method and phase."""
    unit = "N s" if config.kind == "shove" else "N"
    what = "shove of 0.2 s on the torso" if config.kind == "shove" else "half-sine push of 1 s at the pelvis"
    words = " ".join((*config.robot, *config.use))
    head = [
        f"Largest {what} survived in >= {100 * SURVIVED:.0f} % of {config.n} trials [{unit}]; profile "
        f"{config.profile}, latency {1e3 * config.latency:g} ms, seed {config.seed}{', ' + words if words else ''}.",
        "",
        "| lower body | phase | " + " | ".join(d.replace("_", " ") for d in config.direction) + " | least |",
        "|---|---|" + "---|" * (len(config.direction) + 1),
    ]
    by_key = {(c["method"], c["phase"], c["direction"]): c for c in found}
    rows: list[str] = []
    names = labels(config.method)
    for method in config.method:
        for phase in config.phase:
            chosen = [by_key[method, phase, direction] for direction in config.direction]
            shown = [_cell(c) for c in chosen]
            minimum = min(c["survived"] for c in chosen)
            rows.append(f"| {names[method]} | {phase} | {' | '.join(shown)} | {minimum:g} |")
    notes = [
        "",
        f"A level is lost with {allowed(config.n) + 1} of {config.n} trials; `>=`: the highest one tried was not lost.",
        "",
    ]
    return "\n".join([*head, *rows, *notes])


def _cell(cell: dict[str, Any]) -> str:
    if DOES_NOT_WALK in cell["losses"]:
        return DOES_NOT_WALK
    return f"{'' if cell['failed'] is not None else '>= '}{cell['survived']:g}"


def _check(config: PushBenchConfig) -> None:
    load_profile(config.profile)
    for name in config.direction:
        if name not in DIRECTIONS:
            raise unknown_name("direction", name, DIRECTIONS)
    for phase in config.phase:
        if phase not in get_args(Phase):
            raise unknown_name("phase", phase, get_args(Phase))
    for option, value in (("-n", config.n), ("--first", config.first), ("--step", config.step)):
        if value <= 0:
            raise ConfigError(f"{option} is {value:g}; it must be more than 0.")
    if config.seed < 0 or config.last < config.first:
        raise ConfigError("--seed is 0 or more, and --last at least --first.")
    for option, names in (("direction", config.direction), ("phase", config.phase)):
        if len(set(names)) < len(names):
            raise ConfigError(f"--{option} names one of them twice.")
    if not config.method or len(set(config.method)) < len(config.method):
        raise ConfigError("--method names one lower body or several different ones.")


def _jsonable(config: PushBenchConfig) -> dict[str, Any]:
    return {name: str(v) if isinstance(v, Path) else v for name, v in asdict(config).items()}
