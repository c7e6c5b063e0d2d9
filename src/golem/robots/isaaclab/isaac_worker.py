"""The process that holds the articulation in Isaac Lab: runs in Isaac Lab's own environment, without `golem`.

    python -I isaac_worker.py SCENE

SCENE is a JSON file, see `WorkerScene`. Once the world is built the worker writes one line of JSON to its standard
output: `{"versions": {name: version}}`, or `{"error": sentence}`. Then it answers requests on its standard input with
replies, see `request_type` and `reply_type`, until its input ends. What libraries print goes to its standard error.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
import warnings
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, BinaryIO, TypedDict

import numpy as np
from numpy.typing import NDArray

TOLD = "isaaclab", "newton", "mujoco-warp", "warp-lang", "ovphysx", "torch"
"""Packages whose versions are told."""
WXYZ, XYZW = [3, 0, 1, 2], [1, 2, 3, 0]
"""Isaac Lab has quaternions as xyzw: indices that take one of them to wxyz, and one of ours to xyzw."""
CONSTRAINTS, CONTACTS = 300, 100
"""Room for rows and contacts in Newton's solver."""


class WorkerScene(TypedDict):
    """What is to be simulated.

    Attributes:
        backend: `physx` or `newton`.
        dt: physics step [s].
        robot, world: USD layers, as files.
        joints, bodies: names, in the order of requests and replies.
        torso: the body whose velocity is replied.
    """

    backend: str
    dt: float
    robot: str
    world: str
    joints: list[str]
    bodies: list[str]
    torso: str


def request_type(joints: int, bodies: int) -> np.dtype[np.void]:
    """Return the layout of a request.

    `place`: whether the robot is put where `root` (position [m], quaternion wxyz) and `q` say, at rest; else one step
    is made, with `q` as what the springs of joints that have one pull to. `effort`: torque of every joint [N m].
    `wrench`: force on each body's centre of mass [N] and torque [N m], in the world.
    """
    return np.dtype(
        [
            ("place", "<f8"),
            ("root", "<f8", (7,)),
            ("q", "<f8", (joints,)),
            ("effort", "<f8", (joints,)),
            ("wrench", "<f8", (bodies, 6)),
        ]
    )


def reply_type(joints: int, bodies: int) -> np.dtype[np.void]:
    """Return the layout of a reply.

    `root`: position [m] and quaternion, wxyz, of the base. `base` and `torso`: linear velocity of the link's origin
    [m/s] and angular velocity [rad/s], both in the world. `q`: joints. `force`: of the world on each body [N].
    """
    return np.dtype(
        [
            ("root", "<f8", (7,)),
            ("base", "<f8", (6,)),
            ("torso", "<f8", (6,)),
            ("q", "<f8", (joints,)),
            ("force", "<f8", (bodies, 3)),
        ]
    )


