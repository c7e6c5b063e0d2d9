"""A bag, looked at afterwards: the robot, its pictures and joints at any moment; a black box opens at its stop."""

from __future__ import annotations

import io
import threading
from collections.abc import Sequence
from contextlib import closing, redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from tyro.conf import Positional

from golem.dashboard.history import QUANTITIES
from golem.dashboard.server import Stage, serve
from golem.dashboard.view_panel import add_plot
from golem.errors import ConfigError
from golem.hardware.safety.base import SafetyLimits
from golem.hardware.safety.monitor import at_rest
from golem.interfaces import images, public
from golem.interfaces.payloads import GateStatus
from golem.interfaces.ros_convert import matrix, to_gate_status
from golem.middleware.bags.reader import Bag
from golem.middleware.bags.writer import JUMP
from golem.middleware.interrupt import interrupted
from golem.middleware.ros import codec
from golem.middleware.ros.message import NANO, CodecError
from golem.middleware.ros.msgs.golem_interfaces import SafetyStatus
from golem.middleware.ros.msgs.nav_msgs import Odometry
from golem.middleware.ros.msgs.sensor_msgs import Image
from golem.middleware.wire import convert
from golem.middleware.wire.struct_layout import WireError
from golem.robots.model.table import JOINT_NAMES
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.spectator import SpectatorView
from golem.runtime.lockstep import build_robot
from golem.stack import load_stack
from golem.types import Array, LowCommand, LowState

SOLE = 0.06
"""Height of an ankle over the ground it stands on [m]."""
ROWS = 6
"""Joints that are shown: those that are nearest to one of their limits."""
FRAME = 0.05
"""Time between two looks at the slider [s]."""
DENSE, SPARSE = 5.0, 0.02
"""Time around a stop in which every state is kept, and time between those that are kept elsewhere [s]."""
FRESH = 0.5
"""Age up to which a picture belongs to a moment [s]."""
PLOTTED = 10.0
"""Time that is plotted before and after a moment [s]."""
UNREADABLE = (CodecError, WireError)
"""What is raised of a frame that nobody can read."""
CAMERAS = {public.image(camera, public.COLOR): camera.replace("_", " ") for camera in public.CAMERAS}


@dataclass(frozen=True)
class BagViewConfig:
    """Show a bag in the browser, at any moment of it; a black box opens at its stop."""

    bag: Positional[Path]
    """A folder or an MCAP file, e.g. a black box in runs/stops."""
    port: int = 8080
    """Port to listen on, on this machine only."""


def run_bag_view(config: BagViewConfig) -> None:
    """Show it until Ctrl-C. Raises BagError: no bag, or a damaged one; ConfigError: no states, or port taken."""
    with closing(BagView(read_recording(config.bag), config.port)) as view, interrupted() as ended:
        stop = view.recording.stop
        print(f"{stop.why if stop else config.bag}: {view.url} shows it. Ctrl-C ends it.", flush=True)
        view.run(ended)


@dataclass(frozen=True)
class Recording:
    """What a bag holds of a robot.

    Attributes:
        stop: the verdict that stopped the robot first; None if nothing did.
        zero: log time of the stop, or of the first state [ns].
        times: (n,) when each state came, from then on [s].
        commands: what the motors had been told last, or None.
        bases: pose of base_link in odom, (4, 4), as known last, or None.
        gates: what the safety gate had said last, or None.
    """

    bag: Bag
    stop: GateStatus | None
    zero: int
    times: Array
    states: Sequence[LowState]
    commands: Sequence[LowCommand | None]
    bases: Sequence[Array | None]
    gates: Sequence[GateStatus | None]

    def at(self, t: float) -> int:
        """Return which state was the newest at `t` [s]."""
        return max(0, int(np.searchsorted(self.times, t, side="right")) - 1)

    def picture(self, topic: str, t: float) -> NDArray[np.uint8] | None:
        """Return (height, width, 3) RGB, the newest image of a topic at `t` [s]; None if there is none of then."""
        until = self.zero + round(t * 1e9)
        seen = [m.payload for m in self.bag.messages((topic,), until - round(FRESH * 1e9), until + 1)]
        for payload in reversed(seen):
            with suppress(*UNREADABLE):
                return images.to_rgb(codec.deserialize(payload, Image))
        return None


