"""`golem demo`: the robot, on its own feet, pulls loosened screws from the pack, before your eyes or into a film."""

from __future__ import annotations

import json
import secrets
import time
import webbrowser
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from golem.dashboard.film import Film, shots
from golem.dashboard.live import LiveView
from golem.dashboard.status import Timeline
from golem.errors import ConfigError, MissingExtra
from golem.evaluation.episodes.oracle import Oracle
from golem.evaluation.harness.run_folder import make_folder
from golem.evaluation.report.demo_page import PickRecord, balance_figures, balance_section, demo_page
from golem.output_file import write_file
from golem.provenance import command_line, commit, versions
from golem.robots.mujoco.balance import BalanceRecorder
from golem.robots.mujoco.config import WORKSHOPS
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.shoves import Pusher, shove
from golem.robots.mujoco.spectator import SpectatorView
from golem.robots.worlds.conditions import LayoutKind, Value
from golem.run import Narrator, no_display, on_air, shown
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.base import CANCELLED, SkillResult
from golem.skills.pick_config import PickGoal
from golem.stack import Stack, load_stack

FPS = 10.0
"""Pictures of the film per second of robot time."""
PICTURE_SIZE = (1280, 720)
PULLED = 0.8
"""Time into the extraction at which the report's picture is taken [s]: the screw is out of its bore."""


SHOVE = shove("back", 25.0)
"""The push at the film's end."""
RECOVERY = 5.0
"""Time after its begin at which the robot must stand again [s]."""
QUIET = 0.5
"""Time of standing quietly that shows that it does [s]."""


SHOWN: dict[str, Value] = {"loose": 0.8, "tray_y": 0.05, "light": 1.0}
"""What the seed does not draw of a varied work place: light for the film, and room for several loose screws on the
tray's side."""


@dataclass(frozen=True)
class DemoConfig:
    """The robot stands before a battery pack, pulls loosened screws out of it and drops them in a tray."""

    stack: str = "stand"
    """Path of a stack file, or the name of a shipped one; with `tether` the robot hangs from a hoist."""
    walk: bool = False
    """Walk through a hall to the pack instead, around walls and obstacles; the stack is then `hall` by default."""
    pack: bool = False
    """Empty an edge of a real pack by a gantry's list instead, filmed at eight times real time."""
    headless: bool = field(default_factory=no_display)
    """Write a film instead of opening the live view; the default where there is no display."""
    screws: int = 2
    """Screws to put in the tray; up to twice as many picks are tried."""
    profile: str = "bench"
    """Realism profile: ideal, bench or field."""
    layout: LayoutKind = "nominal"
    """nominal: always the same. varied: pack, tray, finishes and clutter as the seed draws them."""
    seed: int | None = None
    """Seed of the work place and the errors; by default 0, and of a varied place a new one each time, which is
    printed."""
    out: Path = Path("runs/demo")
    """Folder for film, report and figures."""
    port: int = 8080
    """Port of the live view."""
    record: Path | None = None
    """Write everything public into a bag, a new folder of this name."""


