"""A worker of Isaac Lab, seen from this side of its pipe."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import tempfile
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from golem.errors import ConfigError, MissingEnvironment, ServiceUnavailable, shorten
from golem.robots.isaaclab import isaac_worker
from golem.robots.isaaclab.isaac_worker import WorkerScene, reply_type, request_type

VARIABLE = "GOLEM_ISAACLAB_PYTHON"
"""Environment variable that names the Python of Isaac Lab's environment where the option does not."""
LAST_WORDS = 400
"""How much of what a dead worker printed is repeated [characters]."""


class Layers(NamedTuple):
    """The two USD layers of a scene, as text."""

    robot: str
    world: str


Key = tuple[int, str, str, Layers]
"""Process that started a worker, its Python, scene and layers."""


def isaac_python(option: Path | None) -> Path:
    """Return the Python of Isaac Lab's environment.

    Args:
        option: as the stack file names it; None: `VARIABLE` says it.

    Raises:
        MissingEnvironment: nobody names one, or there is none.
    """
    named = str(option) if option is not None else os.environ.get(VARIABLE, "")
    if not named:
        raise MissingEnvironment(
            "Isaac Lab runs in an environment of its own: make it with 'make venv-isaac', and name its Python in "
            f"the robot's option python or in {VARIABLE}."
        )
    path = Path(named).expanduser()
    if not path.is_file():
        raise MissingEnvironment(
            f"There is no Python '{path}'; name the bin/python of an environment that 'make venv-isaac' has made."
        )
    return path.absolute()


class WorkerProcess:
    """A worker and its pipe.

    Attributes:
        key: what it simulates, and under which Python.
        versions: of the packages that it uses, by name.
    """

    def __init__(self, key: Key, python: Path, scene: WorkerScene, layers: Layers) -> None:
        """Start a worker under `python` and have it build `scene` from `layers`, which takes up to minutes.

        Raises:
            ConfigError: Isaac Lab does not run there.
        """
        self.key = key
        self._folder = tempfile.TemporaryDirectory(prefix="golem-isaaclab-")
        folder = Path(self._folder.name)
        self._log = folder / "log.txt"
        files = {"robot": folder / "robot.usda", "world": folder / "world.usda"}
        files["robot"].write_text(layers.robot, encoding="utf-8")
        files["world"].write_text(layers.world, encoding="utf-8")
        told = {**scene, **{name: str(file) for name, file in files.items()}}
        (folder / "scene.json").write_text(json.dumps(told), encoding="utf-8")
        sizes = len(scene["joints"]), len(scene["bodies"])
        self._request, self._reply_type = np.zeros((), request_type(*sizes)), reply_type(*sizes)
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                [python, "-I", isaac_worker.__file__, folder / "scene.json"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                cwd=folder,
            )
        try:
            self.versions = self._hear_of_the_world(python)
        except BaseException:
            self.end()
            raise

    @property
    def alive(self) -> bool:
        """Whether it can answer."""
        return self._process.poll() is None

    def ask(self, fields: Mapping[str, object]) -> NDArray[np.void]:
        """Send a request and return the reply, one record; see `WorkerLink.ask`."""
        self._request[...] = 0
        for name, value in fields.items():
            self._request[name] = value
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None and stdout is not None
        try:
            stdin.write(self._request.tobytes())
            stdin.flush()
            answer = stdout.read(self._reply_type.itemsize)
        except (OSError, ValueError):
            answer = b""
        if len(answer) < self._reply_type.itemsize:
            raise ServiceUnavailable(f"The worker of Isaac Lab has died: {self._last_words()}")
        return np.frombuffer(answer, self._reply_type)[0]

    def end(self) -> None:
        """Kill it. Ending twice does nothing."""
        if self.alive:
            self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        self._folder.cleanup()

    def _hear_of_the_world(self, python: Path) -> dict[str, str]:
        """Wait until the worker has built its world; return its versions."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        told: dict[str, Any] = json.loads(line) if line else {"error": self._last_words()}
        if "error" in told:
            raise ConfigError(f"Isaac Lab does not run under {python}: {shorten(told['error'], LAST_WORDS)}")
        return told["versions"]

    def _last_words(self) -> str:
        """Return the end of what the worker printed, on one line."""
        self._process.wait()
        words = " ".join(self._log.read_text(encoding="utf-8", errors="replace").split())
        return words[-LAST_WORDS:] or "it said nothing"


_idle: list[WorkerProcess] = []
"""The worker that nobody uses, if there is one: starting another takes far longer than putting its robot back."""


class WorkerLink:
    """Exchanges requests and replies with a worker of its own until it is closed or nobody holds it any more.

    Attributes:
        versions: of the packages that the worker uses, by name.
    """

    def __init__(self, python: Path, scene: WorkerScene, layers: Layers) -> None:
        """Take an idle worker that simulates the same, or start one, which takes up to minutes.

        Args:
            python: of an environment with Isaac Lab.
            scene: what to simulate; `robot` and `world` are filled in by the link.
            layers: what these files are to hold.

        Raises:
            ConfigError: Isaac Lab does not run there.
        """
        key = os.getpid(), str(python), json.dumps(scene), layers
        fitting = [process for process in _idle if process.key == key and process.alive]
        if fitting:
            process = fitting[0]
            _idle.remove(process)
        else:
            process = WorkerProcess(key, python, scene, layers)
        self._process, self.versions = process, process.versions
        self._give_back = weakref.finalize(self, _keep, process)

    def ask(self, **fields: object) -> NDArray[np.void]:
        """Send a request with `fields` of `request_type`, the others zero, and return the reply, one record.

        Raises:
            ServiceUnavailable: the worker has died.
        """
        return self._process.ask(fields)

    def close(self) -> None:
        """Leave the worker to the next link. Closing twice does nothing."""
        self._give_back()


def _keep(process: WorkerProcess) -> None:
    """Let `process` be the idle worker, and end the one that was."""
    for former in _idle:
        former.end()
    _idle[:] = [process]
