"""The 500 Hz loop of states and commands between two processes, ours next to the vendor's SDK.

python scripts/dds_bench/bench.py --seconds 60 --sdk CHECKOUT
"""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from golem.errors import ConfigError, GolemError
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.dds.library import cyclone
from golem.types import Array

GOLEM = (sys.executable, str(Path(__file__).with_name("loop.py")))
SDK_SCRIPT = Path(__file__).with_name("sdk_loop.py")
PERIOD = 0.002
TARGETS = "0 lost, median latency 150 us, robot 20 % of a core without images, 3 ms per image"


PM_QOS = "/dev/cpu_dma_latency"
"""While this is held open, no processor sleeps deeper than takes as many microseconds to wake from as are written."""


class BenchFailed(GolemError):
    """A process of the bench ended before its time."""


@dataclass(frozen=True)
class DdsBenchConfig:
    """Measure the 500 Hz loop of lowstate and lowcmd between two processes, and what images cost at the same time."""

    seconds: float = 60.0
    """Duration of each loop [s]."""
    domain: int = 99
    """DDS domain; no other process should be on it."""
    interface: str = "lo"
    """Network interface."""
    sdk: Path | None = None
    """Checkout of unitree_sdk2_python, to run the same loop with the vendor's classes."""
    sdk_python: Path = Path(sys.executable)
    """Python that has what the SDK needs (cyclonedds 0.10.2 by its own word, this one's works too)."""
    awake: bool = False
    """Keep idle processors awake meanwhile, which takes the right to write /dev/cpu_dma_latency (Linux)."""
    json: bool = False
    """Print the results as a last line of JSON."""


@dataclass(frozen=True, slots=True)
class Loop:
    """What was measured of one loop.

    Attributes:
        name: who talks to whom.
        rate: states sent per second [Hz].
        states, lost_states: sent by the robot's side, and of them never seen by the controller.
        lost_commands: answers of the controller that the robot's side never saw.
        latency: median and 99th percentile from before a state is encoded until it has been decoded [us].
        transport: the same from when its bytes are written until the controller has them, the SDK's as an object [us].
        jitter: the same of how far the times between decoded states are from 2 ms [us].
        cpu: share of a core by process [%].
        image_ms: median and 99th percentile of the processor time to serialise and send an image [ms]; None without.
        images: share of the images and clouds that came [%]; None without.
    """

    name: str
    rate: float
    states: int
    lost_states: int
    lost_commands: int
    latency: tuple[float, float]
    transport: tuple[float, float]
    jitter: tuple[float, float]
    cpu: dict[str, float]
    image_ms: tuple[float, float] | None = None
    images: float | None = None


def run_dds_bench(config: DdsBenchConfig) -> list[Loop]:
    """Measure and print.

    Raises:
        MissingExtra: cyclonedds is not installed.
        ConfigError: the duration is not positive, there is no SDK at the path, or processors cannot be kept awake.
        BenchFailed: a process failed; its own message says why.
    """
    cyclone()
    DdsConfig(config.domain, config.interface)
    if not config.seconds > 0.0:
        raise ConfigError(f"--seconds is {config.seconds:g}; it must be more than 0.")
    if config.sdk is not None and not (config.sdk / "unitree_sdk2py").is_dir():
        raise ConfigError(f"There is no checkout of unitree_sdk2_python at {config.sdk}.")
    with _awake() if config.awake else nullcontext():
        loops = [_loop(config, "GOLEM - GOLEM", GOLEM, GOLEM)]
        loops.append(_loop(config, "GOLEM - GOLEM, images", GOLEM, GOLEM, cameras=True))
        if config.sdk is not None:
            sdk = (str(config.sdk_python), str(SDK_SCRIPT))
            loops.append(_loop(config, "GOLEM - SDK", GOLEM, sdk))
            loops.append(_loop(config, "SDK - SDK", sdk, sdk))
    _print(loops)
    if config.json:
        print(json.dumps([asdict(loop) for loop in loops]))
    return loops


@contextmanager
def _awake() -> Iterator[None]:
    try:
        held = open(PM_QOS, "wb", buffering=0)
    except OSError as error:
        raise ConfigError(f"--awake needs the right to write {PM_QOS}: {error.strerror}.") from error
    with held:
        held.write(struct.pack("i", 0))
        yield


def _loop(
    config: DdsBenchConfig, name: str, robot: tuple[str, ...], controller: tuple[str, ...], cameras: bool = False
) -> Loop:
    """Run one loop: the controller (and the viewer) first, then the robot's side until it ends."""
    listeners = {"controller": _Side(config, controller, "controller")}
    if cameras:
        listeners["viewer"] = _Side(config, GOLEM, "viewer")
    try:
        for listener in listeners.values():
            listener.begin()
        sender = _Side(config, robot, "robot", *(["--cameras"] if cameras else []))
        sent = sender.result(config.seconds + 60.0)
        heard = {side: listener.result(30.0) for side, listener in listeners.items()}
    finally:
        for listener in listeners.values():
            listener.kill()
    return _measures(name, sent, heard)


