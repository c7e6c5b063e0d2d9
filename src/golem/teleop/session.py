"""`golem teleop STACK`: drive a robot by hand in the browser, in lock-step paced by the wall clock."""

from __future__ import annotations

import webbrowser
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import OmitArgPrefixes, Positional, arg

from golem.dashboard.live import LiveView
from golem.datasets.commands import TASK, PictureOptions
from golem.datasets.episode_writer import DatasetWriter
from golem.datasets.sampling import StackRecorder
from golem.interfaces import topics
from golem.run import no_display, shown
from golem.runtime.lockstep import LockstepRunner, build
from golem.stack import load_stack
from golem.teleop.driving import Driving
from golem.teleop.gizmos import Gizmos
from golem.teleop.page import PilotPage
from golem.teleop.pilot import HandPilot, PilotConfig
from golem.types import SIDES

SHOWN = 0.05
"""Time between two updates of the gizmos [s]."""


@dataclass(frozen=True)
class TeleopConfig:
    """Drive the robot of a stack file by hand: gizmos in the live view, keyboard, gamepad; until Ctrl-C."""

    stack: Annotated[str, Positional, arg(metavar="[STACK]")] = "tether"
    """Path of a stack file, or the name of a shipped one."""
    profile: str | None = None
    """Realism profile: ideal, bench or field; default: the stack file's."""
    seed: int = 0
    """Seed of the episode."""
    port: int = 8080
    """Port of the live view; the pilot's page has the next one."""
    host: str = "127.0.0.1"
    """Address that both listen on; 0.0.0.0 lets other machines in that know the tokens in the printed addresses."""
    dataset: Path | None = None
    """Data set that demonstrations are recorded into, by the buttons of the page."""
    task: str = TASK
    """What is demonstrated, as a sentence."""
    pilot: PilotConfig = field(default_factory=PilotConfig)
    """How strong keys and sticks are."""
    pictures: OmitArgPrefixes[PictureOptions] = field(default_factory=PictureOptions)


class Teleop:
    """One robot that is driven by hand.

    Attributes:
        pilot, driving: who drives, and how.
        page, view: what serves the windows.
    """

    def __init__(self, config: TeleopConfig, running: LockstepRunner, robot: Any) -> None:
        """Serve; errors as for `LiveView`, `PilotPage` and `DatasetWriter`."""
        self._running, self._next, self._config, self._recipe = running, 0.0, config, config.pictures.recipe()
        self.pilot = HandPilot(config.pilot)
        self.driving = Driving(self.pilot)
        self._writer: DatasetWriter | None = None
        self._recorder: StackRecorder | None = None
        self.period = 1.0 / self._recipe.fps
        with ExitStack() as opened:
            self.view = opened.enter_context(LiveView(running, shown(running, robot), config.port, config.host))
            server, seen = self.view.shown
            self._gizmos = Gizmos(server, seen.from_odom, self.pilot, self.driving)
            if config.dataset is not None:
                writer = DatasetWriter(config.dataset, self._recipe, "golem teleop")
                self._writer = opened.enter_context(closing(writer))
                running.executor.add(self)
            port = config.port and config.port + 1
            page = PilotPage(self.pilot, config.host, port, self.view.url, self.status)
            self.page = opened.enter_context(closing(page))
            self._opened = opened.pop_all()

    def status(self) -> dict[str, Any]:
        """Return what the windows are told."""
        gate, writer = self._running.safety, self._writer
        why = "" if gate is None or not gate.stopped else f"The safety gate has stopped the robot: {gate.why}."
        episode = "" if writer is None else "recording" if self._recorder else f"{writer.episodes} episodes"
        return {"refused": self.driving.refused, "gate": why, "episode": episode, "t": self._running.executor.t}

    def step(self, t: float) -> None:
        """Record a frame where somebody asked for it; a node of the executor."""
        if self._recorder is not None:
            self._recorder.step(t)

    def watch(self) -> None:
        """Look after gizmos and orders; after every tick."""
        word, writer, t = self.pilot.take_order(), self._writer, self._running.executor.t
        if word and writer is not None:
            recorder, self._recorder = self._recorder, None
            if word == "keep" and recorder is not None and recorder.begun:
                writer.finish()
            writer.discard()
            if word == "record":
                self._recorder = StackRecorder(writer, self._recipe, self._running.bus, self._config.task)
        if t >= self._next and self._running.bus.latest(topics.LOW_STATE) is not None:
            self._next = t + SHOWN
            self._gizmos.show({side: self._running.commanded(side) for side in SIDES})

    def run(self) -> None:
        """Let the pilot drive; after a stop of the gate, until it lets commands through again, nobody does."""
        while True:
            self.view.run(self.driving, None, watch=self.watch)
            self.view.idle(lambda: (gate := self._running.safety) is not None and not gate.stopped)

    def close(self) -> None:
        """Stop serving."""
        self._opened.close()


def run_teleop(config: TeleopConfig) -> None:
    """Drive until Ctrl-C; errors as for `Teleop` and `build`."""
    running, robot = build(load_stack(config.stack, profile=config.profile), config.seed)
    with closing(robot), closing(Teleop(config, running, robot)) as teleop:
        print(f"Open {teleop.page.url} to drive. Ctrl-C ends it.", flush=True)
        if not no_display():
            webbrowser.open(teleop.page.url)
        try:
            teleop.run()
        except KeyboardInterrupt:
            print()