def read_recording(path: Path) -> Recording:
    """Read the states of the bag at `path`. Frames that nobody could read are left out.

    Of a robot that was restarted meanwhile they are those since its last start, or of the start that its stop ended.

    Raises:
        BagError: there is none, or it is damaged.
        ConfigError: it holds no state of a robot.
    """
    bag = Bag(path)
    stop, zero = _first_stop(bag)
    rows = list[tuple[float, LowState, LowCommand | None, Array | None, GateStatus | None]]()
    told: LowCommand | None = None
    base: Array | None = None
    gate: GateStatus | None = None
    machine, stopped = 0, False
    for message in bag.messages(("/lowstate", "/lowcmd", "/odom", "/safety/status")):
        t = (message.log_time - zero) * 1e-9
        if rows and t < rows[-1][0] - JUMP / NANO:
            if stopped:
                break
            rows, told, base, gate = [], None, None, None
        try:
            if message.topic.name == "/odom":
                base = matrix(codec.deserialize(message.payload, Odometry).pose.pose)
            elif message.topic.name == "/safety/status":
                gate = to_gate_status(codec.deserialize(message.payload, SafetyStatus))
                stopped = stopped or gate.stopped
            elif message.topic.name == "/lowcmd":
                told = convert.decode_low_command(message.payload, t, machine)
            elif not rows or t - rows[-1][0] > 0.95 * SPARSE or (stop is not None and abs(t) < DENSE):
                machine = convert.mode_machine(message.payload)
                rows.append((t, convert.decode_low_state(message.payload), told, base, gate))
        except UNREADABLE:
            continue
    if not rows:
        raise ConfigError(f"'{path}' holds no /lowstate: no robot can be shown. `golem replay` plays other topics.")
    times, states, commands, bases, gates = zip(*rows, strict=True)
    start = 0.0 if stop is not None else times[0]
    return Recording(bag, stop, zero + round(start * 1e9), np.array(times) - start, states, commands, bases, gates)


def _first_stop(bag: Bag) -> tuple[GateStatus | None, int]:
    """Return the first verdict that stopped the robot, and its log time [ns], or 0."""
    for message in bag.messages(("/safety/status",)):
        try:
            status = to_gate_status(codec.deserialize(message.payload, SafetyStatus))
        except UNREADABLE:
            continue
        if status.stopped:
            return status, message.log_time
    return None, 0


def nearest(state: LowState, command: LowCommand | None, limits: SafetyLimits) -> str:
    """Return the joints that are nearest to a limit of theirs, as a table in Markdown."""
    rest = at_rest(state.q, state.dq, limits.deceleration)
    reach = limits.state_upper - limits.middle
    shares = np.array(
        (np.abs(rest - limits.middle) / reach, np.abs(state.dq) / limits.velocity, np.abs(state.tau) / limits.torque)
    )
    rows = ["| joint | of | q [rad] | told | dq [rad/s] | tau [N m] |", "|---|---:|---:|---:|---:|---:|"]
    for i in np.argsort(-shares.max(axis=0))[:ROWS]:
        what = ("range", "speed", "torque")[int(np.argmax(shares[:, i]))]
        told = "-" if command is None else f"{command.q[i]:.2f}"
        rows.append(
            f"| {JOINT_NAMES[i].removesuffix('_joint')} | {100 * shares[:, i].max():.0f} % {what} "
            f"| {state.q[i]:.2f} | {told} | {state.dq[i]:.1f} | {state.tau[i]:.0f} |"
        )
    return "\n".join(rows)