class Demo:
    """One demonstration in progress."""

    def __init__(
        self, config: DemoConfig, running: LockstepRunner, robot: MujocoRobot, show: Callable[[], None] = lambda: None
    ) -> None:
        """Demonstrate what `config` says with a built stack; `show` is called after every tick."""
        self._show = show
        self._config, self._running, self._robot = config, running, robot
        self._oracle = Oracle(robot)
        self._pusher = Pusher(robot)
        self._pushed_at: float | None = None
        self.recorder = BalanceRecorder(robot)
        self._started = time.perf_counter()
        self._timeline = Timeline()
        self.picks: list[PickRecord] = []
        self.picture: NDArray[np.uint8] | None = None

    def in_tray(self) -> list[str]:
        """Return the screws in the tray."""
        return self._oracle.screws_in_tray()

    def over(self) -> bool:
        """Return whether there is nothing left to try: all are out, too many tries, cancelled, or the robot lost."""
        cancelled = bool(self.picks) and self.picks[-1].stage == CANCELLED
        tried = len(self.picks) >= 2 * self._config.screws
        return cancelled or tried or self.lost() or len(self.in_tray()) >= self._config.screws

    def lost(self) -> bool:
        """Return whether the robot fell or was stopped."""
        stopped = bool(self.picks) and self.picks[-1].stage == "safety"
        return stopped or self.recorder.fallen

    def push(self, watch: Callable[[], None]) -> None:
        """Push the robot, and watch until it stands again or it is clear that it does not."""
        executor = self._running.executor
        start = self._pushed_at = executor.t
        print(f"Now a push: {SHOVE.impulse:.0f} N s to the {SHOVE.direction}.", flush=True)
        self._pusher.begin(SHOVE, start, self.recorder.yaw)

        def over() -> bool:
            watch()
            stands = self.recorder.quiet >= QUIET and executor.t > start + 2.0
            return stands or self.recorder.fallen

        executor.run(start + RECOVERY, over)
        steps = self.recorder.trace().window(start).steps
        how = f"with {steps} steps" if steps else "without a step"
        print(f"It stands again, {how}." if self.stands() else "It does not stand again.", flush=True)

    def stands(self) -> bool:
        """Return whether the robot stands quietly now."""
        return not self.recorder.fallen and self.recorder.quiet >= QUIET

    def pick(self, execute: Callable[[], SkillResult]) -> None:
        """Let the robot pick once, and judge it."""
        before, start = set(self.in_tray()), self._running.executor.t
        self._timeline = Timeline.of(self._running)
        result = execute()
        seconds = self._running.executor.t - start
        new = sorted(set(self.in_tray()) - before)
        screw, what = None, f"no new screw in the tray; the robot says: {result.reason}"
        if new:
            screw, what = new[0], f"{new[0]} is in the tray after {seconds:.1f} s"
        stages = [(name, round(s, 3)) for name, s in self._timeline.durations(start + seconds)]
        times = round(start, 3), round(seconds, 3)
        self.picks.append(PickRecord(bool(new), screw, result.stage, result.reason, *times, stages))
        print(f"Pick {len(self.picks)}: {what} ({len(self.in_tray())} of {self._config.screws}).", flush=True)

    def tick(self) -> None:
        """Follow balance and stages, and take the report's picture when the first screw comes out."""
        self._show()
        self.recorder(self._running.executor.t, self._pusher.force)
        self._pusher.drive(self._running.executor.t)
        self._timeline.update(self._running)
        stages = self._timeline.stages
        if self.picture is None and stages and stages[-1][0] == "extract":
            if self._running.executor.t - stages[-1][1] > PULLED:
                view = SpectatorView(self._robot, shots(self._robot), PICTURE_SIZE, fancy=self._config.headless)
                self.picture = view.picture("close")
                view.close()

    def write(self, films: list[Path], poster: NDArray[np.uint8] | None = None) -> bool:
        """Write figures and report, and return whether all went well; `poster` stands for the film until it is played.

        All went well if as many screws as asked for are in the tray and the robot never fell, by the simulator's truth,
        and if it stood again after the push at the film's end.
        """
        config, screws = self._config, self.in_tray()
        robot_time, wall = self._running.executor.t, time.perf_counter() - self._started
        tries = f"{len(self.picks)} pick{'' if len(self.picks) == 1 else 's'}"
        standing = self._running.stack.on_ground
        recovered = self._pushed_at is None or self.stands()
        success = len(screws) >= config.screws and not self.recorder.fallen and recovered
        lead = (
            f"{len(screws)} of {config.screws} screws in the tray after {tries}, "
            f"{robot_time:.0f} s of robot time and {wall:.0f} s by the clock."
        )
        if self.recorder.fallen:
            lead += " The robot fell."
        elif not recovered:
            lead += f" A push of {SHOVE.impulse:.0f} N s brought it off balance."
        elif standing:
            lead += " It stood on its own feet from the release of its band on."
        facts = {
            "command": command_line("golem demo", config, always=("stack", "headless", "profile", "seed")),
            "stack": f"{config.stack}, digest {self._running.stack.digest()}",
            "profile": config.profile,
            "seed": str(config.seed),
            "commit": commit(),
            "versions": ", ".join(f"{name} {version}" for name, version in versions().items()),
        }
        balance = balance_figures(self.recorder.trace(), self._pushed_at) if standing else {}
        figures = {
            "success": success,
            "screws_in_tray": screws,
            "asked": config.screws,
            "picks": [asdict(pick) for pick in self.picks],
            "fallen": self.recorder.fallen,
            "balance": balance,
            "robot_time": round(robot_time, 3),
            "wall_time": round(wall, 1),
            **facts,
        }
        report, told = config.out / "report.html", [f"Film:   {film}" for film in films]
        try:
            parts = balance_section(self.recorder.trace(), self._pushed_at, balance) if balance else []
            names = [film.name for film in films]
            write_file(report, demo_page(lead, self.picks, self.picture, names, poster, facts, parts))
            told.append(f"Report: {report}")
        except MissingExtra as missing:
            print(f"No report was written: {missing}", flush=True)
        write_file(config.out / "demo.json", json.dumps(figures, indent=2) + "\n")
        print(f"{'Done' if success else 'Failed'}: {lead}", *told, sep="\n", flush=True)
        return success


