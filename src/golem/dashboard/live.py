"""The live view: the robot in a browser, in real time, with its cameras, its state and the operator's buttons.

A viewer of the simulation, no module of the stack: it sees the simulator's scene through `dashboard.scene`, and acts
on the robot only as an operator does, through the e-stop, requests to the safety gate, and skills.
"""

from __future__ import annotations

import contextlib
import io
import logging
import socket
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import viser
from numpy.typing import NDArray

from golem.dashboard.panel import Button, Panel
from golem.dashboard.scene import SpectatorView
from golem.dashboard.status import Timeline, camera_picture, read_status
from golem.errors import ConfigError
from golem.hardware.safety.base import GateState, Request
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.assembly import Running
from golem.skills.base import Skill, SkillResult
from golem.skills.context import Context
from golem.skills.pick import TIMEOUT

PERIOD = 0.05
"""Time between two updates of the picture [s]."""
CAMERA_PERIOD = 0.2
"""Time between two pictures of the cameras [s]; each is rendered or compressed on the CPU."""
CAMERA_WIDTH = 320
"""Width of these pictures [px]."""
CAMERAS = {"right_hand": "right palm camera", "head": "head camera"}
LAG = 0.25
"""Delay behind the wall clock that is made up for [s]; a machine that is slower falls behind for good."""
PATIENCE = 0.5
"""Time within which the safety gate must have armed after a reset [s]."""
TARGET_COLOUR = (255, 60, 160)


