"""The twin in one network namespace, safety gate and stack in another, and the cable between them pulled and put back.

    sudo .venv/bin/python -m tests.runtime.live.two_networks --stack tether --errand pick screw

prints what the gate said and when, and what came back; it fails when the gate does not stop the robot because of its
stale state, when the robot cannot be set free again, or when a process has ended. Containers instead of processes of
this machine: `--twin "podman run ..." --desk "..."` name what runs `golem` there, in the namespace.
"""

from __future__ import annotations

import json
import re
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import tyro
from tests.cable import End, cable

DOMAIN = "7"
ATTEMPTS = 6
"""How often an errand is begun anew that the gate ended because this machine was too slow for its load."""
LATE = ("state_stale", "command_stale", "gate_stalled")
"""Why the gate ends an errand when a processor comes too late."""
HERE = f"{sys.executable} -m golem"
DESK = """
import contextlib, json, sys, time
from golem.interfaces import public
from golem.middleware.dds.base import Qos
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.ros.goals import GoalStatus
from golem.middleware.ros.msgs.std_srvs import Trigger_Request
from golem.middleware.wire import convert
from golem.runtime.live.skill_client import compose, propose, read_words
from golem.runtime.live.node_setup import member
from golem.runtime.live.operator import ask

def pursue(words):
    with contextlib.redirect_stdout(sys.stderr):
        result = propose(node, compose(node, *read_words(words), "start it"), "start it").result()
        while not result.done:
            node.spin_once(0.1)
    outcome = result.result()
    succeeded = outcome.status == GoalStatus.SUCCEEDED
    return {"success": succeeded, "message": outcome.result.result.reason}

with member("desk", DdsConfig(int(sys.argv[1]), sys.argv[2])) as (participant, node):
    for words in map(str.split, sys.stdin):
        if words[0] == "skill":
            print(json.dumps(pursue(words[1:])), flush=True)
            continue
        if words[0] != "listen":
            response = ask(node, f"/safety/{words[0]}", public.TRIGGER, Trigger_Request(), "start it")
            print(json.dumps({"success": response.success, "message": response.message}), flush=True)
            continue
        reader = participant.reader("rt/lowstate", "unitree_hg::msg::dds_::LowState_", Qos(depth=256))
        times, angles = [], []
        end = time.monotonic() + float(words[1])
        while time.monotonic() < end:
            time.sleep(0.01)
            for sample in reader.take(256):
                if sample.alive:
                    state = convert.decode_low_state(sample.payload)
                    times.append(state.t)
                    angles = state.q.tolist()
        reader.close()
        ticks = {round(t * 1e3) for t in times}
        missing = (max(ticks) - min(ticks)) // 2 + 1 - len(ticks) if ticks else None
        print(json.dumps({"got": len(ticks), "missing": missing, "q": angles}), flush=True)
"""
"""Somebody at the stack's end: does what is read from stdin; see `Desk.ask`."""


@dataclass(frozen=True)
class Config:
    """Prove that twin and stack talk across two networks, and what becomes of them when the cable is cut."""

    stack: str = "tether"
    """Stack file, or the name of a shipped one."""
    cuts: tuple[float, ...] = (1.0, 5.0)
    """How long the cable is out [s], at the robot's end and at the stack's in turn."""
    errand: tuple[str, ...] = ()
    """What the robot is told to do before and after the cuts: words after `golem skill`."""
    soak: float = 0.0
    """How long to listen to the robot's states before the first cut [s]."""
    twin: str = HERE
    """What runs `golem` at the robot's end."""
    desk: str = HERE
    """What runs `golem` at the stack's end."""


@dataclass
class Cut:
    """What a cut did.

    Attributes:
        seconds: how long the cable was out.
        where: at whose end.
        stopped: what the gate said.
        after: how long after the cut it said so [s].
        rearmed: how long after the cable was back the robot could be set free [s].
    """

    seconds: float
    where: str
    stopped: str
    after: float
    rearmed: float


@dataclass
class Proof:
    """What was seen; `states` are those of the soak, `errands` whether each succeeded, and what it said."""

    states: dict[str, Any] = field(default_factory=dict)
    cuts: list[Cut] = field(default_factory=list)
    errands: list[tuple[bool, str]] = field(default_factory=list)


