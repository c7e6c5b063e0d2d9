"""`golem demo --walk`: the robot finds its way through a hall to the pack, and takes a screw out of it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from golem.dashboard.film import Film
from golem.dashboard.live import LiveView
from golem.errors import OutputError
from golem.evaluation.episodes.contacts import ContactWatch
from golem.robots.mujoco.balance import BalanceRecorder
from golem.robots.mujoco.engine import MujocoRobot
from golem.run import Narrator, on_air, shown
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.base import SkillResult
from golem.skills.disassemble import DisassembleGoal
from golem.skills.navigate import NavigateGoal
from golem.stack import load_stack
from golem.types import PlanarPose

STACK = "hall"
"""The shipped stack that walks."""
GOAL = NavigateGoal(6.4, 0.0, 0.0, "map", content=0.1)
"""Where to: 1.2 m before the pack's edge; docking goes the rest, measured from that edge."""
WORK = DisassembleGoal()
"""What it does there: dock, and take one screw out."""
FPS = 5.0
"""Pictures of the film per second of robot time."""


@dataclass(frozen=True)
class WalkDemoResult:
    """How it went.

    Attributes:
        success: whether the robot arrived within 25 cm, by the simulator's truth, touched nothing on the way, and says
            that it took a screw out.
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
            f"It shall find its way around walls and obstacles by its LiDAR, dock, and take a screw out "
            f"(profile {profile}, seed {seed}).",
            flush=True,
        )
        narrator, recorder, contacts = Narrator(running), BalanceRecorder(robot), ContactWatch(robot)
        with on_air(running, robot, record) as show:

            def watch() -> None:
                narrator()
                show()
                recorder(running.executor.t)

            films: list[Path] = []
            if headless:
                with closing(Film(robot, fps=FPS, recorder=recorder)) as film:

                    def filmed() -> None:
                        watch()
                        film.tick(running)

                    ended = _errands(running, robot, contacts, running.execute, filmed)
                    film.frame(running)
                    print(f"Writing the film ({len(film)} pictures).", flush=True)
                    films = film.save(out / "walk.gif")
            else:
                with LiveView(running, robot, port) as view:
                    print(f"Watch it at {view.url}.", flush=True)
                    view.await_spectator()
                    ended = _errands(running, robot, contacts, view.run, watch)
        return _told(*ended, contacts, films, out, {"stack": stack, "profile": profile, "seed": seed})


def _errands(
    running: LockstepRunner,
    robot: MujocoRobot,
    contacts: ContactWatch,
    run: Callable[..., SkillResult],
    watch: Callable[[], None],
) -> tuple[SkillResult, SkillResult | None, PlanarPose]:
    """Walk, then work; return how both ended, and where the robot stood in between, by the truth."""

    def watch_walk() -> None:
        watch()
        contacts(running.executor.t)

    result = run("navigate", GOAL, watch=watch_walk)
    true = robot.truth.pose()
    return result, run("disassemble", WORK, watch=watch) if result.success else None, true


def _told(
    result: SkillResult,
    worked: SkillResult | None,
    true: PlanarPose,
    contacts: ContactWatch,
    films: list[Path],
    out: Path,
    facts: dict[str, object],
) -> WalkDemoResult:
    """Print and write how it went."""
    error = math.hypot(true.x - GOAL.x, true.y - GOAL.y)
    success = worked is not None and worked.success and error < 0.25 and not contacts.touched
    touched = f", touched {', '.join(contacts.touched)}" if contacts.touched else ", touched nothing"
    print(
        f"{'Done' if success else 'Failed'}: {result.reason} By the truth {100 * error:.1f} cm off{touched}."
    )
    if worked is not None:
        print(f"Before the pack: {worked.reason}")
    for film in films:
        print(f"Film:   {film}")
    figures = {
        **facts,
        "success": success,
        "reason": result.reason,
        "worked": None if worked is None else worked.reason,
        "error": round(error, 4),
        "touched": contacts.touched,
    }
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / "walk.json").write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    except OSError as problem:
        raise OutputError(f"Cannot write to --out {out}: {problem.strerror}; choose another.") from problem
    return WalkDemoResult(success, error, films)
