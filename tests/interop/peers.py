"""Real ROS 2 beside the tests: what `build.sh` made of wheels, in processes of its own."""

from __future__ import annotations

import fcntl
import functools
import json
import os
import queue
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.ros.node import RosNode
from golem.middleware.ros.node_endpoints import PARTICIPANT_USER_DATA

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PREFIXES = ROOT / ".cache" / "interop"
Distro = Literal["jazzy", "kilted"]
Vendor = Literal["fastdds", "cyclonedds"]
IMPLEMENTATIONS: dict[Vendor, str] = {"fastdds": "rmw_fastrtps_cpp", "cyclonedds": "rmw_cyclonedds_cpp"}
PATIENCE = 15.0
"""How long something that is going to happen may take [s]: discovery, on a busy machine."""


class CannotError(Exception):
    """This machine has no such ROS 2; why is the text."""


@dataclass(frozen=True, slots=True)
class Setup:
    """A distribution of ROS 2 and the DDS below it."""

    distro: Distro
    vendor: Vendor

    def __str__(self) -> str:
        return f"{self.distro}-{self.vendor}"


SETUPS = tuple(Setup(distro, vendor) for distro in ("jazzy", "kilted") for vendor in ("fastdds", "cyclonedds"))


@functools.cache
def prefix(distro: Distro) -> Path:
    """Return where the ROS 2 of a distribution is, built if need be; this takes minutes.

    Raises:
        CannotError: it cannot be had here.
    """
    PREFIXES.mkdir(parents=True, exist_ok=True)
    with (PREFIXES / f"{distro}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # two processes of pytest would build into one folder
        built = subprocess.run(("bash", str(HERE / "build.sh"), distro), capture_output=True, text=True)
    if built.returncode == 3:
        raise CannotError(built.stderr.strip().splitlines()[-1])
    if built.returncode:
        raise RuntimeError(f"build.sh {distro} failed:\n{built.stdout[-2000:]}{built.stderr[-2000:]}")
    return PREFIXES / distro


def environment(setup: Setup, domain: int) -> dict[str, str]:
    """Return the environment of a process of `setup` on a domain, as docs/how-to/ros2.md has it.

    Raises:
        CannotError: it cannot be had here.
    """
    root = prefix(setup.distro)
    libraries = [root / "lib", *sorted(root.glob("lib/python*/site-packages/ros_*.libs"))]
    ours = {"ROS_DOMAIN_ID": str(domain), "PYTHONUNBUFFERED": "1"}
    if setup.vendor == "cyclonedds":
        libraries.insert(0, root / "cyclone")
        if not (libraries[0] / "librmw_fastrtps_cpp.so").exists():
            raise CannotError(f"rmw_cyclonedds was not built for {setup.distro}: name a checkout of it, see build.sh")
        ours["CYCLONEDDS_URI"] = f"file://{ROOT / 'docker' / 'cyclonedds.xml'}"
    else:
        profile = str(ROOT / "docker" / "fastdds.xml")
        ours |= {"FASTDDS_DEFAULT_PROFILES_FILE": profile, "FASTRTPS_DEFAULT_PROFILES_FILE": profile}
    # Left to themselves the wheels set the path, in an order of chance, and start Python anew.
    ours |= {"LD_LIBRARY_PATH": ":".join(map(str, libraries)), "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"}
    kept = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    return kept | ours


class Ros:
    """A process of `peer.py`."""

    def __init__(self, setup: Setup, domain: int) -> None:
        """Start it, and wait until it is on the domain."""
        self.setup = setup
        python = prefix(setup.distro) / "bin" / "python"
        self._process = subprocess.Popen(
            (str(python), str(HERE / "peer.py")),
            env=environment(setup, domain),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        self._lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()
        while (line := self._lines.get(timeout=30.0)) != "ready":
            if not line:
                raise RuntimeError("peer.py ended at once")
        assert self.do("implementation") == IMPLEMENTATIONS[setup.vendor]

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith(("{", "ready")):
                self._lines.put(line.strip())
        self._lines.put("")

    def tell(self, do: str, **words: Any) -> None:
        """Give an order."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"do": do, **words}) + "\n")
        self._process.stdin.flush()

    def hear(self, node: RosNode | None = None, timeout: float = 30.0) -> Any:
        """Return what the oldest order came to, spinning `node` meanwhile."""
        end = time.monotonic() + timeout
        while self._lines.empty():
            assert time.monotonic() < end, "peer.py does not answer"
            if node is None:
                time.sleep(0.005)
            else:
                node.spin_once(0.005)
        answer = json.loads(self._lines.get() or '{"error": "peer.py has ended"}')
        if "error" in answer:
            raise RuntimeError(answer["error"])
        return answer["value"]

    def do(self, do: str, node: RosNode | None = None, **words: Any) -> Any:
        """Give an order, and return what it came to."""
        self.tell(do, **words)
        return self.hear(node)

    def kill(self) -> None:
        """End it without its doing anything about it."""
        self._process.kill()
        self._process.wait()

    def close(self) -> None:
        """End it."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self.kill()


@contextmanager
def joined(domain: int, name: str = "golem") -> Iterator[RosNode]:
    """Give a node of ours on a domain."""
    with closing(connect(DdsConfig(domain=domain), PARTICIPANT_USER_DATA)) as participant:
        with closing(RosNode(participant, name)) as node:
            yield node


def until(node: RosNode, condition: Callable[[], Any], timeout: float = PATIENCE) -> bool:
    """Spin `node` until `condition()`, and return whether it came true."""
    end = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > end:
            return False
        node.spin_once(0.01)
    return True
