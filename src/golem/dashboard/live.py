"""The live view: the robot in a browser, in real time, with its cameras, its state and the operator's buttons.

A viewer of the simulation, no module of the stack: it sees the simulator's scene through `dashboard.server`. On the
robot it acts as an operator does, through the e-stop, requests to the safety gate, twists and skills; and as the world
does, with a push.
"""

from __future__ import annotations

import contextlib
import io
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from golem.dashboard.film import LiveFilm
from golem.dashboard.history import History, Snapshot, read_signals
from golem.dashboard.panel import Button, Panel
from golem.dashboard.server import Stage, serve
from golem.dashboard.status import SPAN, Timeline, balance_chart, camera_picture, clouds, map_view, read_status
from golem.errors import GolemError
from golem.hardware.safety.base import OperatorRequest
from golem.interfaces import topics
from golem.interfaces.payloads import GateState
from golem.middleware.web_gate import TokenGate, is_loopback
from golem.robots.model.table import BASE_LINK
from golem.robots.mujoco.balance import BalanceRecorder
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.shoves import Pusher
from golem.robots.mujoco.spectator import SpectatorView
from golem.runtime.executor import FOREVER
from golem.runtime.lockstep import LockstepRunner
from golem.skills.base import Routine, SkillResult
from golem.skills.context import Context
from golem.types import SIDES, TICK, UPPER, Array, Twist

if TYPE_CHECKING:
    import viser

PERIOD = 0.05
"""Time between two updates of the picture [s]."""
CAMERA_PERIOD = 0.2
"""Time between two pictures of the cameras [s]; each is rendered or compressed on the CPU."""
CHART_PERIOD = 0.5
"""Time between two charts and maps, which are drawn on the CPU [s]."""
STILL = 0.002
"""While nothing moves by more [m], pictures of the cameras are made once in `RESTING` [s]."""
RESTING = 1.0
CAMERA_WIDTH = 320
"""Width of these pictures [px]."""
CAMERAS = {"right_hand": "right palm camera", "head": "head camera"}
LAG = 0.25
"""Delay behind the wall clock that is made up for [s]; a machine that is slower falls behind for good."""
PATIENCE = 2.5
"""Time for which the safety gate is asked for a reset [s]: it waits for a second since the stop, and for rest."""
CHART = (CAMERA_WIDTH, 84)
"""Size of the chart of the CoM margin [px]."""
ARRIVAL = 15.0
"""Time that is waited for somebody to look [s]."""
SHOWN = 0.6
"""Time for which the arrow of a push is shown at least [s]: the push itself is over in the blink of an eye."""


