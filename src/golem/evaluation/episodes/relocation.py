"""A room with four counters, in which one object is moved between two walks along the same eight views.

The counters, objects and rates are ours: the paper names its objects, views and observations, and no more than that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from golem.capabilities.memory.base import Observation
from golem.capabilities.perception.lift import unproject
from golem.robots.mujoco.camera import CameraRig
from golem.robots.sensors.cameras import HEAD, T_MUJOCO_OPTICAL
from golem.robots.worlds.tableware import KINDS
from golem.types import Array, Detection, LocalizedObject, Mask, RgbdImage

COUNTER = (0.3, 0.6, 0.45)
"""Half the depth, width and height of a counter [m]."""
AROUND = 1.7
"""Distance of the counters' middles from the middle of the room [m]."""
EYE = 1.55
"""Height of the camera [m]."""
EVERY = 4.0
"""Time between two views [s]."""
PAUSE = 600.0
"""Time between the two walks [s]."""
LEAST_PIXELS = 40
"""Of an object in an image, from which on a localizer can find it."""
DEPTH_NOISE = 0.004
"""Standard deviation of depth at 1 m, growing with its square [m]."""
SPOT = 0.2
"""Least distance of two objects on one counter [m]."""


@dataclass(frozen=True, slots=True)
class Rates:
    """How a localizer fails, and how well the camera's pose is known.

    Attributes:
        missed: share of the visible objects that are not found.
        invented: detections of what is not there, per image.
        confused: share of those found that are named wrongly.
        drift: standard deviation of the error of a walk's poses, constant within a walk [m].
        jitter: the same from view to view [m].
    """

    missed: float = 0.0
    invented: float = 0.0
    confused: float = 0.0
    drift: float = 0.0
    jitter: float = 0.01


@dataclass(frozen=True, slots=True)
class Thing:
    """An object of the room: what it is and where it stands, in the room's frame [m]."""

    kind: str
    position: Array


@dataclass(frozen=True, slots=True)
class Relocation:
    """One episode.

    Attributes:
        target: kind of what is moved.
        before, after: what stands where in the two walks; `before[0]` and `after[0]` are the target.
        absent: kinds of which there is none.
        observations: the two walks' looks, in the order of time.
        moved_at: time at which the target was moved [s].
    """

    target: str
    before: tuple[Thing, ...]
    after: tuple[Thing, ...]
    absent: tuple[str, ...]
    observations: tuple[Observation, ...]
    moved_at: float


def relocation(
    rng: np.random.Generator, rates: Rates, twins: bool = False, hidden: bool = False
) -> Relocation:
    """Draw and render one episode.

    Args:
        rng: the same state gives the same episode.
        rates: of the localizer and the poses.
        twins: a second object of the target's kind stands elsewhere all the time.
        hidden: something stands before the target's old place in the second walk.
    """
    kinds = [str(kind) for kind in rng.permutation(list(KINDS))]
    target, bystander, absent = kinds[0], kinds[1], tuple(kinds[2:])
    counters = rng.permutation(4)
    spots = [_spots(rng, counter, 3) for counter in counters]
    others = [Thing(bystander, spots[2][0])]
    if twins:
        others.append(Thing(target, spots[3][0]))
    before = (Thing(target, spots[0][0]), *others)
    after = (Thing(target, spots[1][0]), *others)
    clutter = [spots[k][1] for k in range(4)] + [spots[0][2]]
    screens = [_before(spots[0][0], float(counters[0]) * np.pi / 2)] if hidden else []
    first = _walk(rng, before, clutter, [], rates, 0.0)
    moved_at = first[-1].frame.t + PAUSE / 2
    second = _walk(rng, after, clutter, screens, rates, first[-1].frame.t + PAUSE)
    return Relocation(target, before, after, absent, (*first, *second), moved_at)


def _spots(rng: np.random.Generator, counter: int, count: int) -> list[Array]:
    """Return places on top of a counter, apart from each other."""
    places: list[Array] = []
    while len(places) < count:
        local = rng.uniform((-0.15, -0.45), (0.15, 0.45))
        if all(np.linalg.norm(local - other[:2]) > SPOT for other in places):
            places.append(np.array([*local, 2.0 * COUNTER[2]]))
    turn = Rotation.from_euler("z", counter * np.pi / 2)
    return [turn.apply(place + (AROUND, 0.0, 0.0)) for place in places]


def _before(place: Array, heading: float) -> Array:
    """Return the place 0.16 m before an object, as seen from the middle of the room."""
    return place - 0.16 * np.array([np.cos(heading), np.sin(heading), 0.0])


def _walk(
    rng: np.random.Generator,
    things: Sequence[Thing],
    clutter: Sequence[Array],
    screens: Sequence[Array],
    rates: Rates,
    start: float,
) -> list[Observation]:
    """Render the eight views of one walk, two of each counter."""
    model, owners = _model(things, clutter, screens)
    data = mujoco.MjData(model)
    drift = rates.drift * rng.standard_normal(3) * (1.0, 1.0, 0.0)
    looks: list[Observation] = []
    with CameraRig(model, [HEAD]) as rig:
        for k in range(8):
            T = _view(k)
            _place_camera(data, T)
            mujoco.mj_forward(model, data)
            rgb, depth = rig.render(data, HEAD.name)
            segments = rig.segment(data, HEAD.name)
            depth += (DEPTH_NOISE * depth**2 * rng.standard_normal(depth.shape)).astype(np.float32)
            depth[(depth < HEAD.near) | (depth > HEAD.far)] = 0.0
            believed = T.copy()
            believed[:3, 3] += drift + rates.jitter * rng.standard_normal(3)
            frame = RgbdImage(start + EVERY * k, HEAD, rgb, depth, believed)
            found = _localize(rng, frame, segments, things, owners, rates)
            sigma = float(np.hypot(rates.drift, rates.jitter))
            looks.append(Observation(frame, found, tuple(KINDS), sigma))
    return looks