def run_demo(config: DemoConfig) -> bool:
    """Run the demonstration, print what happens, and write film, report and figures to `config.out`.

    Returns:
        Whether all went well; see `Demo.write`.

    Raises:
        ConfigError: an option is wrong.
        OutputError: the folder cannot be written.
        ModuleFault: a module broke its contract.
    """
    if config.screws < 1:
        raise ConfigError(f"--screws is {config.screws}; give a number from 1 on.")
    make_folder(config.out)
    drawn = secrets.randbelow(1_000_000) if config.layout == "varied" else 0
    seed = drawn if config.seed is None else config.seed
    config = replace(config, seed=seed)
    running, built = build(work_place(config), seed)
    with ExitStack() as stack:
        stack.callback(built.close)
        robot = shown(running, built)
        loose = len(robot.scene.names.screws)
        if not loose:
            raise ConfigError(f"The world of the stack '{config.stack}' has no screws; give one with 'world: pack'.")
        if config.screws > loose:
            raise ConfigError(f"--screws is {config.screws}, but only {loose} screws are loosened; give 1 to {loose}.")
        print(
            f"The robot {'stands on its own feet' if running.stack.on_ground else 'hangs from a hoist'} in front of "
            f"a battery pack with {loose} loosened screws in reach.\n"
            f"It is to find {config.screws} of them by its cameras, pull them out and drop them in the tray "
            f"(profile {config.profile}, seed {config.seed}).",
            flush=True,
        )
        demo = Demo(config, running, robot, stack.enter_context(on_air(running, robot, config.record)))
        if config.headless:
            return _filmed(config, demo, running, robot)
        view = LiveView(running, robot, config.port)
        stack.callback(view.close)
        return _shown(config, demo, running, view)


def work_place(config: DemoConfig) -> Stack:
    """Return the stack, with its pack as the seed draws it."""
    stack = load_stack(config.stack, profile=config.profile)
    world = stack.choice("robot").options.get("world", "pack")
    if config.layout == "nominal" or world not in WORKSHOPS:
        return stack
    return stack.with_options("robot", layout=config.layout, conditions=dict(SHOWN))


def _goal(config: DemoConfig) -> PickGoal:
    """Return what to pick: with either hand where the tray is on either side."""
    return PickGoal(side="either" if config.layout == "varied" else "right")


def _filmed(config: DemoConfig, demo: Demo, running: LockstepRunner, robot: MujocoRobot) -> bool:
    """Demonstrate into a film, as fast as the machine can."""
    with closing(Film(robot, fps=FPS, recorder=demo.recorder if running.stack.on_ground else None)) as film:
        watch = Narrator(running, demo.tick, lambda: film.tick(running))
        while not demo.over():
            film.headline = f"{len(demo.in_tray())} of {config.screws} screws in the tray"
            demo.pick(lambda: running.execute("pick", _goal(config), watch=watch))
        film.headline = f"{len(demo.in_tray())} of {config.screws} screws in the tray"
        film.frame(running)
        if running.stack.on_ground and not demo.lost():
            film.headline = f"A push of {SHOVE.impulse:.0f} N s"
            demo.push(watch)
        print(f"Writing the film ({len(film)} pictures): a minute or two.", flush=True)
        return demo.write(film.save(config.out / "demo.webp"), film.picture(len(film) // 3))


def _shown(config: DemoConfig, demo: Demo, running: LockstepRunner, view: LiveView) -> bool:
    """Demonstrate in real time in the browser; afterwards the operator may go on until Ctrl-C."""
    print(f"Watch it at {view.url} (it should open by itself).", flush=True)
    webbrowser.open(view.url)
    watch = Narrator(running, demo.tick)
    view.await_spectator()
    while not demo.over():
        demo.pick(lambda: view.run("pick", _goal(config), watch=watch))
    result = demo.write([])
    print("The view stays open: its buttons start further skills. Ctrl-C ends it.", flush=True)
    try:
        while True:
            asked = view.wait_for_skill()
            if asked is not None:
                print(view.run(*asked, watch=watch).reason, flush=True)
    except KeyboardInterrupt:
        print()
    return result
