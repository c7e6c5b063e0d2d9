"""`golem demo --walk`: the robot finds its way through a hall to the battery pack, in the live view or into a film."""

from __future__ import annotations

import json
import math
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from golem.dashboard.film import Film
from golem.dashboard.live import LiveView
from golem.errors import OutputError
from golem.evaluation.episodes.contacts import ContactWatch
from golem.robots.mujoco.balance import BalanceRecorder
from golem.robots.mujoco.engine import MujocoRobot
from golem.run import Narrator, on_air, shown
from golem.runtime.lockstep import build
from golem.skills.base import SkillResult
from golem.skills.dock import DockGoal
from golem.skills.navigate import NavigateGoal
from golem.stack import load_stack
from golem.types import PlanarPose

STACK = "hall"
"""The shipped stack that walks."""
GOAL = NavigateGoal(6.7, 0.0, 0.0, "map")
"""Where to: 1.2 to 1.9 m before the pack's edge; `dock` goes the rest, measured from that edge."""
FPS = 5.0
"""Pictures of the film per second of robot time."""


@dataclass(frozen=True)
class WalkDemoResult:
    """How it went.

    Attributes:
        success: whether the robot arrived within 25 cm, by the simulator's truth, docked, and touched nothing.
        error: distance from the goal by the truth [m].
        films: the films, the GIF first; empty with the live view.
    """

    success: bool
    error: float
    films: list[Path]


def run_walk_demo(
    stack: str, profile: str, seed: int, out: Path, port: int, headless: bool, record: Path | None
) -> WalkDemoResult:
    """Let the robot walk to the pack, print what happens, and write a film and figures to `out`.

    Args:
        stack: a stack file, or the name of a shipped one, whose robot stands in the furnished hall.
        profile: realism profile.
        seed: of the episode.
        out: folder for film and figures.
        port: of the live view.
        headless: write a film instead of opening the live view.
        record: bag to write, if any.

    Raises:
        ConfigError: an option is wrong.
        OutputError: the folder cannot be written.
    """
    running, built = build(load_stack(stack, profile=profile), seed)
    with closing(built):
        robot = shown(running, built)
        print(
            f"The robot stands in a hall, {math.hypot(GOAL.x, GOAL.y):.0f} m from the pack, and has no map.\n"
            f"It shall find its way around walls and obstacles by its LiDAR (profile {profile}, seed {seed}).",
            flush=True,
        )
        narrator, recorder, contacts = Narrator(running), BalanceRecorder(robot), ContactWatch(robot)
        with on_air(running, robot, record) as show:

            def watch() -> None:
                narrator()
                show()
                recorder(running.executor.t)
                contacts(running.executor.t)

            films: list[Path] = []
            docked: SkillResult | None = None
            if headless:
                with closing(Film(robot, fps=FPS, recorder=recorder)) as film:

                    def filmed() -> None:
                        watch()
                        film.tick(running)

                    result = running.execute("navigate", GOAL, watch=filmed)
                    true = true_pose(robot)
                    if result.success:
                        docked = running.execute("dock", DockGoal(), watch=filmed)
                    film.frame(running)
                    print(f"Writing the film ({len(film)} pictures).", flush=True)
                    films = film.save(out / "walk.gif")
            else:
                with LiveView(running, robot, port) as view:
                    print(f"Watch it at {view.url}.", flush=True)
                    view.await_spectator()
                    result = view.run("navigate", GOAL, watch=watch)
                    true = true_pose(robot)
                    if result.success:
                        docked = view.run("dock", DockGoal(), watch=watch)
        return _told(
            result, docked, true, contacts, films, out, {"stack": stack, "profile": profile, "seed": seed}
        )


def true_pose(robot: MujocoRobot) -> PlanarPose:
    """Return where the robot really is in odom."""
    truth = robot.truth
    return PlanarPose.of(np.linalg.inv(truth.T_world_odom) @ truth.base().T_world_base)


def _told(
    result: SkillResult,
    docked: SkillResult | None,
    true: PlanarPose,
    contacts: ContactWatch,
    films: list[Path],
    out: Path,
    facts: dict[str, object],
) -> WalkDemoResult:
    """Print and write how it went."""
    error = math.hypot(true.x - GOAL.x, true.y - GOAL.y)
    success = docked is not None and docked.success and error < 0.25 and not contacts.touched
    touched = f", touched {', '.join(contacts.touched)}" if contacts.touched else ", touched nothing"
    print(
        f"{'Done' if success else 'Failed'}: {result.reason} By the truth {100 * error:.1f} cm off{touched}."
    )
    if docked is not None:
        print(f"Before the pack: {docked.reason}")
    for film in films:
        print(f"Film:   {film}")
    figures = {
        **facts,
        "success": success,
        "reason": result.reason,
        "docked": None if docked is None else docked.reason,
        "error": round(error, 4),
        "touched": contacts.touched,
    }
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / "walk.json").write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    except OSError as problem:
        raise OutputError(f"Cannot write to --out {out}: {problem.strerror}; choose another.") from problem
    return WalkDemoResult(success, error, films)
