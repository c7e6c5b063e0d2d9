"""Labels: antipodal proposals on simulated views of wares, and whether a hand that is a little off holds them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from tqdm import tqdm

from golem.capabilities.grasping.antipodal import Antipodal
from golem.capabilities.grasping.base import Grasp, Gripper
from golem.capabilities.grasping.centroid import grasp_pose
from golem.capabilities.grasping.hand_view import FACTS, SEEN, hand_view
from golem.capabilities.grasping.object_cloud import MIN_POINTS, object_points
from golem.robots.model import magpie_model
from golem.robots.model.spatial import quat_of
from golem.robots.mujoco.hand_servos import HandServos
from golem.robots.sensors.streams import stream
from golem.robots.worlds.tableware import KINDS
from golem.training.grasps import ware_scene
from golem.types import Array, Detection, HandCommand, LocalizedObject

BEFORE, SPARE = 0.12, 0.024
"""Distance from which the hand comes, and how much wider it is open than the grasp asks for [m]; as in `take`."""
COMES, CLOSES, HOLDS, RISES, SHAKES = 0.4, 0.9, 0.5, 0.5, 0.8
"""How long each part takes [s]."""
TOUCH, FORCE = 1.0, 16.0
"""Force of each finger until both touch, and then [N]; as `take` has them."""
LIFT = 0.10
"""How high the hand lifts [m]."""
SWING, TILT, RATE = 0.012, 0.12, 3.0
"""The shake: amplitude [m], [rad], and rate [Hz]: 0.4 g, more than any motion of the arm."""
SLIPPED, TURNED = 0.025, 0.5
"""How far a ware that is held may have moved in the hand [m], [rad]."""
T_WRIST_GRIPPER: Array = magpie_model.T_WRIST_HAND @ magpie_model.T_HAND_GRIPPER


class GraspTrial:
    """Tries grasps on one ware, each from the same start."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Let the ware of `model` come to rest."""
        self.model, self.data = model, mujoco.MjData(model)
        self._leader = int(model.body(ware_scene.LEADER).mocapid[0])
        self._ware, self._wrist = model.body(ware_scene.WARE).id, model.body(ware_scene.WRIST).id
        self._wrist_q = int(model.joint(ware_scene.WRIST).qposadr[0])
        self._servos = HandServos(model, ware_scene.SIDE)
        far = np.eye(4)
        far[2, 3] = 1.0
        self._put(far, 0.08)
        for _ in range(200):
            mujoco.mj_step(model, self.data)
        self._start = self.data.qpos.copy()

    def held(self, T: Array, gap: float) -> bool:
        """Return whether a hand that closes at `T` (4, 4), the grasp frame, lifts the ware and keeps it.

        Args:
            T: pose of the grasp frame in the world.
            gap: opening that the grasp asks for [m].
        """
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = self._start
        wide = min(gap + SPARE, magpie_model.MAX_GAP)
        before, above = T.copy(), T.copy()
        before[:3, 3] -= BEFORE * T[:3, 2]
        above[2, 3] += LIFT
        self._put(before, wide)
        self._lead(_line(before, T, COMES), wide, magpie_model.MAX_FORCE)
        self._lead(_still(T, CLOSES), 0.0, TOUCH)
        self._lead(_still(T, HOLDS), 0.0, FORCE)
        first = self._in_hand()
        self._lead(_line(T, above, RISES), 0.0, FORCE)
        self._lead(_shaken(above, SHAKES), 0.0, FORCE)
        last = self._in_hand()
        moved = float(np.linalg.norm(last[:3, 3] - first[:3, 3]))
        turned = Rotation.from_matrix(first[:3, :3].T @ last[:3, :3]).magnitude()
        return moved < SLIPPED and float(turned) < TURNED

    def _put(self, T: Array, gap: float) -> None:
        """Place hand and leader with the grasp frame at `T`, the fingers open by `gap`."""
        wrist = T @ np.linalg.inv(T_WRIST_GRIPPER)
        self.data.qpos[self._wrist_q : self._wrist_q + 7] = [*wrist[:3, 3], *quat_of(wrist[:3, :3])]
        self._servos.reset(self.data, gap)
        self._aim(T)
        mujoco.mj_forward(self.model, self.data)

    def _aim(self, T: Array) -> None:
        wrist = T @ np.linalg.inv(T_WRIST_GRIPPER)
        self.data.mocap_pos[self._leader] = wrist[:3, 3]
        self.data.mocap_quat[self._leader] = quat_of(wrist[:3, :3])

    def _lead(self, poses: Iterable[Array], gap: float, force: float) -> None:
        command = HandCommand(t=0.0, gap=gap, force=force)
        for T in poses:
            self._aim(T)
            self._servos.command(command, ware_scene.STEP)
            self._servos.drive(self.data)
            mujoco.mj_step(self.model, self.data)

    def _in_hand(self) -> Array:
        """Return the (4, 4) pose of the ware's centre of mass in the wrist."""
        R = self.data.xmat[self._wrist].reshape(3, 3)
        T = np.eye(4)
        T[:3, :3] = R.T @ self.data.xmat[self._ware].reshape(3, 3)
        T[:3, 3] = R.T @ (self.data.xipos[self._ware] - self.data.xpos[self._wrist])
        return T


