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
from golem.robots.model.mjcf import add_hand
from golem.robots.model.spatial import quat_of
from golem.robots.mujoco.hand_servos import HandServos
from golem.robots.sensors.cameras import RIGHT_HAND, rays
from golem.robots.sensors.depth import STEREO
from golem.robots.sensors.profiles import D400
from golem.robots.sensors.streams import stream
from golem.robots.worlds import hall, parts
from golem.robots.worlds.kitchen import GRIP
from golem.robots.worlds.tableware import COLOURS, KINDS, add_object
from golem.types import Array, Detection, HandCommand, LocalizedObject

SIDE = "right"
WARE, WRIST, LEADER = "ware", f"{SIDE}_wrist_yaw_link", "leader"
WRIST_MASS, WRIST_INERTIA = 1.0, 0.003
"""What of a forearm moves with the hand [kg], [kg m^2]."""
STEP = 0.002
"""Physics step [s], as that of the twin."""
EVERY = 3
"""Every so many pixels of the palm camera have a ray."""
SIZES = (0.8, 1.2)
"""Range of the wares' size, 1 is that of the kitchen's."""


@dataclass(frozen=True, slots=True)
class WareDraw:
    """One ware on the table: its kind, size and heading [rad], and the hand's wanted approach (3,)."""

    kind: str
    size: float
    yaw: float
    approach: Array


def draw_ware(rng: np.random.Generator) -> WareDraw:
    """Return a ware of `KINDS`, to be taken from above, or forward with a lean as `take` does."""
    kind = str(rng.choice(list(KINDS)))
    size, yaw, heading = float(rng.uniform(*SIZES)), *(float(a) for a in rng.uniform(-np.pi, np.pi, 2))
    lean = 0.5 * np.pi if rng.random() < 0.65 else 0.5
    lean += float(rng.normal(0.0, 0.04))
    flat = np.cos(lean)
    approach = np.array([flat * np.cos(heading), flat * np.sin(heading), -np.sin(lean)])
    return WareDraw(kind, size, yaw, approach)


def build_world(draw: WareDraw) -> mujoco.MjModel:
    """Return the compiled world: the table's top is at z = 0, the ware stands on the origin."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_NATIVECCD
    spec.option.impratio, spec.option.cone = GRIP, mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.timestep = STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    hall.add_materials(spec)
    box, top = mujoco.mjtGeom.mjGEOM_BOX, (0.6, 0.6, 0.02)
    parts.collider(spec.worldbody, box, top, (0.0, 0.0, -0.02), friction=0.7)
    parts.visual(spec.worldbody, box, top, (0.0, 0.0, -0.02), material="steel")
    add_object(spec, draw.kind, WARE, (0.0, 0.0, 0.0), draw.yaw, COLOURS[draw.kind][0], size=draw.size)
    spec.worldbody.add_body(name=LEADER, mocap=True)
    wrist = spec.worldbody.add_body(
        name=WRIST, mass=WRIST_MASS, inertia=[WRIST_INERTIA] * 3, explicitinertial=True, pos=[0.0, 0.0, 1.0],
        ipos=[0.0, 0.0, 0.0],
    )  # fmt: skip
    wrist.add_freejoint(name=WRIST)
    add_hand(spec, SIDE)
    for body in [wrist, *wrist.find_all(mujoco.mjtObj.mjOBJ_BODY)]:
        body.gravcomp = 1.0
    spec.add_equality(
        type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY, name1=LEADER, name2=WRIST,
        data=[0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0],
    )  # fmt: skip
    return spec.compile()


def palm_cloud(
    model: mujoco.MjModel, data: mujoco.MjData, T: Array, rng: np.random.Generator
) -> tuple[Array, NDArray[np.bool_]]:
    """Return what a palm camera at `T` (4, 4) shows: (n, 3) points [m], and (n,) whether they are the ware's.

    Depth has the noise of the profile `field`.
    """
    grid = rays(RIGHT_HAND)[::EVERY, ::EVERY].reshape(-1, 3)
    ways = grid / np.linalg.norm(grid, axis=1, keepdims=True) @ T[:3, :3].T
    geoms, distances = np.zeros(len(ways), np.int32), np.zeros(len(ways))
    groups = np.array([0, 0, 1, 0, 0, 0], np.uint8)
    mujoco.mj_multiRay(
        model, data, T[:3, 3], ways.ravel(), groups, 1, -1, geoms, distances, None, len(ways), RIGHT_HAND.far
    )
    hit = geoms >= 0
    depth = distances[hit] * (ways[hit] @ T[:3, 2])
    stereo = STEREO[RIGHT_HAND.name]
    noise = depth**2 * D400.subpixel / (stereo.focal * stereo.baseline) * rng.standard_normal(len(depth))
    points = T[:3, 3] + ways[hit] * (distances[hit] * (1.0 + noise / depth))[:, None]
    return points, model.geom_bodyid[geoms[hit]] == model.body(WARE).id


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
        self._leader = int(model.body(LEADER).mocapid[0])
        self._ware, self._wrist = model.body(WARE).id, model.body(WRIST).id
        self._wrist_q = int(model.joint(WRIST).qposadr[0])
        self._servos = HandServos(model, SIDE)
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
            self._servos.command(command, STEP)
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
    for s in np.linspace(0.0, 1.0, round(seconds / STEP)):
        T = end.copy()
        T[:3, 3] += (1.0 - s * s * (3.0 - 2.0 * s)) * (start - end)[:3, 3]
        yield T


def _still(T: Array, seconds: float) -> Iterable[Array]:
    for _ in range(round(seconds / STEP)):
        yield T


def _shaken(T: Array, seconds: float) -> Iterable[Array]:
    """Yield poses that swing sideways, and tilt."""
    for k in range(round(seconds / STEP)):
        phase = 2.0 * np.pi * RATE * k * STEP
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
    cells, facts = hand_view(tried, cloud) if tried else (np.zeros((0, SEEN), bool), np.zeros((0, FACTS), np.float32))
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
    """Try grasps on the wares of a split; return all labels. Files that are there are kept.

    Args:
        folder: where the splits are, one file per `SHARD` wares.
        seed: of the wares.
        split: `"train"` or `"held_out"`; the two never share a ware.
        wares: how many, rounded up to whole files.
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
    rows = ((p.cells, p.facts, p.held, p.ware, p.kind) for p in parts)
    return GraspLabels(*map(np.concatenate, zip(*rows, strict=True)))
