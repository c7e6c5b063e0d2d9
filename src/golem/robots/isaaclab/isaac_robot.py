"""The twin in Isaac Lab: the same robot, motors, sensors and worlds, with the motion of a worker in another process."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal, get_args

import mujoco
import numpy as np

from golem.errors import unknown_name
from golem.robots.isaaclab.isaac_truth import IsaacTruth
from golem.robots.isaaclab.isaac_worker import WorkerScene
from golem.robots.isaaclab.usd_layers import robot_layer, world_layer
from golem.robots.isaaclab.worker_link import Layers, WorkerLink, isaac_python
from golem.robots.model.table import BASE_LINK
from golem.robots.mujoco.other_engine import Motion, OtherEngineConfig, OtherEngineRobot, follower_names
from golem.robots.mujoco.scene import COARSE_STEP
from golem.types import Array

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
        """Check the options.

        Raises:
            ConfigError: one of them is none that Isaac Lab has.
        """
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
        self._worker = WorkerLink(python, scene, layers)
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
        reply = self._worker.ask(
            q=targets, effort=joints.torques(data), wrench=data.xfrc_applied[self._links]
        )
        data.time += dt
        root, base, torso = reply["root"], reply["base"], reply["torso"]
        self._follow(Motion(root[:3], root[3:], (base[:3], base[3:]), (torso[:3], torso[3:]), reply["q"]), dt)
        self.truth.see(reply["force"])

    def close(self) -> None:
        """Leave the worker to the next robot, and release the rendering context and the LiDAR."""
        self._worker.close()
        super().close()