class BagView:
    """Shows one recording; a slider moves through it."""

    def __init__(self, recording: Recording, port: int) -> None:
        """Start serving on this machine, at the moment of the stop. Raises ConfigError: the address cannot be had."""
        self.recording, self._limits = recording, SafetyLimits.from_profile()
        robot = build_robot(load_stack("stand").with_options("robot", world="open"), 0)
        assert isinstance(robot, MujocoRobot)
        self._robot = robot
        model = robot.scene.model
        self._joints = np.array([model.joint(name).qposadr[0] for name in JOINT_NAMES])
        self._torso = JOINT_NAMES.index("torso_joint")
        self._server = serve("127.0.0.1", port)
        self.url = f"http://127.0.0.1:{self._server.get_port()}"
        gui, times = self._server.gui, recording.times
        first, last = float(times[0]), float(times[-1])
        since = "from the start [s]" if recording.stop is None else "from the stop [s]"
        step = 0.002 if recording.stop is not None else SPARSE
        self._time = gui.add_slider(since, first, max(last, first + step), step, min(max(first, 0.0), last))
        self._play = gui.add_checkbox("play", False)
        self._gate, self._table = gui.add_markdown(""), gui.add_markdown("")
        joints = [name.removesuffix("_joint") for name in JOINT_NAMES]
        self._joint = gui.add_dropdown("plot", joints, initial_value=joints[0])
        self._quantity = gui.add_dropdown("of it", list(QUANTITIES))
        self._plot = add_plot(gui, "from now [s]", visible=True)
        self._pictures = dict[str, Any]()
        self._shown: tuple[float, str, str] | None = None
        self._place(0)
        self._stage = Stage(self._server, SpectatorView(robot), standing=True)

    def update(self) -> None:
        """Show the moment at which the slider stands."""
        t = float(self._time.value)
        wanted = t, self._joint.value, self._quantity.value
        if wanted == self._shown:
            return
        self._shown, recording = wanted, self.recording
        i = recording.at(t)
        self._place(i)
        gate = recording.gates[i]
        self._gate.content = "" if gate is None else ": ".join(filter(None, (f"**{gate.state}**", gate.why)))
        self._table.content = nearest(recording.states[i], recording.commands[i], self._limits)
        self._show_plot(t)
        self._stage.show(1.0, None)
        for topic in CAMERAS.keys() & recording.bag.topics.keys():
            self._show_picture(topic, t)

    def run(self, ended: threading.Event) -> None:
        """Follow the slider until `ended`, or move it on as time goes by."""
        while not ended.wait(FRAME):
            if self._play.value:
                self._time.value = min(float(self._time.value) + FRAME, float(self.recording.times[-1]))
            self.update()

    def close(self) -> None:
        """Stop serving."""
        with redirect_stdout(io.StringIO()):
            self._server.stop()
        self._robot.close()

    def _show_plot(self, t: float) -> None:
        """Plot what is chosen around `t` [s]."""
        times, states = self.recording.times, self.recording.states
        near = slice(*np.searchsorted(times, (t - PLOTTED, t + PLOTTED)))
        joint, name = JOINT_NAMES.index(f"{self._joint.value}_joint"), QUANTITIES[self._quantity.value]
        self._plot.data = times[near] - t, np.array([getattr(state, name)[joint] for state in states[near]])

    def _show_picture(self, topic: str, t: float) -> None:
        """Show what a camera saw at `t` [s]; before its first picture there is none."""
        picture = self.recording.picture(topic, t)
        if picture is None:
            return
        picture = picture[::2, ::2]
        handle = self._pictures.get(topic)
        if handle is None:
            self._pictures[topic] = self._server.gui.add_image(picture, label=CAMERAS[topic], format="jpeg")
        else:
            handle.image = picture

    def _place(self, i: int) -> None:
        """Pose the robot as measured, its lower ankle over the ground, at its place in odom where that is known."""
        data, model = self._robot.data, self._robot.scene.model
        state, base = self.recording.states[i], self.recording.bases[i]
        data.qpos[self._joints] = state.q
        half = -0.5 * state.q[self._torso]  # from the torso, which has the IMU, to the pelvis
        mujoco.mju_mulQuat(data.qpos[3:7], state.imu.quat, np.array([np.cos(half), 0.0, 0.0, np.sin(half)]))
        if base is not None:
            data.qpos[:2] = base[:2, 3]
            mujoco.mju_mat2Quat(data.qpos[3:7], base[:3, :3].flatten())
        mujoco.mj_kinematics(model, data)
        ankles = [data.body(f"{side}_ankle_roll_link").xpos[2] for side in ("left", "right")]
        data.qpos[2] += SOLE - min(ankles)
        mujoco.mj_kinematics(model, data)