def _measures(name: str, sent: dict[str, Any], heard: dict[str, Any]) -> Loop:
    began = np.array(sent["began"])
    came = np.array(heard["controller"]["came"]).reshape(-1, 3)
    came = came[came[:, 0] > 0]
    answered = set(sent["answered"]) - {0}
    numbers, first = np.unique(came[:, 0], return_index=True)
    latency = (came[first, 1] - began[numbers.astype(int) - 1]) * 1e-3
    jitter = np.abs(np.diff(came[:, 1]) * 1e-3 - PERIOD * 1e6)
    wall = sent["wall"]
    cpu = {"robot": sent["cpu"]} | {side: result["cpu"] for side, result in heard.items()}
    publications = sent["images"]
    image_ms = images = None
    if publications:
        image_ms = _median_p99(np.array(publications["image"]) * 1e3)
        images = 100.0 * sum(heard["viewer"]["came"].values()) / sum(map(len, publications.values()))
    return Loop(
        name=name,
        rate=len(began) / wall,
        states=len(began),
        lost_states=len(began) - len(numbers),
        lost_commands=len(came) - len(answered),
        latency=_median_p99(latency),
        transport=_median_p99(came[first, 2]),
        jitter=_median_p99(jitter),
        cpu={side: 100.0 * spent / wall for side, spent in cpu.items()},
        image_ms=image_ms,
        images=images,
    )


def _median_p99(values: Array) -> tuple[float, float]:
    if values.size == 0:
        return float("nan"), float("nan")
    return float(np.median(values)), float(np.quantile(values, 0.99))


class _Side:
    """One side, in a process of its own that ends with one line of JSON."""

    def __init__(self, config: DdsBenchConfig, command: tuple[str, ...], side: str, *options: str) -> None:
        self._side = side
        path = [str(config.sdk)] if config.sdk is not None else []
        path += [os.environ["PYTHONPATH"]] if os.environ.get("PYTHONPATH") else []
        arguments = [*command, side, "--domain", str(config.domain), "--interface", config.interface]
        self._process = subprocess.Popen(
            [*arguments, "--seconds", str(config.seconds), *options],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(path)},
        )

    def begin(self) -> None:
        """Wait until it listens, then let it count its processor time."""
        stdin, stdout = self._pipes()
        if not any(line.strip() == "ready" for line in stdout):
            raise self._failed()
        stdin.write("\n")
        stdin.flush()

    def result(self, patience: float) -> dict[str, Any]:
        """End its standard input and return what it measured."""
        try:
            said, _ = self._process.communicate(timeout=patience)
        except subprocess.TimeoutExpired:
            self.kill()
            raise BenchFailed(f"The {self._side}'s process of the bench did not end in {patience:g} s.") from None
        if self._process.returncode != 0:
            raise self._failed()
        return json.loads(said.splitlines()[-1])

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()
        self._process.wait()

    def _pipes(self) -> tuple[IO[str], IO[str]]:
        assert self._process.stdin is not None and self._process.stdout is not None
        return self._process.stdin, self._process.stdout

    def _failed(self) -> BenchFailed:
        return BenchFailed(f"The {self._side}'s process of the bench failed; its message is above.")


def _print(loops: Iterable[Loop]) -> None:
    loops = list(loops)
    table = Table("robot - controller", *(loop.name for loop in loops), title="500 Hz over DDS, median / p99")
    rows: dict[str, Callable[[Loop], str]] = {
        "states per second": lambda loop: f"{loop.rate:.1f}",
        "lost states": lambda loop: f"{loop.lost_states} of {loop.states}",
        "lost commands": lambda loop: str(loop.lost_commands),
        "latency, us": lambda loop: _pair(loop.latency, 0),
        "transport alone, us": lambda loop: _pair(loop.transport, 0),
        "jitter, us": lambda loop: _pair(loop.jitter, 0),
        "CPU robot, %": lambda loop: f"{loop.cpu['robot']:.1f}",
        "CPU controller, %": lambda loop: f"{loop.cpu['controller']:.1f}",
        "CPU viewer, %": lambda loop: f"{loop.cpu['viewer']:.1f}" if "viewer" in loop.cpu else "",
        "CPU per image, ms": lambda loop: _pair(loop.image_ms, 2),
        "images that came, %": lambda loop: "" if loop.images is None else f"{loop.images:.1f}",
    }
    for name, cell in rows.items():
        table.add_row(name, *(cell(loop) for loop in loops))
    Console().print(table)
    print(f"Wanted of ours: {TARGETS}.")


def _pair(values: tuple[float, float] | None, digits: int) -> str:
    return "" if values is None else f"{values[0]:.{digits}f} / {values[1]:.{digits}f}"


if __name__ == "__main__":
    try:
        run_dds_bench(tyro.cli(DdsBenchConfig))
    except GolemError as error:
        sys.exit(f"golem: {error}")
