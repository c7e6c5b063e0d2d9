"""The twin in Isaac Lab: the same robot, motors, sensors and worlds, with the motion of a worker in another process."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import tempfile
import weakref
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple, get_args

import mujoco
import numpy as np
from numpy.typing import NDArray

from golem.errors import ConfigError, MissingEnvironment, ServiceUnavailable, shorten, unknown_name
from golem.robots.isaaclab import isaac_worker
from golem.robots.isaaclab.isaac_worker import WorkerScene, reply_type, request_type
from golem.robots.isaaclab.usd_layers import robot_layer, world_layer
from golem.robots.model.table import BASE_LINK
from golem.robots.mujoco.other_engine import Motion, OtherEngineConfig, OtherEngineRobot, follower_names
from golem.robots.mujoco.scene import COARSE_STEP
from golem.robots.mujoco.truth import Truth
from golem.types import SIDES, Array

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
    """Return the Python of Isaac Lab's environment. `option`: as the stack file names it; None: `VARIABLE` says it.

    Raises MissingEnvironment: nobody names one, or there is none.
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
        """Start a worker under `python` that builds `scene`, in minutes. Raises ConfigError: Isaac Lab does not run."""
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
            words, pipe = [python, "-I", isaac_worker.__file__, folder / "scene.json"], subprocess.PIPE
            self._process = subprocess.Popen(words, stdin=pipe, stdout=pipe, stderr=log, cwd=folder)
        try:
            self.versions = self._hear_of_the_world(python)
        except BaseException:
            self.end()
            raise

    @property
    def alive(self) -> bool:
        """Whether it can answer."""
        return self._process.poll() is None

    def ask(self, **fields: object) -> NDArray[np.void]:
        """Send a `request_type` of `fields`, else zero; return the reply. Raises ServiceUnavailable: it has died."""
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


def take_worker(python: Path, scene: WorkerScene, layers: Layers) -> WorkerProcess:
    """Return the idle worker, if it simulates the same, or start one, which takes up to minutes.

    Args:
        python: of an environment with Isaac Lab.
        scene: what to simulate; `robot` and `world` are filled in.
        layers: what these files are to hold.

    Raises:
        ConfigError: Isaac Lab does not run there.
    """
    key = os.getpid(), str(python), json.dumps(scene), layers
    if _idle and _idle[0].key == key and _idle[0].alive:
        return _idle.pop()
    return WorkerProcess(key, python, scene, layers)


def keep_worker(process: WorkerProcess) -> None:
    """Let `process` be the idle worker, and end the one that was."""
    for former in _idle:
        former.end()
    _idle[:] = [process]


class IsaacTruth(Truth):
    """Poses from the model that follows Isaac Lab, contact forces from Isaac Lab itself."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, links: list[str]) -> None:
        """Read `data` of `model`, whose robot has the bodies `links`."""
        super().__init__(model, data)
        self._links = links
        self._soles = [links.index(f"{side}_ankle_roll_link") for side in SIDES]
        self._forces = np.zeros((len(links), 3))

    def see(self, forces: Array) -> None:
        """Take the force of the world on each link in the last step, (n, 3) [N], in the world."""
        self._forces = forces

    def foot_forces(self) -> Array:
        return self._forces[self._soles].astype(np.float64)

    def touches(self) -> tuple[str, ...]:
        loaded = set(np.flatnonzero(self._forces.any(axis=1))) - set(self._soles)
        return tuple(sorted(self._links[link] for link in loaded))


Backend = Literal["physx", "newton"]


@dataclass(frozen=True)
class IsaacLabConfig(OtherEngineConfig):
    """Options of the twin in Isaac Lab; see `OtherEngineConfig`.

    Attributes:
        backend: which of Isaac Lab's engines moves it: `physx` is OvPhysX, `newton` MuJoCo-Warp under Newton.
        python: of the environment in which Isaac Lab is installed; by default the one that GOLEM_ISAACLAB_PYTHON names.
    """

    ENGINE: ClassVar[str] = "Isaac Lab"

    backend: Backend = "physx"
    python: Path | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.backend not in get_args(Backend):
            raise unknown_name("back end of Isaac Lab", self.backend, get_args(Backend))


class IsaacLabRobot(OtherEngineRobot):
    """The twin in Isaac Lab; see `golem.robots.base.Robot`.

    Motors, hands, hoist, sensor errors and pictures are those of the MuJoCo twin, whose model is put where Isaac Lab
    has the robot after every step. Limbs do not stop each other, and nothing else in the world moves.
    """

    def __init__(self, profile: str, seed: int, posture: Array, config: IsaacLabConfig | None = None) -> None:
        """Build the world of one episode, which takes up to minutes; see `MujocoRobot`.

        Raises:
            ConfigError: the profile or an option does not exist, Isaac Lab has no such world, or does not run.
            MissingEnvironment: there is no environment with Isaac Lab.
        """
        config = config or IsaacLabConfig()
        python = isaac_python(config.python)
        super().__init__(profile, seed, posture, config)
        model = self._model
        layers = Layers(robot_layer(model), world_layer(model, config.friction))
        joints = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
        names = [model.joint(j).name for j in joints]
        self._begin(joints)
        followers = follower_names().items()
        self._fingers_at = np.array([names.index(finger) for finger, _ in followers])
        self._cranks_at = np.array([names.index(crank) for _, crank in followers])
        self._links = np.flatnonzero(model.body_rootid == model.body_rootid[model.body(BASE_LINK).id])
        links = [model.body(b).name for b in self._links]
        scene: WorkerScene = {
            "backend": config.backend,
            "dt": COARSE_STEP,
            "robot": "",
            "world": "",
            "joints": names,
            "bodies": links,
            "torso": "torso_link",
        }
        self._worker = take_worker(python, scene, layers)
        self._give_back = weakref.finalize(self, keep_worker, self._worker)
        base = self._base.qposadr[0]
        self._worker.ask(place=1.0, root=self.data.qpos[base : base + 7], q=self.data.qpos[self._joint_map.q])
        self.truth: IsaacTruth = IsaacTruth(model, self.data, links)

    @property
    def versions(self) -> dict[str, str]:
        """Versions of what moves the robot, by package."""
        return self._worker.versions

    def _step(self) -> None:
        """Have Isaac Lab make one step under the torques and wrenches of the model's data, and follow it."""
        data, dt, joints = self.data, float(self._model.opt.timestep), self._joint_map
        targets = np.zeros(len(joints.q))
        targets[self._fingers_at] = -data.qpos[joints.q[self._cranks_at]]
        reply = self._worker.ask(q=targets, effort=joints.torques(data), wrench=data.xfrc_applied[self._links])
        data.time += dt
        root, base, torso = reply["root"], reply["base"], reply["torso"]
        self._follow(Motion(root[:3], root[3:], (base[:3], base[3:]), (torso[:3], torso[3:]), reply["q"]), dt)
        self.truth.see(reply["force"])

    def close(self) -> None:
        """Leave the worker to the next robot, and release the rendering context and the LiDAR."""
        self._give_back()
        super().close()
