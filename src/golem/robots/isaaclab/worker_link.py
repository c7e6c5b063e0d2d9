"""A worker of Isaac Lab, seen from this side of its pipe."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem.errors import ConfigError, ServiceUnavailable, shorten
from golem.robots.isaaclab import worker
from golem.robots.isaaclab.worker import Scene, reply_type, request_type

VARIABLE = "GOLEM_ISAACLAB_PYTHON"
"""Environment variable that names the Python of Isaac Lab's environment where the option does not."""
LAST_WORDS = 400
"""How much of what a dead worker printed is repeated [characters]."""


@dataclass(frozen=True)
class Layers:
    """The two USD layers of a scene, as text."""

    robot: str
    world: str


def isaac_python(option: Path | None) -> Path:
    """Return the Python of Isaac Lab's environment.

    Args:
        option: as the stack file names it; None: `VARIABLE` says it.

    Raises:
        ConfigError: nobody names one, or there is none.
    """
    named = str(option) if option is not None else os.environ.get(VARIABLE, "")
    if not named:
        raise ConfigError(
            "Isaac Lab runs in an environment of its own: make it with scripts/venv_isaac.sh, and name its Python in "
            f"the robot's option python or in {VARIABLE}."
        )
    path = Path(named).expanduser()
    if not path.is_file():
        raise ConfigError(
            f"There is no Python '{path}'; scripts/venv_isaac.sh makes an environment with Isaac Lab, whose "
            "bin/python the option python names."
        )
    return path


class WorkerLink:
    """Starts a worker and exchanges requests and replies with it.

    Attributes:
        versions: of the packages that the worker uses, by name.
    """

    def __init__(self, python: Path, scene: Scene, layers: Layers) -> None:
        """Start a worker under `python` and have it build `scene` from `layers`, which takes up to minutes.

        Args:
            python: of an environment with Isaac Lab.
            scene: what to simulate; its files are written here.
            layers: what its files are to hold.

        Raises:
            ConfigError: Isaac Lab does not run there.
        """
        self._folder = tempfile.TemporaryDirectory(prefix="golem-isaaclab-")
        folder = Path(self._folder.name)
        scene = {**scene, "robot": str(folder / "robot.usda"), "world": str(folder / "world.usda")}
        (folder / "robot.usda").write_text(layers.robot, encoding="utf-8")
        (folder / "world.usda").write_text(layers.world, encoding="utf-8")
        (folder / "scene.json").write_text(json.dumps(scene), encoding="utf-8")
        self._log = folder / "log.txt"
        sizes = len(scene["joints"]), len(scene["bodies"])
        self._request, self._reply_type = np.zeros((), request_type(*sizes)), reply_type(*sizes)
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                [python, "-I", worker.__file__, folder / "scene.json"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                cwd=folder,
            )
        try:
            self.versions: dict[str, str] = self._hear_of_the_world(python)
        except BaseException:
            self.close()
            raise

    def ask(self, **fields: Any) -> NDArray[np.void]:
        """Send a request with `fields` of `request_type`, the others zero, and return the reply, one record.

        Raises:
            ServiceUnavailable: the worker has died.
        """
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

    def close(self) -> None:
        """End the worker. Closing twice does nothing."""
        if self._process.poll() is None:
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