class LiveView:
    """Shows one running stack and drives it in real time, in the calling thread."""

    def __init__(
        self, running: Running, robot: MujocoRobot, port: int = 8080, host: str = "127.0.0.1"
    ) -> None:
        """Start serving.

        Args:
            running: the stack.
            robot: its twin.
            port: TCP port; 0 takes a free one.
            host: address to listen at; the default is reachable from this machine only.

        Raises:
            ConfigError: the port cannot be had.
        """
        self._running = running
        self._view = SpectatorView(robot)
        self._server = _serve(host, port)
        self.url = f"http://{host}:{self._server.get_port()}"
        self._panel = Panel(self._server)
        self._timeline = Timeline()
        self._build_scene(robot)
        self._paused = self._busy = self._wanted = self._asking = False
        self._revive_until: float | None = None
        self._ended = 0.0
        self._note = ""
        self._next_update = 0.0
        self._next_camera = 0.0
        self._origin = time.perf_counter() - running.executor.t
        self._pace: tuple[float, float] = (time.perf_counter(), running.executor.t)
        self._factor = 1.0

    def _build_scene(self, robot: MujocoRobot) -> None:
        scene = self._server.scene
        scene.set_up_direction("+z")
        scene.configure_environment_map("studio", environment_intensity=0.22)
        scene.configure_default_lights(enabled=False)
        scene.add_light_directional("/sun", intensity=1.9, cast_shadow=True, position=(1.6, -1.4, 4.0))
        scene.add_light_directional("/fill", intensity=0.5, position=(2.0, 3.0, 2.0))
        scene.set_background_image(_sky(), format="png")
        camera = self._server.initial_camera
        camera.position, camera.look_at, camera.fov = (2.1, 1.1, 1.95), (0.34, -0.04, 1.12), 0.75
        self._bodies = {
            mesh.name: scene.add_glb(f"/world/{mesh.name}", mesh.glb) for mesh in self._view.meshes()
        }
        self._target = scene.add_icosphere("/target", radius=0.012, color=TARGET_COLOUR, visible=False)
        self._target_label = scene.add_label("/target_label", "target", visible=False)
        self._move_bodies()

    @property
    def panel(self) -> Panel:
        """The panel with the operator's buttons."""
        return self._panel

    def run(
        self,
        skill: Skill[Context, Any],
        goal: object,
        timeout: float = TIMEOUT,
        watch: Callable[[], None] = lambda: None,
    ) -> SkillResult:
        """Run a skill in real time while showing it; see `Running.execute`."""
        self._timeline = Timeline.of(self._running)
        self._busy, self._wanted = True, False

        def both() -> None:
            watch()
            self.tick()

        try:
            return self._running.execute(skill, goal, timeout, watch=both)
        finally:
            self._busy = False
            self._ended = self._running.executor.t
            self.update()

    def await_spectator(self, patience: float = 15.0) -> None:
        """Let time pass until somebody looks, at most `patience` [s] of robot time."""
        end = self._running.executor.t + patience
        self.idle(lambda: bool(self._server.get_clients()) or self._running.executor.t >= end)

    def wait_for_pick(self) -> None:
        """Let time pass until the operator asks for the next pick."""
        self.idle(lambda: self._wanted)
        self._wanted = False

    def idle(self, stop: Callable[[], bool]) -> None:
        """Let time pass without a skill until `stop()` is true."""

        def over() -> bool:
            self.tick()
            return stop()

        self._running.executor.run(float("1e9"), over)

    def tick(self) -> None:
        """Keep pace with the wall clock, and every now and then the picture with the robot; call it every tick."""
        t = self._running.executor.t
        if t >= self._next_update:
            self._next_update = t + PERIOD
            self._serve_buttons()
            self.update()
            while self._paused:
                time.sleep(PERIOD)
                self._serve_buttons()
                self.update()
                self._origin = time.perf_counter() - t
            self._wait(t)

    def _wait(self, t: float) -> None:
        ahead = t + self._origin - time.perf_counter()
        if ahead > 0.0:
            time.sleep(ahead)
        elif ahead < -LAG:
            self._origin += -ahead - LAG

    def update(self) -> None:
        """Show the present moment, if anybody is looking."""
        self._timeline.update(self._running)
        now, t = time.perf_counter(), self._running.executor.t
        if now - self._pace[0] > 2.0:
            self._factor = (t - self._pace[1]) / (now - self._pace[0])
            self._pace = (now, t)
        if not self._server.get_clients():
            return
        status = read_status(self._running)
        with self._server.atomic():
            self._move_bodies()
            target = self._timeline.target if self._busy else None
            self._target.visible = self._target_label.visible = target is not None
            if target is not None:
                self._target.position = self._target_label.position = self._view.from_odom(target)
        self._panel.show_status(
            status,
            self._timeline.durations(t if self._busy else self._ended),
            self._factor,
            self._note,
            pressed=self._running.estop.pressed,
            paused=self._paused,
            busy=self._busy,
        )
        if now >= self._next_camera:
            self._next_camera = now + CAMERA_PERIOD
            for camera, label in CAMERAS.items():
                picture = camera_picture(self._running, self._view, camera)
                height = round(CAMERA_WIDTH * picture.shape[0] / picture.shape[1])
                picture = cv2.resize(picture, (CAMERA_WIDTH, height), interpolation=cv2.INTER_LINEAR)
                self._panel.show_camera(label, np.asarray(picture, dtype=np.uint8))

    def _move_bodies(self) -> None:
        for name, position, wxyz in zip(self._view.moving, *self._view.poses(), strict=True):
            handle = self._bodies[name]
            handle.position, handle.wxyz = position, wxyz

    def _serve_buttons(self) -> None:
        """Do what was asked for. The safety gate has the last word on all that moves the robot."""
        for button in self._panel.pressed():
            self._note = ""
            if button is Button.PRESS:
                self._running.estop.press()
            elif button is Button.RELEASE:
                self._running.estop.release()
            elif button is Button.REVIVE:
                self._revive_until = self._running.executor.t + PATIENCE
            elif button is Button.PICK:
                self._wanted = not self._busy
            else:
                self._paused = not self._paused
        self._revive()

    def _revive(self) -> None:
        """Reset the gate, and activate it as soon as that has armed it."""
        gate, t = self._running.safety, self._running.executor.t
        if self._revive_until is None or gate is None:
            return
        if gate.state is GateState.ARMED:
            self._running.request(Request.ACTIVATE)
            self._revive_until = None
        elif t > self._revive_until:
            self._note = f"The safety gate refuses the reset: {gate.reason}."
            self._revive_until = None
        else:
            # Only the change to a request counts; asked again, because a released button is seen a frame later.
            self._running.request(Request.NONE if self._asking else Request.RESET)
            self._asking = not self._asking

    def close(self) -> None:
        """Stop serving."""
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()
        self._view.close()

    def __enter__(self) -> LiveView:
        """Return the view itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stop serving."""
        self.close()


def _serve(host: str, port: int) -> viser.ViserServer:
    """Start a server at exactly the port that was asked for: viser would silently take the next free one."""
    try:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
            port = probe.getsockname()[1]
    except (OSError, OverflowError) as error:
        raise ConfigError(
            f"Cannot serve the live view at {host}:{port} ({error}); choose another --port."
        ) from error
    logging.getLogger("websockets").setLevel(logging.ERROR)
    with contextlib.redirect_stdout(io.StringIO()):  # its banner; our callers say where to look
        return viser.ViserServer(host=host, port=port, verbose=False)


def _sky() -> NDArray[np.uint8]:
    """Return a background that is light above and darker at the horizon."""
    rows = np.linspace(0.0, 1.0, 256)[:, None, None]
    colours = (1.0 - rows) * np.array([236.0, 241.0, 247.0]) + rows * np.array([150.0, 162.0, 178.0])
    return np.broadcast_to(colours, (256, 4, 3)).astype(np.uint8)