class Part:
    """A process at one end, and what it prints, with the time [s, monotonic]."""

    def __init__(self, end: End, golem: str, words: Sequence[str]) -> None:
        """Run `GOLEM WORDS` on the domain at `end`."""
        self.name = words[0]
        self._process = subprocess.Popen(
            command(end, golem, words), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self.lines: list[tuple[float, str]] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.lines.append((time.monotonic(), line.rstrip()))

    def wait_for(self, pattern: str, since: float = 0.0, seconds: float = 150.0) -> tuple[float, str]:
        """Wait for a line that matches, printed after `since`; return its time and text."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for t, line in list(self.lines):
                if t >= since and re.search(pattern, line):
                    return t, line
            self.check()
            time.sleep(0.02)
        raise AssertionError(f"{self.name}: no line like '{pattern}' in: {self.lines}")

    def check(self) -> None:
        """Fail if it has ended."""
        assert self._process.poll() is None, f"{self.name} has ended: {self.lines}"

    def close(self) -> None:
        """End it as Ctrl-C does."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
            try:
                self._process.wait(15.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._reader.join(1.0)


def command(end: End, golem: str, words: Sequence[str]) -> list[str]:
    """Return the command line of `GOLEM WORDS` on the domain at `end`."""
    return [*end.inside, *shlex.split(golem), *words, "--domain", DOMAIN, "--interface", end.interface]


class Desk:
    """Somebody at the stack's end, without the start of a process for every question."""

    def __init__(self, end: End) -> None:
        """Sit down at `end`."""
        self._process = subprocess.Popen(
            [*end.inside, sys.executable, "-c", DESK, DOMAIN, end.interface],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def ask(self, words: str) -> dict[str, Any]:
        """Say `words` (activate, stop, reset, skill ..., listen SECONDS) and return the answer."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(f"{words}\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())

    def rearm(self, seconds: float = 60.0) -> None:
        """Reset the gate and let commands through, as soon as it agrees."""
        until = time.monotonic() + seconds
        while True:
            self.ask("reset")
            answer = self.ask("activate")
            if answer["success"]:
                return
            assert time.monotonic() < until, f"the robot cannot be set free: {answer['message']}"

    def close(self) -> None:
        """Leave."""
        self._process.communicate()


@dataclass
class Scene:
    """Everybody, each at an end of the cable."""

    robot: End
    table: End
    twin: Part
    safety: Part
    up: Part
    desk: Desk

    def free(self) -> None:
        """Wait until the robot is free and has been for a moment; a machine too slow for its load stops it again."""
        for _ in range(20):
            since = time.monotonic()
            self.desk.rearm()
            time.sleep(0.2)
            if not any(t > since and "stop" in line for t, line in list(self.safety.lines)):
                return
        raise AssertionError(f"this machine is too slow for the gate: {self.safety.lines[-6:]}")

    def cut(self, seconds: float, where: str) -> Cut:
        """Pull the cable out at one end and put it back."""
        end = self.robot if where == "robot" else self.table
        self.free()
        since = time.monotonic()
        end.plug(False)
        try:
            at, said = self.safety.wait_for(r"Safety gate: stop", since, seconds)
            if end is self.robot:
                answer = self.desk.ask("reset")
                assert not answer["success"], "the gate was reset without a robot"
            time.sleep(max(0.0, since + seconds - time.monotonic()))
        finally:
            end.plug(True)
        back = time.monotonic()
        self.desk.rearm()
        rearmed = time.monotonic() - back
        assert "state_stale" in said, f"the gate stopped for another reason: {said}"
        self.check()
        return Cut(seconds, where, said, at - since, rearmed)

    def check(self) -> None:
        """Fail if a process has ended."""
        for part in (self.twin, self.safety, self.up):
            part.check()


def prove(config: Config, say: Callable[[str], None] = lambda _: None) -> Proof:
    """Go through it all; see the module. `say` is told of every step.

    Raises:
        NoNamespaces: this machine or this user makes none.
        AssertionError: it is not so.
    """
    proof = Proof()
    with cable() as (robot, table), ExitStack() as closing:

        def start(end: End, golem: str, *words: str) -> Part:
            part = Part(end, golem, words)
            closing.callback(part.close)
            return part

        twin = start(robot, config.twin, "twin", config.stack)
        # As early as the real robot's: a patient gate would not notice that the cable was out for a second.
        safety = start(table, config.desk, "safety", "--strict")
        up = start(table, config.desk, "up", config.stack)
        twin.wait_for("is on domain")
        up.wait_for("Safety gate: armed")
        desk = Desk(table)
        closing.callback(desk.close)
        scene = Scene(robot, table, twin, safety, up, desk)

        def run_errand() -> None:
            for attempt in range(ATTEMPTS if config.errand else 0):
                scene.free()
                answer = desk.ask(" ".join(("skill", *config.errand)))
                proof.errands.append((answer["success"], answer["message"]))
                say(f"errand {'succeeded' if answer['success'] else 'failed'}: {answer['message']}")
                if answer["success"]:
                    return
                late = any(reason in answer["message"] for reason in LATE)
                assert late and attempt < ATTEMPTS - 1, answer["message"]

        scene.free()
        if config.soak:
            proof.states = desk.ask(f"listen {config.soak}")
            say(f"states heard {proof.states['got']}, missing {proof.states['missing']}")
        run_errand()
        for i, seconds in enumerate(config.cuts):
            cut = scene.cut(seconds, ("robot", "table")[i % 2])
            proof.cuts.append(cut)
            say(
                f"cable out for {cut.seconds:g} s at the {cut.where}'s end: after {cut.after * 1e3:.0f} ms "
                f"'{cut.stopped}', free again {cut.rearmed:.2f} s after it was back"
            )
        scene.free()
        assert desk.ask("listen 1")["got"] > 100, "the robot's states do not come any more"
        run_errand()
        scene.check()
    return proof


def main() -> None:
    """Print the proof as it comes about."""
    prove(tyro.cli(Config), lambda text: print(text, flush=True))


if __name__ == "__main__":
    main()