class Simulation:
    """One robot in one world of Isaac Lab."""

    def __init__(self, scene: WorkerScene) -> None:
        """Build the world.

        Raises:
            ImportError: a package of the environment is absent.
            ValueError: the articulation has other joints or bodies than the scene.
        """
        self._torch = importlib.import_module("torch")
        self._torch.set_num_threads(1)
        # OvPhysX asks for pinned memory even on the CPU: it is ordinary memory then.
        warp = importlib.import_module("warp")
        warp.init()
        if not warp.is_cuda_available():
            cpu = warp.get_device("cpu")
            cpu.pinned_allocator = cpu.default_allocator
        sim_utils = importlib.import_module("isaaclab.sim")
        scenes = importlib.import_module("isaaclab.scene")
        assets = importlib.import_module("isaaclab.assets")
        actuators = importlib.import_module("isaaclab.actuators")
        sensors = importlib.import_module("isaaclab.sensors")
        config = sim_utils.SimulationCfg(device="cpu", dt=scene["dt"], physics=_physics(scene["backend"]))
        self._sim, self._dt = sim_utils.SimulationContext(config), scene["dt"]
        cfg = scenes.InteractiveSceneCfg(num_envs=1, env_spacing=1.0)
        cfg.world = assets.AssetBaseCfg(prim_path="/World/Hall", spawn=sim_utils.UsdFileCfg(usd_path=scene["world"]))
        cfg.robot = assets.ArticulationCfg(
            prim_path="{ENV_REGEX_NS}/Robot",
            spawn=sim_utils.UsdFileCfg(usd_path=scene["robot"], activate_contact_sensors=True),
            init_state=assets.ArticulationCfg.InitialStateCfg(pos=(0.0, 0.0, 2.0)),
            actuators={"all": actuators.ImplicitActuatorCfg(joint_names_expr=[".*"], stiffness=None, damping=None)},
        )
        cfg.contact = sensors.ContactSensorCfg(prim_path="{ENV_REGEX_NS}/Robot/.*", update_period=0.0)
        self._scene = scenes.InteractiveScene(cfg)
        self._sim.reset()
        self._scene.reset()
        self._robot, self._contact = self._scene["robot"], self._scene["contact"]
        self._joints = _order(scene["joints"], self._robot.joint_names, "joints")
        self._bodies = _order(scene["bodies"], self._robot.body_names, "bodies")
        self._sensed = _order(scene["bodies"], self._contact.body_names, "contact bodies")
        self._torso = self._robot.body_names.index(scene["torso"])

    def answer(self, request: NDArray[np.void], reply: NDArray[np.void]) -> None:
        """Do what `request` asks and fill `reply`, one record each."""
        if request["place"]:
            self._place(request)
        else:
            self._step(request)
        data = self._robot.data
        pose = data.root_link_pose_w.torch[0].numpy()
        reply["root"][:3], reply["root"][3:] = pose[:3], pose[3:][WXYZ]
        reply["base"] = data.root_link_vel_w.torch[0].numpy()
        reply["torso"] = data.body_link_vel_w.torch[0, self._torso].numpy()
        reply["q"] = data.joint_pos.torch[0].numpy()[self._joints]
        reply["force"] = self._contact.data.net_forces_w.torch[0].numpy()[self._sensed]

    def _place(self, request: NDArray[np.void]) -> None:
        robot, still = self._robot, self._torch.zeros
        self._scene.reset()
        root = np.concatenate([request["root"][:3], request["root"][3:][XYZW]])
        robot.write_root_link_pose_to_sim_index(root_pose=self._row(root))
        robot.write_root_link_velocity_to_sim_index(root_velocity=still((1, 6)))
        q = self._in_order(request["q"])
        robot.write_joint_position_to_sim_index(position=q)
        robot.write_joint_velocity_to_sim_index(velocity=still(tuple(q.shape)))
        self._sim.forward()
        self._scene.update(0.0)

    def _step(self, request: NDArray[np.void]) -> None:
        robot, wrench = self._robot, np.empty_like(request["wrench"])
        wrench[self._bodies] = request["wrench"]
        command = robot.actuators.target_command
        command.set_effort_index(value=self._in_order(request["effort"]))
        command.set_position_index(value=self._in_order(request["q"]))
        robot.permanent_wrench_composer.set_forces_and_torques_index(
            forces=self._row(wrench[:, :3]), torques=self._row(wrench[:, 3:]), is_global=True
        )
        self._scene.write_data_to_sim()
        self._sim.step(render=False)
        self._scene.update(self._dt)

    def _in_order(self, values: NDArray[np.float64]) -> Any:
        """Return one value per joint (n,), as the scene orders them, as the articulation's (1, n) tensor."""
        out = np.empty_like(values)
        out[self._joints] = values
        return self._row(out)

    def _row(self, values: NDArray[np.float64]) -> Any:
        return self._torch.from_numpy(values.astype(np.float32)[None])


def _physics(backend: str) -> Any:
    if backend == "physx":
        return importlib.import_module("isaaclab_ov.physics").OvPhysxCfg()
    newton = importlib.import_module("isaaclab_newton.physics")
    solver = newton.MJWarpSolverCfg(integrator="implicitfast", njmax=CONSTRAINTS, nconmax=CONTACTS)
    return newton.NewtonCfg(solver_cfg=solver, use_cuda_graph=False)


def _order(wanted: list[str], present: list[str], what: str) -> list[int]:
    """Return where in `present` each of the `wanted` names is. Raises ValueError: they are not the same names."""
    if sorted(wanted) != sorted(present):
        raise ValueError(f"Isaac Lab found other {what} than the scene has: {sorted(set(wanted) ^ set(present))}.")
    return [present.index(name) for name in wanted]


def _versions() -> dict[str, str]:
    found: dict[str, str] = {}
    for name in TOLD:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def _serve(scene: WorkerScene, requests: BinaryIO, replies: BinaryIO) -> None:
    """Build `scene`, say how that went, and answer requests until there are no more."""
    sizes = len(scene["joints"]), len(scene["bodies"])
    request, reply = np.zeros((), request_type(*sizes)), np.zeros((), reply_type(*sizes))
    try:
        simulation = Simulation(scene)
    except Exception as error:
        replies.write(json.dumps({"error": f"{type(error).__name__}: {error}"}).encode() + b"\n")
        replies.flush()
        raise
    replies.write(json.dumps({"versions": _versions()}).encode() + b"\n")
    replies.flush()
    while len(received := requests.read(request.nbytes)) == request.nbytes:
        request = np.frombuffer(received, request.dtype)[0]
        simulation.answer(request, reply)
        replies.write(reply.tobytes())
        replies.flush()


def main() -> None:
    """Serve the scene that the command line names, over the standard streams."""
    warnings.simplefilter("ignore")
    scene: WorkerScene = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    with os.fdopen(os.dup(1), "wb") as replies:
        os.dup2(2, 1)
        _serve(scene, sys.stdin.buffer, replies)
    os._exit(0)  # the native libraries' own end takes seconds, and may fail


if __name__ == "__main__":
    main()