def _line(start: Array, end: Array, seconds: float) -> Iterable[Array]:
    for s in np.linspace(0.0, 1.0, round(seconds / ware_scene.STEP)):
        T = end.copy()
        T[:3, 3] += (1.0 - s * s * (3.0 - 2.0 * s)) * (start - end)[:3, 3]
        yield T


def _still(T: Array, seconds: float) -> Iterable[Array]:
    for _ in range(round(seconds / ware_scene.STEP)):
        yield T


def _shaken(T: Array, seconds: float) -> Iterable[Array]:
    """Yield poses that swing sideways, and tilt."""
    for k in range(round(seconds / ware_scene.STEP)):
        phase = 2.0 * np.pi * RATE * k * ware_scene.STEP
        swung = T.copy()
        swung[:3, :3] = Rotation.from_rotvec([0.0, TILT * np.sin(phase), 0.0]).as_matrix() @ T[:3, :3]
        swung[:3, 3] += SWING * np.array([np.sin(phase), np.sin(0.5 * phase), 0.0])
        yield swung


PER_WARE = 12
"""Proposals that are tried on one ware: the first four, and others at random."""
FIRST = 4
WATCH = 0.12
"""How far before the ware's middle the fingertips are when the palm camera looks [m]."""
OFF, LEANS = 0.003, 0.04
"""Standard deviation of where the hand closes, per axis [m], and of how it is turned, per axis [rad]: what is left at
`field` after the palm camera has looked three times."""
FRICTION, MASS = (0.4, 0.7), (0.6, 1.4)
"""Ranges of the pads' friction, and of the ware's mass, 1 is that of the kitchen's."""
SHARD = 20
"""Wares in one file."""


@dataclass(frozen=True, slots=True)
class GraspLabels:
    """Tried grasps of a split.

    Attributes:
        cells: (n, `SEEN`) pictures; see `hand_view`.
        facts: (n, `FACTS`) numbers.
        held: (n,) whether the hand kept the ware.
        ware: (n,) number of the ware in its split.
        kind: (n,) number of its kind in `KINDS`.
    """

    cells: NDArray[np.bool_]
    facts: NDArray[np.float32]
    held: NDArray[np.bool_]
    ware: NDArray[np.int64]
    kind: NDArray[np.int64]


def label_ware(seed: int, split: str, number: int) -> GraspLabels:
    """Return the labels of one ware; depends on the arguments only."""
    rng = stream(seed, f"grasps/{split}/{number}")
    draw = ware_scene.draw_ware(rng)
    model = ware_scene.build_world(draw)
    pads = [model.geom(magpie_model.finger_names(ware_scene.SIDE, finger)[2]).id for finger in magpie_model.FINGERS]
    model.geom_friction[pads, 0] = rng.uniform(*FRICTION)
    mass, ware = rng.uniform(*MASS), model.body(ware_scene.WARE).id
    model.body_mass[ware] *= mass
    model.body_inertia[ware] *= mass
    trial = GraspTrial(model)
    grasps, cloud = propose(model, trial.data, draw, rng)
    rest = rng.permutation(np.arange(FIRST, len(grasps)))[: PER_WARE - FIRST]
    tried = [grasps[k] for k in (*range(min(FIRST, len(grasps))), *rest.tolist())]
    held = [trial.held(_off(grasp.T_odom_gripper, rng), grasp.gap) for grasp in tried]
    cells, facts = hand_view(tried, cloud) if tried else (np.zeros((0, SEEN), bool), np.zeros((0, FACTS), np.float32))
    ones = np.ones(len(tried), np.int64)
    return GraspLabels(cells, facts, np.array(held, bool), number * ones, list(KINDS).index(draw.kind) * ones)