class LiveView(AbstractContextManager["LiveView", None]):
    """Shows one running stack and drives it in real time, in the calling thread.

    Attributes:
        period: as of a node that looks on, see `golem.runtime.executor.Node`.
        panel: with the operator's buttons.
        decide: called when the operator has allowed or denied what the panel asks.
    """

    period = TICK

    def __init__(
        self,
        running: LockstepRunner,
        robot: MujocoRobot,
        port: int = 8080,
        host: str = "127.0.0.1",
        *,
        restarts: bool = False,
        passive: bool = False,
    ) -> None:
        """Start serving. Raises ConfigError: the port cannot be had.

        Args:
            port: TCP port; 0 takes a free one.
            host: address to listen at; the default is reachable from this machine only, any other asks for a token.
            restarts: whether there is a button to start over, which makes `operate` return.
            passive: whether somebody else drives the robot, and this shows every tick of it.
        """
        local = is_loopback(host)
        self._server = serve(host, port) if local else serve("127.0.0.1", 0)
        inside = self._server.get_port()
        self._gate = None if local else TokenGate(host, port, inside)
        self.url = f"http://{host}:{inside}"
        if self._gate is not None:
            self.url = f"http://{host}:{self._gate.port}/?token={self._gate.token}"
        standing = running.stack.on_ground
        first = "pick" if robot.scene.names.screws else "walk"
        self._skills = running.skills
        self._view = SpectatorView(robot)
        self.panel = Panel(
            self._server, self._view.from_odom, self._skills.specs, first, standing=standing, restarts=restarts
        )
        self._stage = Stage(self._server, self._view, standing=standing)
        self._paused = self._busy = self._restart = False
        self._wanted: tuple[str | Routine[Context, Any], Any] | None = None
        self._note = ""
        self._film = LiveFilm()
        self.decide: Callable[[bool], None] = lambda yes: None
        self._next_camera = self._next_chart = self._pictured = 0.0
        self._positions: Array | None = None
        self._factor = 1.0
        self._watch(running, robot)
        if passive:
            self._busy = True
            self.panel.skill.hide()
            print(f"Live view: {self.url}   (Ctrl-C ends it)", flush=True)
            end = time.monotonic() + ARRIVAL
            while not self._server.get_clients() and time.monotonic() < end:
                time.sleep(PERIOD)
            running.executor.add(self)

    def step(self, t: float) -> None:
        """Show the tick at time `t` [s]."""
        self.tick()

    def attach(self, running: LockstepRunner, robot: MujocoRobot) -> None:
        """Show another episode of the same stack and seed from now on."""
        self._view.close()
        self._view = SpectatorView(robot)
        self._stage.look(self._view)
        self._watch(running, robot)

    def _watch(self, running: LockstepRunner, robot: MujocoRobot) -> None:
        self._running, self._robot = running, robot
        self._recorder = BalanceRecorder(robot, memory=SPAN)
        self._recorder(running.executor.t)
        self._pusher = Pusher(robot)
        self._pushed: float | None = None
        self._timeline = Timeline()
        self._revive_until: float | None = None
        self._asking = False
        self._ended = self._next_update = self._shown = 0.0
        self._note = ""
        self._history = History()
        self._speed, self._start = 1.0, (time.perf_counter(), running.executor.t)
        self._pace: tuple[float, float] = (time.perf_counter(), running.executor.t)

    @property
    def shown(self) -> tuple[viser.ViserServer, SpectatorView]:
        """The server, and what it shows: for who adds to the scene."""
        return self._server, self._view

    def run(
        self, skill: str | Routine[Context, Any], goal: object, watch: Callable[[], None] = lambda: None
    ) -> SkillResult:
        """Run a skill of the stack in real time while showing it; see `LockstepRunner.execute`."""
        self._timeline = Timeline.of(self._running)
        self._busy, self._wanted = True, None

        def both() -> None:
            watch()
            self.tick()

        try:
            result = self._running.execute(skill, goal, watch=both)
            self._note = result.reason
            return result
        finally:
            self._busy = False
            self._ended = self._running.executor.t
            self.update()

    def await_spectator(self, patience: float = ARRIVAL) -> None:
        """Let time pass until somebody looks, at most `patience` [s] of robot time."""
        end = self._running.executor.t + patience
        self.idle(lambda: bool(self._server.get_clients()) or self._running.executor.t >= end)

    def wait_for_skill(self) -> tuple[str | Routine[Context, Any], Any] | None:
        """Let time pass until the operator starts a skill or moves the arms; return it and its goal, or None."""
        self.idle(lambda: self._wanted is not None or self._restart)
        wanted, self._wanted = self._wanted, None
        self._restart = False
        return wanted

    def idle(self, stop: Callable[[], bool]) -> None:
        """Let time pass without a skill until `stop()` is true."""

        def over() -> bool:
            self.tick()
            return stop()

        self._running.executor.run(FOREVER, over)

    def tick(self) -> None:
        """Keep pace with the wall clock, and every now and then the picture with the robot; call it every tick."""
        t = self._running.executor.t
        acting = self._robot.pushed
        self._recorder(t, None if acting is None else acting[1])
        self._pusher.drive(t)
        if t >= self._next_update:
            self._next_update = t + PERIOD
            self._serve_buttons()
            self._drive(t)
            self.update()
            while self._paused:
                time.sleep(PERIOD)
                self._serve_buttons()
                self.update()
                self._start = (time.perf_counter(), t)
            self._wait(t)

    def _wait(self, t: float) -> None:
        """Let wall time pass until it is as late as robot time at the speed that is asked for."""
        now, speed = time.perf_counter(), self.panel.view.speed
        if speed != self._speed:
            self._speed, self._start = speed, (now, t)
        ahead = self._start[0] + (t - self._start[1]) / speed - now
        if ahead > 0.0:
            time.sleep(ahead)
        elif ahead < -LAG:
            self._start = (now - LAG, t)

    def update(self) -> None:
        """Show the present moment, if anybody is looking."""
        self._timeline.update(self._running)
        now, t = time.perf_counter(), self._running.executor.t
        signals = read_signals(self._running.bus, float(self._recorder.trace(last=PERIOD).margin[-1]))
        newest = Snapshot(t, *self._view.poses(), signals)
        self._history.add(newest)
        self._note = self._film.tick(self._running) or self._note
        if now - self._pace[0] > 2.0:
            self._factor = (t - self._pace[1]) / (now - self._pace[0])
            self._pace = (now, t)
        if not self._server.get_clients():
            return
        if self._recorder.fallen and not self._note:
            self._note = "The robot fell, by the simulator's truth."
        status, shown = read_status(self._running), self.panel.view
        moment = self._history.before(shown.age)
        assert moment is not None
        target, poses = self._timeline.target if self._busy else None, (moment.positions, moment.orientations)
        with self._server.atomic():
            self._stage.show(t - self._shown, target, poses, follow=shown.follows)
            self._show_push(t)
        self._shown = t
        stages, pressed = self._timeline.durations(t if self._busy else self._ended), self._running.estop.pressed
        self.panel.show_status(
            status, stages, self._factor, self._note, pressed=pressed, paused=self._paused, busy=self._busy
        )
        if now >= self._next_camera:
            self._next_camera = now + CAMERA_PERIOD
            self._show_layers()
            if self._moved(newest.positions) or now >= self._pictured + RESTING:
                self._pictured, self._positions = now, newest.positions
                self._show_pictures()
        if now >= self._next_chart:
            self._next_chart = now + CHART_PERIOD
            self._show_charts()

    def _moved(self, positions: Array) -> bool:
        """Return whether anything is elsewhere than in the newest pictures; `positions` (n, 3) [m]."""
        old = self._positions
        return old is None or old.shape != positions.shape or bool(np.abs(positions - old).max() > STILL)

    def _show_layers(self) -> None:
        bus, view = self._running.bus, self.panel.view
        self._stage.show_layers(view.layers, clouds(bus) if "clouds" in view.layers else ())
        state = bus.latest(topics.LOW_STATE)
        if state is not None:
            self.panel.arms.show(state.q[UPPER], {side: self._running.commanded(side) for side in SIDES})

    def _show_charts(self) -> None:
        self.panel.view.plot(self._history)
        if self.panel.legs is not None:
            chart = balance_chart(self._recorder.trace(), CHART)
            if chart is not None:
                self.panel.show_picture("balance", chart)
        floor = map_view(self._running.bus)
        if floor is not None:
            self.panel.show_picture("map", floor)
        pack = self._running.bus.latest(topics.PACK_PLAN)
        if pack is not None:
            self.panel.show_picture("pack", pack.rgb)

    def _show_pictures(self) -> None:
        for camera, label in CAMERAS.items():
            picture = camera_picture(self._running, self._view, camera)
            height = round(CAMERA_WIDTH * picture.shape[0] / picture.shape[1])
            picture = cv2.resize(picture, (CAMERA_WIDTH, height), interpolation=cv2.INTER_LINEAR)
            self.panel.show_picture(label, np.asarray(picture, dtype=np.uint8))

    def _show_push(self, t: float) -> None:
        """Show the push of whoever pushes, its arrow for `SHOWN` at least."""
        acting = self._robot.pushed
        if acting is not None:
            self._pushed = t if self._pushed is None else self._pushed
            self._stage.show_push(acting[1], acting[0])
        elif self._pushed is not None and t > self._pushed + SHOWN:
            self._pushed = None
            self._stage.show_push(np.zeros(3), BASE_LINK)

    def _drive(self, t: float) -> None:
        """Say what the sliders say, as long as somebody holds them: else they go back to zero, and the robot stands."""
        legs, gate = self.panel.legs, self._running.safety
        if legs is None:
            return
        legs.limit(self._running.envelope)
        active = gate is not None and gate.state is GateState.ACTIVE
        if self._busy or not active or not self._server.get_clients():
            legs.twist = Twist()
        if not self._busy:
            self._running.bus.publish(topics.TWIST, legs.twist, t)

    def _serve_buttons(self) -> None:
        """Do what was asked for. The safety gate has the last word on all that moves the robot."""
        for button in self.panel.pressed():
            self._note = ""
            if button is Button.PRESS:
                self._running.estop.press()
            elif button is Button.RELEASE:
                self._running.estop.release()
            elif button is Button.REVIVE:
                self._revive_until = self._running.executor.t + PATIENCE
            elif button is Button.START:
                self._ask()
            elif button is Button.CANCEL:
                self._running.cancel()
            elif button in (Button.ALLOW, Button.DENY):
                self.decide(button is Button.ALLOW)
            elif button is Button.MOVE:
                self._move()
            elif button is Button.RECORD:
                self.panel.view.recording(self._film.toggle(self._robot, self._recorder))
            elif button is Button.RESTART:
                self._restart = not self._busy
            elif button is Button.STAND and self.panel.legs is not None:
                self.panel.legs.twist = Twist()
            elif button is Button.PUSH and self.panel.legs is not None:
                self._pusher.begin(self.panel.legs.push, self._running.executor.t, self._recorder.yaw)
            else:
                self._paused = not self._paused
        self._revive()

    def _ask(self) -> None:
        """Take up the skill and the goal that the panel shows, unless a skill runs or they make no sense."""
        name, fields = self.panel.skill.chosen
        try:
            self._wanted = None if self._running.busy else (name, self._skills.goal(name, fields))
        except GolemError as error:
            self._note = str(error)

    def _move(self) -> None:
        """Take up what sliders or gizmos of the arms say."""
        arms = self.panel.arms
        self._note = "" if arms.chosen else "Turn a slider or drag a gizmo first."
        if arms.chosen and not self._running.busy:
            self._wanted = arms.chosen, None
            arms.forget()

    def _revive(self) -> None:
        """Reset the gate, and activate it as soon as that has armed it, or taken the reason from legs that stand."""
        gate, t = self._running.safety, self._running.executor.t
        if self._revive_until is None or gate is None:
            return
        if gate.state is GateState.ARMED or (gate.state is GateState.STOP2 and gate.reason is None):
            self._running.request(OperatorRequest.ACTIVATE)
            self._revive_until = None
        elif t > self._revive_until:
            self._note = f"The safety gate refuses the reset ({gate.reason}): it needs no fault, and a robot at rest."
            self._revive_until = None
        else:
            # Only the change to a request counts; asked again, because a released button is seen a frame later.
            self._running.request(OperatorRequest.NONE if self._asking else OperatorRequest.RESET)
            self._asking = not self._asking

    def close(self) -> None:
        """Stop serving."""
        if self._gate is not None:
            self._gate.close()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()
        self._view.close()

    def __exit__(self, *_: object) -> None:
        self.close()
