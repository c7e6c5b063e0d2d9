"""Labels: antipodal proposals on simulated views of wares, and whether a hand that is a little off holds them."""

from __future__ import annotations

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
from golem.robots.sensors.streams import stream
from golem.robots.worlds.tableware import KINDS
from golem.training.grasps.grasp_trial import GraspTrial
from golem.training.grasps.ware_scene import SIDE, WARE, WareDraw, build_world, draw_ware, palm_cloud
from golem.types import Array, Detection, LocalizedObject

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
    draw = draw_ware(rng)
    model = build_world(draw)
    pads = [model.geom(magpie_model.finger_names(SIDE, finger)[2]).id for finger in magpie_model.FINGERS]
    model.geom_friction[pads, 0] = rng.uniform(*FRICTION)
    mass, ware = rng.uniform(*MASS), model.body(WARE).id
    model.body_mass[ware] *= mass
    model.body_inertia[ware] *= mass
    trial = GraspTrial(model)
    grasps, cloud = propose(model, trial.data, draw, rng)
    rest = rng.permutation(np.arange(FIRST, len(grasps)))[: PER_WARE - FIRST]
    tried = [grasps[k] for k in (*range(min(FIRST, len(grasps))), *rest.tolist())]
    held = [trial.held(_off(grasp.T_odom_gripper, rng), grasp.gap) for grasp in tried]
    cells, facts = (
        hand_view(tried, cloud) if tried else (np.zeros((0, SEEN), bool), np.zeros((0, FACTS), np.float32))
    )
    ones = np.ones(len(tried), np.int64)
    return GraspLabels(cells, facts, np.array(held, bool), number * ones, list(KINDS).index(draw.kind) * ones)


def propose(
    model: mujoco.MjModel, data: mujoco.MjData, draw: WareDraw, rng: np.random.Generator
) -> tuple[list[Grasp], Array]:
    """Return what `antipodal` proposes for the ware as a palm camera sees it, and the ware's points (n, 3)."""
    middle = data.xipos[model.body(WARE).id]
    yaw = float(rng.uniform(-np.pi, np.pi))
    place = middle - WATCH * draw.approach + rng.normal(0.0, 0.015, 3)
    T = grasp_pose(place, yaw, -draw.approach)
    camera = T @ np.linalg.inv(magpie_model.T_HAND_GRIPPER) @ magpie_model.T_HAND_CAMERA
    points, own = palm_cloud(model, data, camera, rng)
    seen = points[own]
    if len(seen) < MIN_POINTS:
        return [], seen
    position = seen[int(((seen - np.median(seen, axis=0)) ** 2).sum(axis=1).argmin())]
    target = LocalizedObject(Detection(draw.kind, 1.0, np.zeros(4), np.zeros(2)), 0.0, position, seen)
    grasps = Antipodal().propose(target, points, Gripper(SIDE, T, yaw, draw.approach))
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