def _view(k: int) -> Array:
    """Return the (4, 4) pose of the camera's optical frame in view k: from the middle, to each side of a counter."""
    heading = (k // 2) * np.pi / 2 + (0.17 if k % 2 else -0.17)
    R = Rotation.from_euler("ZY", [heading, 0.55]).as_matrix()
    T = np.eye(4)
    T[:3, :3] = R @ np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    T[:3, 3] = (-0.1 * np.cos(heading), -0.1 * np.sin(heading), EYE)
    return T


def _place_camera(data: mujoco.MjData, T_optical: Array) -> None:
    T = T_optical @ T_MUJOCO_OPTICAL
    data.mocap_pos[0] = T[:3, 3]
    data.mocap_quat[0] = Rotation.from_matrix(T[:3, :3]).as_quat(scalar_first=True)


def _model(
    things: Sequence[Thing], clutter: Sequence[Array], screens: Sequence[Array]
) -> tuple[mujoco.MjModel, list[int]]:
    """Compile the room, and return the geoms of `things` with it."""
    spec = mujoco.MjSpec()
    box, cylinder = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER
    world = spec.worldbody
    world.add_light(pos=[0, 0, 3], dir=[0, 0, -1])
    world.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[4, 4, 0.1], rgba=[0.5, 0.5, 0.5, 1])
    for side in range(4):
        turn = Rotation.from_euler("z", side * np.pi / 2)
        quat = turn.as_quat(scalar_first=True).tolist()
        at = turn.apply([AROUND, 0.0, COUNTER[2]]).tolist()
        world.add_geom(type=box, size=list(COUNTER), pos=at, quat=quat, rgba=[0.7, 0.65, 0.6, 1])
        wall = turn.apply([AROUND + 0.5, 0.0, 1.25]).tolist()
        world.add_geom(type=box, size=[0.05, 2.2, 1.25], pos=wall, quat=quat, rgba=[0.9, 0.9, 0.85, 1])
    for at in clutter:
        place = (at + (0.0, 0.0, 0.05)).tolist()
        world.add_geom(type=box, size=[0.05, 0.06, 0.05], pos=place, rgba=[0.4, 0.3, 0.2, 1])
    for at in screens:
        place = (at + (0.0, 0.0, 0.15)).tolist()
        world.add_geom(type=cylinder, size=[0.09, 0.15, 0], pos=place, rgba=[0.2, 0.4, 0.3, 1])
    for k, thing in enumerate(things):
        radius, height = KINDS[thing.kind]
        place = (thing.position + (0.0, 0.0, height / 2)).tolist()
        world.add_geom(
            name=f"thing_{k}", type=cylinder, size=[radius, height / 2, 0], pos=place, rgba=[0.8, 0.2, 0.2, 1]
        )
    world.add_body(name="eye", mocap=True).add_camera(name=HEAD.name)
    model = spec.compile()
    return model, [model.geom(f"thing_{k}").id for k in range(len(things))]


def _localize(
    rng: np.random.Generator,
    frame: RgbdImage,
    segments: np.ndarray,
    things: Sequence[Thing],
    owners: Sequence[int],
    rates: Rates,
) -> list[LocalizedObject]:
    """Return what a localizer with these rates finds."""
    found: list[LocalizedObject] = []
    for thing, geom in zip(things, owners, strict=True):
        label, luck, swap = thing.kind, float(rng.random()), float(rng.random())
        wrong = str(rng.choice([kind for kind in KINDS if kind != label]))
        pixels = (segments == geom) & (frame.depth > 0.0)
        if luck < rates.missed or np.count_nonzero(segments == geom) < LEAST_PIXELS or not pixels.any():
            continue
        found.append(_located(frame, pixels, wrong if swap < rates.confused else label))
    for _ in range(int(rng.poisson(rates.invented))):
        x, y = rng.integers((40, 40), (HEAD.width - 40, HEAD.height - 40))
        pixels = np.zeros(frame.depth.shape, bool)
        pixels[y - 12 : y + 12, x - 8 : x + 8] = True
        pixels &= frame.depth > 0.0
        if pixels.any():
            thing = _located(frame, pixels, str(rng.choice(list(KINDS))))
            found.append(replace(thing, detection=replace(thing.detection, score=0.5)))
    return found


def _located(frame: RgbdImage, pixels: np.ndarray, label: str) -> LocalizedObject:
    rows, columns = np.nonzero(pixels)
    y0, y1, x0, x1 = rows.min(), rows.max() + 1, columns.min(), columns.max() + 1
    mask = Mask(pixels[y0:y1, x0:x1], int(x0), int(y0))
    points = unproject(frame, mask)
    box = np.array([x0, y0, x1, y1], float)
    detection = Detection(label, 0.9, box, (box[:2] + box[2:]) / 2)
    return LocalizedObject(detection, frame.t, np.median(points, axis=0), points, mask)
