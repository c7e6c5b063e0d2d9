"""`golem teleop STACK`: drive a robot by hand in the browser, in lock-step paced by the wall clock."""

from __future__ import annotations

import itertools
import json
import threading
import time
import webbrowser
from collections.abc import Callable
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from tyro.conf import OmitArgPrefixes, Positional, arg

from golem.dashboard.live import LiveView
from golem.dashboard.server import WORLD, gizmo_pose, place_gizmo
from golem.datasets.commands import TASK, PictureOptions
from golem.datasets.episode_writer import DatasetWriter
from golem.datasets.sampling import StackRecorder
from golem.errors import ConfigError, needs
from golem.interfaces import topics
from golem.middleware.web_gate import LOCAL, TokenGate, is_loopback
from golem.run import no_display, shown
from golem.runtime.lockstep import LockstepRunner, build
from golem.stack import load_stack
from golem.teleop.driving import Driving
from golem.teleop.pilot import BadMessage, HandPilot, PilotConfig
from golem.types import SIDES, Array, Side

MOST, WINDOWS = 4096, 16
"""Bytes of a message, and windows at once."""


class PilotPage:
    """Serves the page at `url`, and hears its windows."""

    def __init__(self, pilot: HandPilot, host: str, port: int, view: str, status: Callable[[], dict[str, Any]]) -> None:
        """Serve at `host` and `port`, with the live view at `view` in it, and tell windows the `status`.

        Raises:
            ConfigError: the address cannot be had.
            MissingExtra: the extra `view` is not installed.
        """
        with needs("", "view"):
            from websockets.datastructures import Headers
            from websockets.exceptions import ConnectionClosed
            from websockets.http11 import Response
            from websockets.sync.server import serve
        self._pilot, self._status, self._numbers = pilot, status, itertools.count(1)
        self._room, self._gone = threading.BoundedSemaphore(WINDOWS), (ConnectionClosed, OSError)
        body = (files("golem.teleop") / "pilot.html").read_text(encoding="utf-8").replace("%VIEW%", view).encode()
        headers = Headers({"Content-Type": "text/html; charset=utf-8", "Content-Length": str(len(body))})

        def page(connection: Any, request: Any) -> Any:
            asks = request.headers.get("Upgrade", "").lower() == "websocket"
            return None if asks else Response(200, "OK", headers, body)

        local = is_loopback(host)
        try:
            self._server = serve(
                self._serve, host if local else "127.0.0.1", port if local else 0, origins=[LOCAL, None],
                process_request=page, max_size=MOST, compression=None, ping_interval=1.0, ping_timeout=1.0,
            )  # fmt: skip
        except (OSError, OverflowError) as error:
            raise ConfigError(f"Cannot serve the page at {host}:{port} ({error}); choose another port.") from error
        inside = int(self._server.socket.getsockname()[1])
        self._gate = None if local else TokenGate(host, port, inside)
        self.url = f"http://{host}:{inside}/"
        if self._gate is not None:
            self.url = f"http://{host}:{self._gate.port}/?token={self._gate.token}"
        threading.Thread(target=self._server.serve_forever, name="pilot's page", daemon=True).start()

    def _serve(self, connection: Any) -> None:
        if not self._room.acquire(blocking=False):
            connection.close(1013, "There are too many windows.")
            return
        who = f"window {next(self._numbers)}"
        try:
            with suppress(*self._gone):
                while True:
                    raw, error = connection.recv(), ""
                    try:
                        self._pilot.hear(who, json.loads(raw, parse_constant=_no_constant), time.monotonic())
                    except (BadMessage, ValueError, RecursionError) as wrong:
                        self._pilot.leave(who)
                        error = str(wrong) or "That is no JSON."
                    told = {"you": who, "pilot": self._pilot.state, "error": error, **self._status()}
                    connection.send(json.dumps(told))
        finally:
            self._pilot.leave(who)
            self._room.release()

    def close(self) -> None:
        """Stop serving."""
        if self._gate is not None:
            self._gate.close()
        self._server.shutdown()


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is no number.")


if TYPE_CHECKING:
    import viser


class Gizmos:
    """Two gizmos of one server, and what is refused at them."""

    def __init__(
        self, server: viser.ViserServer, from_odom: Callable[[Array], Array], pilot: HandPilot, driving: Driving
    ) -> None:
        """Add them; `from_odom` brings a point (3,) of odom into the world that is shown, whose axes are the same."""
        self._origin, self._pilot, self._driving = from_odom(np.zeros(3)), pilot, driving
        self._held: dict[Side, set[str]] = {side: set() for side in SIDES}
        self._gizmos, self._labels = {}, {}
        for side in SIDES:
            gizmo = server.scene.add_transform_controls(f"{WORLD}/{side}_goal", scale=0.15, visible=False)
            label = server.scene.add_label(f"{WORLD}/{side}_refused", "", visible=False)
            gizmo.on_update(lambda event, side=side: self._drag(event, side))
            self._gizmos[side], self._labels[side] = gizmo, label
        server.on_client_disconnect(lambda client: self._gone(str(client.client_id)))

    def _drag(self, event: Any, side: Side) -> None:
        who, ends = f"view {event.client_id}", event.phase == "end"
        if ends:
            self._held[side].discard(who)
        else:
            self._held[side].add(who)
        goal = None if ends else gizmo_pose(self._gizmos[side], self._origin)
        self._pilot.drag(who, side, goal, time.monotonic())

    def _gone(self, client: str) -> None:
        for held in self._held.values():
            held.discard(f"view {client}")
        self._pilot.leave(f"view {client}")

    def show(self, poses: dict[Side, Array]) -> None:
        """Show the gizmos that nobody drags at `poses` (4, 4) in odom, and what is refused."""
        for side in SIDES:
            gizmo, label, why = self._gizmos[side], self._labels[side], self._driving.refused[side]
            T = poses[side]
            if not self._held[side]:
                place_gizmo(gizmo, T, self._origin)
                gizmo.visible = True
            label.visible = bool(why)
            if why:
                label.text, label.position = why, np.asarray(gizmo.position)


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
    """One robot that is driven by hand."""

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
