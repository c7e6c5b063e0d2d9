"""Real processes on a real domain: launched, killed, named, restarted, and ended in order."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Generator, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from tests.runtime.live.conftest import BLIND

from golem.middleware.dds.base import Qos
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.wire import hg

pytest.importorskip("cyclonedds")
pytestmark = [pytest.mark.slow, pytest.mark.alone, pytest.mark.timeout(900)]

STACK = """
robot: {{use: mujoco, world: open}}
localizer: {blind}:Blind
profile: ideal
"""


def golem(domain: int, *words: str) -> subprocess.CompletedProcess[str]:
    """Run `golem WORDS` on a domain to its end."""
    command = [sys.executable, "-m", "golem", *words, "--domain", str(domain)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


class Launched:
    """`golem launch` and what it has printed."""

    def __init__(self, stack: Path, domain: int) -> None:
        self._domain = domain
        command = [sys.executable, "-m", "golem", "launch", str(stack), "--domain", str(domain)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.lines: list[str] = []
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(line.rstrip())

    def wait_for(self, pattern: str, seconds: float = 300.0) -> str:
        """Wait for a line that matches, however busy the machine is, and return it."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for line in self.lines:
                if re.search(pattern, line):
                    return line
            time.sleep(0.05)
        raise AssertionError(f"no line like '{pattern}' in:\n" + "\n".join(self.lines))

    def golem(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Run `golem WORDS` on the same domain to its end."""
        return golem(self._domain, *words)

    def pid_of(self, name: str) -> int:
        """Return the process behind a name, as `golem topics` tells it."""
        # A process that has just joined is not discovered at once by another that has.
        for seconds in ("0.2", "1", "5"):
            told = self.golem("topics", "--seconds", seconds).stdout
            found = re.search(rf"golem {name}, \S+ \(process (\d+)", told)
            if found is not None:
                return int(found[1])
        raise AssertionError(f"nobody called {name} is on the domain")


@contextmanager
def active(stack: Path, domain: int) -> Generator[Launched, None, None]:
    """Launch a stack, and wait until its robot may move."""
    launched = Launched(stack, domain)
    try:
        launched.wait_for(r"^\[safety\] Safety gate: active")
        yield launched
    finally:
        if launched.process.poll() is None:
            launched.process.send_signal(signal.SIGINT)
            launched.process.wait(60)


@pytest.fixture
def launched(tmp_path: Path, domain: int) -> Iterator[Launched]:
    """A hanging robot that may move."""
    (tmp_path / "blind.py").write_text(BLIND)
    stack = tmp_path / "stack.yaml"
    stack.write_text(STACK.format(blind=tmp_path / "blind.py"))
    with active(stack, domain) as running:
        yield running


@pytest.mark.parametrize(("victim", "bystander"), [("up", "twin"), ("twin", "up")])
def test_a_dead_process_is_named_the_robot_stopped_and_the_process_restarted(
    launched: Launched, victim: str, bystander: str
) -> None:
    dead, alive = launched.pid_of(victim), launched.pid_of(bystander)
    os.kill(dead, signal.SIGKILL)
    line = launched.wait_for(f"^{victim} has died")
    assert "exit code -9" in line
    # On a machine this slow the gate may have stopped the robot for another reason before.
    assert re.search(r"safety gate is stop[01] \(\w+: \d+ ms old\)", line)
    launched.wait_for(f"Restart it with: golem restart {victim}")
    answer = launched.golem("restart", victim)
    new = re.search(rf"{victim} is process (\d+)", answer.stdout)
    assert answer.returncode == 0 and new is not None and int(new[1]) != dead
    launched.wait_for(r"^\[up\] The robot was restarted" if victim == "twin" else r"^up was restarted")
    assert launched.pid_of(bystander) == alive
    for _ in range(10):
        launched.golem("safety", "reset")
        if launched.golem("safety", "activate").returncode == 0:
            break
    else:
        raise AssertionError("the robot cannot be set free again:\n" + "\n".join(launched.lines))


def test_another_writer_of_the_motors_command_is_named_by_its_process(launched: Launched, domain: int) -> None:
    with closing(connect(DdsConfig(domain=domain))) as participant:
        participant.writer("rt/lowcmd", hg.LOW_CMD.type_name, Qos(depth=1))
        line = launched.wait_for(r"^\[safety\] Safety gate: \w+ \(two_writers")
    assert f"process {os.getpid()} on" in line


def test_ctrl_c_ends_everything_in_order(launched: Launched) -> None:
    launched.process.send_signal(signal.SIGINT)
    assert launched.process.wait(60) == 0
    assert any("stop" in line for line in launched.lines if line.startswith("[safety]"))
    assert not any("exit code" in line or "Fatal" in line for line in launched.lines)
    assert "Nobody is on domain" in launched.golem("topics", "--seconds", "0.2").stdout


def test_nobody_outlives_a_launcher_that_is_killed(launched: Launched) -> None:
    left = {launched.pid_of(name) for name in ("twin", "safety", "up")}
    launched.process.kill()
    launched.process.wait()
    end = time.monotonic() + 60.0
    while left and time.monotonic() < end:
        left = {pid for pid in left if alive(pid)}
        time.sleep(0.1)
    assert not left


def alive(pid: int) -> bool:
    """Return whether a process runs; one that nobody has waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def test_a_second_twin_is_refused_and_told_who_is_there(launched: Launched) -> None:
    answer = launched.golem("twin", "tether")
    assert answer.returncode == 2 and "There is a robot on domain" in answer.stderr and "golem twin" in answer.stderr
    status = launched.golem("safety", "status")
    assert status.stdout.strip()


def test_what_is_not_there_is_said_with_a_remedy(domain: int) -> None:
    status = golem(domain, "safety", "status")
    assert status.returncode == 2 and "start one with: golem safety" in status.stderr
    skill = golem(domain, "skill", "stand", "1")
    assert skill.returncode == 2 and "start a stack with: golem up STACK" in skill.stderr
    restart = golem(domain, "restart", "up")
    assert restart.returncode == 2 and "only what 'golem launch' started" in restart.stderr


def test_an_operator_takes_the_motors_from_the_robots_own_controller(launched: Launched) -> None:
    refused = launched.golem("safety", "take")
    assert refused.returncode != 0 and "hang it up" in refused.stderr
    first, second = launched.golem("safety", "take", "--hanging"), launched.golem("safety", "take")
    assert first.returncode == second.returncode == 0, first.stdout + first.stderr
    assert "'ai' has the motors and lets go" in first.stdout
    assert second.stdout.splitlines() == ["None of the robot's own controllers has the motors."]
