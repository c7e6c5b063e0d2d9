"""`golem launch`: starts the processes of a robot, watches over them, and restarts one on request.

It is no part of what keeps the robot safe: a stack that dies is noticed by the safety gate, which damps, and a safety
process that dies by the drives, which go limp. What is done here is to say which of them died, and what became of the
robot.

The motors of a simulated robot whose safety gate was killed are damped from here. A gate that is killed cannot damp,
and drives that hear nothing go limp. On the real robot nobody but the gate writes to the motors: its own controllers,
and the hardware stop, are what is left there.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any, Literal

from golem.errors import ConfigError
from golem.hardware.safety.base import SafetyLimits
from golem.hardware.safety.gate import passive
from golem.interfaces import public
from golem.interfaces.payloads import GateState, GateStatus
from golem.interfaces.ros_convert import to_gate_status
from golem.middleware.dds.base import Participant
from golem.middleware.interrupt import LIFELINE, interrupted
from golem.middleware.ros import names
from golem.middleware.ros.codec import dds_name
from golem.middleware.ros.future import Future
from golem.middleware.ros.msgs.std_srvs import Trigger_Request, Trigger_Response
from golem.middleware.ros.node import RosNode
from golem.middleware.wire.convert import MODE_MACHINE, encode_low_command
from golem.robots.sensors.profiles import load_profile
from golem.runtime.live.exclusive_writers import LAUNCH, refuse_second_launch
from golem.runtime.live.node_setup import log_line, member, until
from golem.runtime.live.process import TwinConfig
from golem.runtime.live.safety_status import describe_status
from golem.runtime.live.sim_sync import SILENCE
from golem.stack import load_stack
from golem.types import TICK


class Damper:
    """Tells the motors to damp, as long as a stop damps, on a thread of its own."""

    def __init__(self, participant: Participant, limits: SafetyLimits) -> None:
        """Write as a member of a domain, once there is a reason to: a second writer stops a gate."""
        self._participant, self._limits = participant, limits
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Damp from now on."""
        self.stop()
        self._stop.clear()
        self._thread = threading.Thread(target=lambda: self.damp(self._stop.wait), name="damper", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Leave the motors to somebody else."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def damp(self, wait: Callable[[float], bool]) -> None:
        """Damp until the motors may go limp, or until `wait`, given the time between two commands [s], says so."""
        row = public.topic("/lowcmd")
        writer = self._participant.writer(names.topic(row.name), dds_name(row.type), row.qos)
        payload = encode_low_command(passive(0.0, None, self._limits.damping), MODE_MACHINE)
        with closing(writer):
            for _ in range(round(self._limits.damping_time / TICK)):
                writer.write(payload)
                if wait(TICK):
                    return


Part = Literal["twin", "safety", "up"]
PARTS: tuple[Part, ...] = ("twin", "safety", "up")
"""In the order they are started; they end in the opposite one, so that the gate outlives what it guards against."""
GRACE = 15.0
"""Time a process gets to end by itself [s]: the gate damps for three, on a busy machine longer."""
PERIOD = 0.05
"""Time between two looks at the processes [s]: half of that after which drives that hear nothing go limp."""


@dataclass(frozen=True)
class LaunchConfig(TwinConfig):
    """Start twin, safety and up for a stack file, open the gate, and supervise them until Ctrl-C."""

    strict: bool = False
    """Use the time limits of the real robot; a busy machine may exceed them, which stops the robot."""
    activate: bool = True
    """Open the gate as soon as it is armed. After a stop, open it yourself: golem safety reset,
    golem safety activate."""


def commands(config: LaunchConfig) -> dict[Part, list[str]]:
    """Return the words after `golem` for each process. Raises ConfigError: a wrong stack file, or the real robot."""
    if config.dds.robot:
        raise ConfigError(
            "golem launch starts a simulation. On the real robot start, each in a terminal of its own: "
            "golem safety --robot --domain 0 --interface NAME; golem up STACK --robot --domain 0 --interface NAME."
        )
    stack = load_stack(config.stack, profile=config.profile)
    dds = config.dds.words()
    profile = ["--profile", config.profile] if config.profile else []
    world = ["--world", config.world] if config.world else []
    estop = stack.part("estop").words()
    return {
        "twin": ["twin", config.stack, "--seed", str(config.seed), *profile, *world, *dds],
        "safety": [
            "safety",
            "--limits",
            stack.limits,
            *(["--strict"] if config.strict else []),
            *(["--stand"] if stack.on_ground else []),
            *([] if load_profile(stack.profile).lives else ["--still"]),
            *estop,
            *dds,
        ],
        "up": ["up", config.stack, *profile, *dds],
    }


class Process:
    """One process, and what it prints, with its name in front."""

    def __init__(self, name: str, words: Sequence[str]) -> None:
        self.name = name
        # A group of its own: Ctrl-C in the terminal is for the launcher, which ends them in order. Its standard input
        # ends with the launcher, however that ends.
        self._process = subprocess.Popen(
            [sys.executable, "-m", "golem", *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",  # of a child's output nothing may end the reader: the child would wait for it
            start_new_session=True,
            env={**os.environ, LIFELINE: "1"},
        )
        self._reader = threading.Thread(target=self._pass_on, daemon=True)
        self._reader.start()

    @property
    def code(self) -> int | None:
        """The exit code; None while it runs."""
        return self._process.poll()

    @property
    def pid(self) -> int:
        """The operating system's number of it."""
        return self._process.pid

    def kill(self) -> None:
        """End it at once, without a word to it."""
        self._process.kill()
        self._process.wait()

    def end(self) -> None:
        """Ask it to end, and make it if it does not."""
        if self.code is None:
            self._process.send_signal(signal.SIGTERM)
            try:
                self._process.wait(GRACE)
            except subprocess.TimeoutExpired:
                log_line(f"{self.name} does not end; it is killed.")
                self._process.kill()
                self._process.wait()
            if self.code:
                log_line(f"{self.name} ended with exit code {self.code}.")
        self._reader.join(1.0)

    def _pass_on(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            log_line(f"[{self.name}] {line.rstrip()}")


class Launcher:
    """The processes of one robot; `gate` is the newest verdict of the safety gate, None before the first."""

    def __init__(self, words: dict[Part, list[str]], node: RosNode, activate: bool, damper: Damper) -> None:
        """Start the processes, `words` being their command lines; watch the gate through `node`.

        The gate is opened once it is armed, if `activate`; when it has died, the `damper` has the motors.
        """
        self._damper = damper
        self._words, self._node, self._activate = words, node, activate
        self._activation: Future[Any] | None = None
        self._client = node.client("/safety/activate", public.TRIGGER)
        self._dead: set[str] = set()
        self.gate: GateStatus | None = None
        row = public.topic("/safety/status")
        node.subscription(row.name, row.type, self._heard, row.qos)
        for name in PARTS:
            node.service(f"/launch/restart_{name}", public.TRIGGER, self._restarter(name))
        self.processes: dict[Part, Process] = {name: Process(name, words[name]) for name in PARTS}

    def step(self, timeout: float) -> None:
        """Look after everything for up to `timeout` [s]."""
        self._node.spin_once(timeout)
        for name, process in self.processes.items():
            if process.code is not None and name not in self._dead:
                self._dead.add(name)
                if name == "safety":
                    self._damper.start()
                log_line(f"{name} has died (exit code {process.code}). {self._consequence(name)}")
                log_line(f"Restart it with: golem restart {name}")
        if self._activate and self.gate is not None and self.gate.state is GateState.ARMED:
            if self._activation is None and self._client.ready():
                self._activation = self._client.call(Trigger_Request())
                self._activation.then(self._activated)

    def restart(self, name: Part) -> None:
        """End one process, if it still runs, and start it again; the others go on."""
        self.processes[name].end()
        if name == "safety":
            self._damper.stop()
        self._dead.discard(name)
        self.processes[name] = Process(name, self._words[name])
        log_line(f"{name} was restarted (process {self.processes[name].pid}).")

    def close(self) -> None:
        """End all processes: what commands, then the gate, which damps, then the robot."""
        for name in reversed(PARTS):
            self.processes[name].end()
        self._damper.stop()

    def _consequence(self, name: str) -> str:
        """Return what becomes of the robot once a process has died, as far as it is seen here."""
        if name == "safety":
            return "The motors are damped from here, and then go limp."
        until(self._node, lambda: self.gate is not None and self.gate.state is not GateState.ACTIVE, SILENCE + 1.0)
        return (
            "The safety gate is silent." if self.gate is None else f"The safety gate is {describe_status(self.gate)}."
        )

    def _restarter(self, name: Part) -> Callable[[Any], Trigger_Response]:
        def answer(request: Any) -> Trigger_Response:
            self.restart(name)
            return Trigger_Response(True, f"{name} is process {self.processes[name].pid} now.")

        return answer

    def _heard(self, message: Any) -> None:
        self.gate = to_gate_status(message)

    def _activated(self, answer: Future[Any]) -> None:
        self._activation = None
        try:
            self._activate = not answer.result().success
        except Exception:  # asked again: whoever should have answered is not there yet
            return


def run_launch(config: LaunchConfig) -> bool:
    """Start everything and watch over it until Ctrl-C; return whether nothing had died by then.

    Raises:
        ConfigError: an option or the stack file is wrong, or a robot, a gate or a stack is on the domain already.
        DdsError: the domain cannot be joined.
    """
    words = commands(config)
    with interrupted() as stop, member(LAUNCH, config.dds) as (participant, node):
        refuse_second_launch(participant, config.dds)
        launcher = Launcher(words, node, config.activate, Damper(participant, SafetyLimits.from_profile()))
        try:
            while not stop.is_set():
                launcher.step(PERIOD)
        finally:
            alive = all(process.code is None for process in launcher.processes.values())
            launcher.close()
    return alive
