"""The e-stop firmware on a simulated Arduino Uno."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.hardware.drivers.pty_line import CountingPort

from golem.hardware.estop.serial_board import BAUD

HERE = Path(__file__).resolve().parent
FIRMWARE = HERE.parents[1] / "firmware" / "estop"
HEADER = Path("/usr/include/simavr/sim_avr.h")


def lacking() -> str:
    """Return why the firmware cannot be run here; empty if it can."""
    tools = [name for name in ("avr-gcc", "cc", "make") if shutil.which(name) is None]
    tools += [] if HEADER.is_file() else [str(HEADER)]
    return f"lacks {', '.join(tools)}: apt-get install gcc-avr avr-libc libsimavr-dev" if tools else ""


class Uno:
    """A board that runs while it is asked to; its contact is closed.

    Attributes:
        port: its serial port, opened by the host.
        time: how long it has run [s].
    """

    def __init__(self, simulator: Path, firmware: Path) -> None:
        """Plug in the board; it has not run yet."""
        self._process = subprocess.Popen(
            [simulator, firmware], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.port = CountingPort(self._answer("terminal"), BAUD)
        self.time = 0.0

    def say(self, words: str) -> None:
        """Do something to the board: press, release, hang, weld, cut PIN, ground PIN, flip ADDRESS BIT."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{words}\n")
        self._process.stdin.flush()

    def run(self, seconds: float) -> None:
        """Let the board run; then it has got what the host had written, and the host can read what it has sent."""
        self.say(f"run {round(seconds * 1e3)} {self.port.written}")
        self.port.arrive(int(self._answer("ran")))
        self.time += seconds

    def end(self) -> None:
        """Take the board away."""
        self._process.kill()
        self._process.communicate()

    def _answer(self, word: str) -> str:
        assert self._process.stdout is not None
        return next(line.split()[1] for line in self._process.stdout if line.startswith(f"{word} "))


@pytest.fixture(scope="session")
def programs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The simulator and the firmware, built."""
    if lacking():
        pytest.skip(lacking())
    build = tmp_path_factory.mktemp("uno")
    subprocess.run(["make", "-C", FIRMWARE, f"BUILD={build}"], check=True, capture_output=True)
    simulator = build / "simavr_uno"
    subprocess.run(["cc", "-O2", "-w", "-o", simulator, HERE / "simavr_uno.c", "-lsimavr"], check=True)
    return simulator, build / "estop.elf"


@pytest.fixture
def uno(programs: tuple[Path, Path]) -> Iterator[Uno]:
    """A board that is plugged in and has not run yet."""
    board = Uno(*programs)
    yield board
    board.port.close()
    board.end()
