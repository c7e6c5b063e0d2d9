"""A data set of three cameras recorded beside a live robot: `python scripts/record_minutes.py MINUTES FOLDER`.

`golem launch tether` picks screw after screw, first alone for a tenth of that time, then beside `golem record
--lerobot`. Printed are, for both: robot time per time of the wall clock, states that did not come, states that no
command answered, and how the picks ended.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from golem.interfaces.recorded import public_topics
from golem.middleware.bags.base import BagMessage, BagTopic
from golem.middleware.bags.recorder import Recorder
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.ros import codec

DOMAIN = 87
STATE, COMMAND = "/lowstate", "/lowcmd"
PERIOD = 2
"""Ticks between two states [ms]."""
KEPT = 3
"""Screws of a new robot that its right hand brings to the tray."""
GOLEM = [sys.executable, "-m", "golem"]
HERE = ["--domain", str(DOMAIN)]


class Ticks:
    """Counts states and the commands that answer them; a sink of the recorder."""

    def __init__(self) -> None:
        kinds = {STATE: "unitree_hg/msg/LowState", COMMAND: "unitree_hg/msg/LowCmd"}
        self._decode = {topic: codec.message(kind) for topic, kind in kinds.items()}
        self.states, self.answered = set[int](), set[int]()

    def add(self, topic: BagTopic) -> None:
        """Nothing is kept of a topic."""

    def write(self, message: BagMessage) -> None:
        """Note which tick it is, or which one it answers."""
        told = codec.deserialize(message.payload, self._decode[message.topic.name])
        if message.topic.name == STATE:
            self.states.add(told.tick)
        else:
            self.answered.add(told.reserve[0])

    def close(self) -> None:
        """Nothing is open."""

    def __str__(self) -> str:
        first, last = min(self.states), max(self.states)
        wanted = set(range(first, last + 1, PERIOD))
        inside = {tick for tick in self.states if tick < last - 100}  # the last are still being answered
        missing, silent = len(wanted - self.states), len(inside - self.answered)
        return f"{len(self.states)} states, {missing} did not come, {silent} not answered; {(last - first) / 1e3:.0f} s"


@contextmanager
def running(*words: str) -> Iterator[subprocess.Popen[bytes]]:
    """Have a command run on the domain; it is interrupted at the end."""
    process = subprocess.Popen([*GOLEM, *words, *HERE], stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=600)


def golem(*words: str) -> bool:
    """Run a command on the domain, and return whether it succeeded."""
    return subprocess.run([*GOLEM, *words, *HERE], capture_output=True, check=False).returncode == 0


def renew() -> None:
    """Put a new robot in the place of this one, with all its screws."""
    golem("restart", "twin")
    for _ in range(20):
        golem("safety", "reset")
        if golem("safety", "activate"):
            return
        time.sleep(2.0)


def watched(seconds: float) -> None:
    """Pick for so long, and print what was heard meanwhile."""
    participant = connect(DdsConfig(domain=DOMAIN))
    ticks, ended, taken, begin = Ticks(), Counter[bool](), 0, time.monotonic()
    recorder = Recorder(participant, ticks)
    recorder.add(public_topics((STATE, COMMAND)))
    pick: subprocess.Popen[bytes] | None = None
    while time.monotonic() < begin + seconds:
        recorder.poll()
        time.sleep(0.02)
        if pick is None:
            pick = subprocess.Popen([*GOLEM, "skill", "pick", "screw", *HERE], stdout=subprocess.DEVNULL)
        elif pick.poll() is not None:
            ended[pick.returncode == 0] += 1
            taken, pick = taken + 1, None
    recorder.poll(last=True)
    recorder.close()
    participant.close()
    if pick is not None:
        pick.send_signal(signal.SIGINT)
        pick.wait(60)
    took = time.monotonic() - begin
    print(f"{ticks} robot time in {took:.0f} s; picks: {ended[True]} of {ended.total()} succeeded.", flush=True)


def main(minutes: float, folder: Path) -> None:
    """Print both."""
    with running("launch", "tether") as robot:
        assert robot.stdout is not None
        while b"Safety gate: active" not in robot.stdout.readline():
            pass
        watched(6.0 * minutes)
        renew()
        cameras = ("--fps", "30", "--cameras", "head", "left_hand", "right_hand")
        with running("record", "--lerobot", str(folder), *cameras):
            watched(60.0 * minutes)
    subprocess.run([*GOLEM, "dataset", "check", str(folder)], check=False)


main(float(sys.argv[1]), Path(sys.argv[2]))
