"""`golem demo --walk`: the robot finds its way through a hall to the pack, and takes a screw out of it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from golem.dashboard.film import Film
from golem.dashboard.live import LiveView
from golem.demo import DemoConfig
from golem.evaluation.episodes.oracle import ContactWatch
from golem.evaluation.harness.run_folder import make_folder
from golem.output_file import write_file
from golem.robots.mujoco.balance import BalanceRecorder
from golem.robots.mujoco.engine import MujocoRobot
from golem.run import Narrator, on_air, shown
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.base import SkillResult
from golem.skills.disassemble_goal import DisassembleGoal
from golem.skills.navigate import NavigateGoal
from golem.stack import load_stack

STACK = "hall"
"""The shipped stack that walks."""
GOAL = NavigateGoal(6.4, 0.0, 0.0, "map", content=0.1)
"""Where to: 1.2 m before the pack's edge; docking goes the rest, measured from that edge."""
WORK = DisassembleGoal()
"""What it does there: dock, and take one screw out."""
FPS = 5.0
"""Pictures of the film per second of robot time."""


def run_walk_demo(config: DemoConfig) -> bool:
    """Let the robot walk to the pack, print what happens, and write a film and figures to `config.out`.

    Returns:
        Whether the robot arrived within 25 cm, by the simulator's truth, touched nothing on the way, and says that it
        took a screw out.

    Raises:
        ConfigError: an option is wrong.
        OutputError: the folder cannot be written.
    """
    make_folder(config.out)
    name, seed = STACK if config.stack == DemoConfig.stack else config.stack, config.seed or 0
    running, built = build(load_stack(name, profile=config.profile), seed)
    with closing(built):
        robot = shown(running, built)
        print(
            f"The robot stands in a hall, {math.hypot(GOAL.x, GOAL.y):.0f} m from the pack, and has no map.\n"
            f"It is to find its way around walls and obstacles by its LiDAR, dock, and take a screw out "
            f"(profile {config.profile}, seed {seed}).",
            flush=True,
        )
        recorder, contacts = BalanceRecorder(robot), ContactWatch(robot)
        with on_air(running, robot, config.record) as show:
            films, looks = list[Path](), (show, lambda: recorder(running.executor.t))
            if config.headless:
                with closing(Film(robot, fps=FPS, recorder=recorder)) as film:
                    watch = Narrator(running, *looks, lambda: film.tick(running))
                    figures = _errand(running, robot, contacts, running.execute, watch)
                    film.frame(running)
                    print(f"Writing the film ({len(film)} pictures).", flush=True)
                    films = film.save(config.out / "walk.webp")
            else:
                with LiveView(running, robot, config.port) as view:
                    print(f"Watch it at {view.url}.", flush=True)
                    view.await_spectator()
                    figures = _errand(running, robot, contacts, view.run, Narrator(running, *looks))
        for path in films:
            print(f"Film:   {path}")
    facts = {"stack": name, "profile": config.profile, "seed": seed}
    write_file(config.out / "walk.json", json.dumps(facts | figures, indent=2) + "\n")
    return bool(figures["success"])


def _errand(
    running: LockstepRunner,
    robot: MujocoRobot,
    contacts: ContactWatch,
    run: Callable[..., SkillResult],
    watch: Callable[[], None],
) -> dict[str, object]:
    """Walk, then work; print and return how it went, by the truth where the robot stood in between."""

    def watch_walk() -> None:
        watch()
        contacts(running.executor.t)

    walked = run("navigate", GOAL, watch=watch_walk)
    true = robot.truth.pose()
    worked = run("disassemble", WORK, watch=watch) if walked.success else None
    error = math.hypot(true.x - GOAL.x, true.y - GOAL.y)
    success = worked is not None and worked.success and error < 0.25 and not contacts.touched
    touched = ", ".join(contacts.touched) or "nothing"
    verdict = "Done" if success else "Failed"
    print(f"{verdict}: {walked.reason} By the truth {100 * error:.1f} cm off, touched {touched}.")
    if worked is not None:
        print(f"Before the pack: {worked.reason}")
    return {
        "success": success,
        "reason": walked.reason,
        "worked": None if worked is None else worked.reason,
        "error": round(error, 4),
        "touched": contacts.touched,
    }
