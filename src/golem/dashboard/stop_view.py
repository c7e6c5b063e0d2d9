"""A stop of the safety gate, looked at afterwards: its black box in a view, opened at the moment of the fault."""

from __future__ import annotations

import io
import threading
from collections.abc import Sequence
from contextlib import closing, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from tyro.conf import Positional

from golem.dashboard.server import Stage, serve
from golem.errors import ConfigError
from golem.hardware.safety.base import SafetyLimits
from golem.hardware.safety.monitor import at_rest
from golem.interfaces.payloads import GateStatus
from golem.interfaces.ros_convert import to_gate_status
from golem.middleware.bags.reader import Bag
from golem.middleware.interrupt import interrupted
from golem.middleware.ros import codec
from golem.middleware.ros.msgs.golem_interfaces import SafetyStatus
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


@dataclass(frozen=True)
class StopViewConfig:
    """Show the black box of a stop, at the moment of the fault."""

    folder: Positional[Path]
    """The black box: a folder in runs/stops."""
    port: int = 8080
    """Port to listen on, on this machine only."""


def run_stop_view(config: StopViewConfig) -> None:
    """Show it until Ctrl-C. Raises BagError: no black box, or a damaged one; ConfigError: no stop, or port taken."""
    with closing(StopView(read_stop(config.folder), config.port)) as view, interrupted() as ended:
        print(f"{view.stop.status.why}: {view.url} shows it. Ctrl-C ends it.", flush=True)
        view.run(ended)


@dataclass(frozen=True)
class Stop:
    """What a black box holds.

    Attributes:
        status: the verdict that stopped the robot.
        times: (n,) when each state came, from the stop on [s].
        commands: what the motors had been told last, or None.
    """

    status: GateStatus
    times: Array
    states: Sequence[LowState]
    commands: Sequence[LowCommand | None]

    def at(self, t: float) -> int:
        """Return which state was the newest `t` after the stop [s]."""
        return max(0, int(np.searchsorted(self.times, t, side="right")) - 1)


def read_stop(path: Path) -> Stop:
    """Read the black box at `path`. Frames that nobody could read are left out.

    Raises:
        BagError: there is none, or it is damaged.
        ConfigError: it holds no stop, or no state.
    """
    stop: tuple[float, GateStatus] | None = None
    times, states, commands = list[float](), list[LowState](), list[LowCommand | None]()
    told: LowCommand | None = None
    machine = 0
    for message in Bag(path).messages(("/lowstate", "/lowcmd", "/safety/status")):
        t = message.log_time * 1e-9
        try:
            if message.topic.name == "/lowstate":
                machine = convert.mode_machine(message.payload)
                states.append(convert.decode_low_state(message.payload))
                times.append(t)
                commands.append(told)
            elif message.topic.name == "/lowcmd":
                told = convert.decode_low_command(message.payload, t, machine)
            elif stop is None:
                status = to_gate_status(codec.deserialize(message.payload, SafetyStatus))
                stop = (t, status) if status.stopped else None
        except WireError:
            continue
    if stop is None or not states:
        raise ConfigError(f"'{path}' is no black box of a stop; the safety process writes them into runs/stops.")
    return Stop(stop[1], np.array(times) - stop[0], states, commands)


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


class StopView:
    """Shows one stop; a slider moves through the seconds around it."""

    def __init__(self, stop: Stop, port: int) -> None:
        """Start serving on this machine, at the moment of the stop. Raises ConfigError: the address cannot be had."""
        self.stop, self._limits = stop, SafetyLimits.from_profile()
        robot = build_robot(load_stack("stand").with_options("robot", world="open"), 0)
        assert isinstance(robot, MujocoRobot)
        self._robot = robot
        model = robot.scene.model
        self._joints = np.array([model.joint(name).qposadr[0] for name in JOINT_NAMES])
        self._torso = JOINT_NAMES.index("torso_joint")
        self._server = serve("127.0.0.1", port)
        self.url = f"http://127.0.0.1:{self._server.get_port()}"
        gui = self._server.gui
        gui.add_markdown(f"**{stop.status.state}**: {stop.status.why}")
        first, last = float(stop.times[0]), float(stop.times[-1])
        self._time = gui.add_slider(
            "from the stop [s]", first, max(last, first + 0.002), 0.002, min(max(first, 0.0), last)
        )
        self._table = gui.add_markdown("")
        self._shown: float | None = None
        self._place(self.stop.states[self.stop.at(self._time.value)])
        self._stage = Stage(self._server, SpectatorView(robot), standing=True)

    def update(self) -> None:
        """Show the moment at which the slider stands."""
        t = float(self._time.value)
        if t == self._shown:
            return
        self._shown = t
        i = self.stop.at(t)
        self._place(self.stop.states[i])
        self._table.content = nearest(self.stop.states[i], self.stop.commands[i], self._limits)
        self._stage.show(1.0, None)

    def run(self, ended: threading.Event) -> None:
        """Follow the slider until `ended`."""
        while not ended.wait(FRAME):
            self.update()

    def close(self) -> None:
        """Stop serving."""
        with redirect_stdout(io.StringIO()):
            self._server.stop()
        self._robot.close()

    def _place(self, state: LowState) -> None:
        """Pose the robot as measured, with its lower ankle over the ground: where it was the bag does not say."""
        data, model = self._robot.data, self._robot.scene.model
        data.qpos[self._joints] = state.q
        half = -0.5 * state.q[self._torso]  # from the torso, which has the IMU, to the pelvis
        mujoco.mju_mulQuat(data.qpos[3:7], state.imu.quat, np.array([np.cos(half), 0.0, 0.0, np.sin(half)]))
        mujoco.mj_kinematics(model, data)
        ankles = [data.body(f"{side}_ankle_roll_link").xpos[2] for side in ("left", "right")]
        data.qpos[2] += SOLE - min(ankles)
        mujoco.mj_kinematics(model, data)