def propose(
    model: mujoco.MjModel, data: mujoco.MjData, draw: ware_scene.WareDraw, rng: np.random.Generator
) -> tuple[list[Grasp], Array]:
    """Return what `antipodal` proposes for the ware as a palm camera sees it, and the ware's points (n, 3)."""
    middle = data.xipos[model.body(ware_scene.WARE).id]
    yaw = float(rng.uniform(-np.pi, np.pi))
    place = middle - WATCH * draw.approach + rng.normal(0.0, 0.015, 3)
    T = grasp_pose(place, yaw, -draw.approach)
    camera = T @ np.linalg.inv(magpie_model.T_HAND_GRIPPER) @ magpie_model.T_HAND_CAMERA
    points, own = ware_scene.palm_cloud(model, data, camera, rng)
    seen = points[own]
    if len(seen) < MIN_POINTS:
        return [], seen
    position = seen[int(((seen - np.median(seen, axis=0)) ** 2).sum(axis=1).argmin())]
    target = LocalizedObject(Detection(draw.kind, 1.0, np.zeros(4), np.zeros(2)), 0.0, position, seen)
    grasps = Antipodal().propose(target, points, Gripper(ware_scene.SIDE, T, yaw, draw.approach))
    return grasps, object_points(seen, position)


def _off(T: Array, rng: np.random.Generator) -> Array:
    """Return where a hand closes that means to close at `T` (4, 4)."""
    off = T.copy()
    off[:3, :3] = T[:3, :3] @ Rotation.from_rotvec(rng.normal(0.0, LEANS, 3)).as_matrix()
    off[:3, 3] += rng.normal(0.0, OFF, 3)
    return off


def label(folder: Path, seed: int, split: str, wares: int) -> GraspLabels:
    """Try grasps on the wares of a split; files that are there are kept.

    Args:
        folder: where the splits are, one file per `SHARD` wares.
        seed: of the wares.
        split: `"train"` or `"held_out"`; the two never share a ware.
        wares: how many, rounded up to whole files.

    Returns:
        All labels of the split.
    """
    target = folder / split
    target.mkdir(parents=True, exist_ok=True)
    for first in tqdm(range(0, wares, SHARD), desc=f"grasps, {split}"):
        path = target / f"wares_{seed}_{first:05d}.npz"
        if path.exists():
            continue
        some = joined([label_ware(seed, split, k) for k in range(first, first + SHARD)])
        part = path.with_suffix(".part")
        with part.open("wb") as file:
            np.savez_compressed(
                file, cells=np.packbits(some.cells, axis=1), facts=some.facts, held=some.held, ware=some.ware,
                kind=some.kind,
            )  # fmt: skip
        part.rename(path)
    return joined([_read(target / f"wares_{seed}_{first:05d}.npz") for first in range(0, wares, SHARD)])


def _read(path: Path) -> GraspLabels:
    with np.load(path) as file:
        cells = np.unpackbits(file["cells"], axis=1).astype(bool)
        return GraspLabels(cells, file["facts"], file["held"], file["ware"], file["kind"])


def joined(parts: list[GraspLabels]) -> GraspLabels:
    """Return the labels of all of them."""
    return GraspLabels(
        np.concatenate([p.cells for p in parts]),
        np.concatenate([p.facts for p in parts]),
        np.concatenate([p.held for p in parts]),
        np.concatenate([p.ware for p in parts]),
        np.concatenate([p.kind for p in parts]),
    )
