"""A room with four counters, in which one object is moved between two walks along the same eight views.

The counters, objects and rates are ours: the paper names its objects, views and observations, and no more than that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from golem.capabilities.memory.base import Observation
from golem.capabilities.perception.lift import unproject
from golem.capabilities.perception.plane_clusters import PlaneClusters, PlaneClustersConfig
from golem.robots.mujoco.camera import CameraRig
from golem.robots.sensors.cameras import HEAD, T_MUJOCO_OPTICAL
from golem.robots.worlds.hall import add_materials
from golem.robots.worlds.tableware import COLOURS, KINDS, add_object
from golem.types import Array, Detection, LocalizedObject, Mask, RgbdImage

COUNTER = (0.3, 0.6, 0.45)
"""Half the depth, width and height of a counter [m]."""
AROUND = 1.7
"""Distance of the counters' middles from the middle of the room [m]."""
EYE, AHEAD = 1.55, 0.5
"""Height of the camera, and how far it goes from the middle of the room towards the counter that it looks at [m]."""
ASIDE, DOWN = 0.3, 0.6
"""Heading of a view off the counter's middle, to either side, and how far the camera looks down [rad]."""
VIEWS = 8
"""Views of one walk, two of each counter."""
CLUTTER = (0.09, 0.12, 0.09)
"""Half the sides of a box that stands around [m]."""
DAY, DUSK = 0.8, 0.15
"""Brightness of the lamp in bright and in bad light, 0 to 1."""


@dataclass(frozen=True, slots=True)
class Thing:
    """An object of the room: what it is and where it stands, in the room's frame [m]."""

    kind: str
    position: Array


@dataclass(frozen=True, slots=True)
class RelocationRoom:
    """What stands where during one walk.

    Attributes:
        things: what may be asked for.
        clutter: middles of the undersides of boxes [m].
        screens: middles of the undersides of what hides something [m].
        dusk: whether the light is bad.
    """

    things: tuple[Thing, ...]
    clutter: tuple[Array, ...] = ()
    screens: tuple[Array, ...] = ()
    dusk: bool = False


def view(k: int) -> Array:
    """Return the (4, 4) pose of the camera's optical frame in view k: before a counter, to a side of its middle."""
    counter = (k // 2) * np.pi / 2
    R = Rotation.from_euler("ZY", [counter + (ASIDE if k % 2 else -ASIDE), DOWN]).as_matrix()
    T = np.eye(4)
    T[:3, :3] = R @ np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    T[:3, 3] = (AHEAD * np.cos(counter), AHEAD * np.sin(counter), EYE)
    return T


def place_camera(data: mujoco.MjData, T_optical: Array) -> None:
    """Put the camera where its optical frame is at the (4, 4) pose `T_optical`."""
    T = T_optical @ T_MUJOCO_OPTICAL
    data.mocap_pos[0] = T[:3, 3]
    data.mocap_quat[0] = Rotation.from_matrix(T[:3, :3]).as_quat(scalar_first=True)


def compile_room(room: RelocationRoom) -> tuple[mujoco.MjModel, Mapping[int, int]]:
    """Compile a room, and return with it which geom belongs to which of its things."""
    spec = mujoco.MjSpec()
    add_materials(spec)
    box, cylinder = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER
    world = spec.worldbody
    light = DUSK if room.dusk else DAY
    spec.visual.headlight.ambient = [0.5 * light] * 3
    spec.visual.headlight.diffuse = [0.5 * light] * 3
    world.add_light(pos=[0, 0, 3], dir=[0, 0, -1], diffuse=[light] * 3)
    world.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[4, 4, 0.1], rgba=[0.5, 0.5, 0.5, 1])
    for side in range(4):
        turn = Rotation.from_euler("z", side * np.pi / 2)
        quat = turn.as_quat(scalar_first=True).tolist()
        at = turn.apply([AROUND, 0.0, COUNTER[2]]).tolist()
        world.add_geom(type=box, size=list(COUNTER), pos=at, quat=quat, rgba=[0.7, 0.65, 0.6, 1])
        wall = turn.apply([AROUND + 0.5, 0.0, 1.25]).tolist()
        world.add_geom(type=box, size=[0.05, 2.2, 1.25], pos=wall, quat=quat, rgba=[0.9, 0.9, 0.85, 1])
    for at in room.clutter:
        place = (at + (0.0, 0.0, CLUTTER[2])).tolist()
        world.add_geom(type=box, size=list(CLUTTER), pos=place, rgba=[0.4, 0.3, 0.2, 1])
    for at in room.screens:
        place = (at + (0.0, 0.0, 0.15)).tolist()
        world.add_geom(type=cylinder, size=[0.09, 0.15, 0], pos=place, rgba=[0.2, 0.4, 0.3, 1])
    names: list[Sequence[str]] = []
    for k, thing in enumerate(room.things):
        x, y, z = thing.position.tolist()
        colour = COLOURS[thing.kind][0]
        names.append(add_object(spec, thing.kind, f"thing_{k}", (x, y, z), 0.0, colour, loose=False))
    world.add_body(name="eye", mocap=True).add_camera(name=HEAD.name)
    model = spec.compile()
    return model, {model.geom(name).id: k for k, geoms in enumerate(names) for name in geoms}


EVERY = 4.0
"""Time between two views [s]."""
PAUSE, HOUR = 600.0, 3600.0
"""Time between two walks, and between those of a day [s]."""
LEAST_PIXELS = 40
"""Of an object in an image, from which on a localizer can find it."""
DEPTH_NOISE = 0.004
"""Standard deviation of depth at 1 m, growing with its square [m]."""
SPOT = 0.25
"""Least distance of two objects on one counter [m]."""
SHIPPED = PlaneClustersConfig(far=2.6, wide=0.03, thick=0.003)
"""Options of the shipped localizer: counters are farther than doors, depth is better than `field`."""
STRANGE = 40
"""Kinds of the things in other rooms."""
PER_LOOK = 10
"""Of those things in one look."""


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
class Setting:
    """What an episode is made with.

    Attributes:
        rates: of a localizer that is drawn from the renderer's masks, and of the poses.
        clusters: whether the shipped localizer of tableware looks at the images instead.
        twins: a second object of the target's kind stands elsewhere all the time.
        hidden: something stands before the target's old place in the last walk.
        dusk: the light is bad in the last walk.
        walks: how many there are in all. The target is moved before the last, and of more than two before every sixth.
        distractors: things of other kinds in other rooms, seen before the first walk.
    """

    rates: Rates = Rates()
    clusters: bool = False
    twins: bool = False
    hidden: bool = False
    dusk: bool = False
    walks: int = 2
    distractors: int = 0


@dataclass(frozen=True, slots=True)
class Relocation:
    """One episode.

    Attributes:
        target: kind of what is moved.
        before, after: what stands where before and after it was moved last; `before[0]` and `after[0]` are the target.
        absent: kinds of which there is none.
        observations: the looks, in the order of time.
        split: how many of them are from before it was moved last.
        at_old: whether the target stood at its old place, `before[0]`, at each look; else it stood at `after[0]`.
    """

    target: str
    before: tuple[Thing, ...]
    after: tuple[Thing, ...]
    absent: tuple[str, ...]
    observations: tuple[Observation, ...]
    split: int
    at_old: tuple[bool, ...]


def relocation(rng: np.random.Generator, setting: Setting) -> Relocation:
    """Draw and render one episode; the same state of `rng` gives the same one."""
    kinds = [str(kind) for kind in rng.permutation(list(KINDS))]
    target, bystander, absent = kinds[0], kinds[1], tuple(kinds[2:])
    counters = rng.permutation(4)
    spots = [_spots(rng, counter, 3) for counter in counters]
    others = [Thing(bystander, spots[2][0])]
    if setting.twins:
        others.append(Thing(target, spots[3][0]))
    clutter = tuple([spots[k][1] for k in range(4)] + [spots[0][2]])
    # The target goes to and fro, so that it comes from the first counter to the second at last.
    olds = [(setting.walks - 2 - k) // 6 % 2 == 0 for k in range(setting.walks - 1)]
    looks = _elsewhere(rng, setting.distractors, tuple(KINDS))
    at_old = [olds[0]] * len(looks)
    start = looks[-1].frame.t + PAUSE if looks else 0.0
    pause = PAUSE if setting.walks == 2 else HOUR
    for old in olds:
        room = RelocationRoom((Thing(target, spots[0 if old else 1][0]), *others), clutter)
        at_old += [old] * VIEWS
        looks += _walk(rng, room, setting, start)
        start = looks[-1].frame.t + pause
    split = len(looks)
    heading = float(counters[0]) * np.pi / 2
    # 16 cm before it, as seen from the middle of the room.
    before = spots[0][0] - 0.16 * np.array([np.cos(heading), np.sin(heading), 0.0])
    screens = (before,) if setting.hidden else ()
    after = (Thing(target, spots[1][0]), *others)
    looks += _walk(rng, RelocationRoom(after, clutter, screens, setting.dusk), setting, start)
    before = (Thing(target, spots[0][0]), *others)
    at_old += [False] * VIEWS
    return Relocation(target, before, after, absent, tuple(looks), split, tuple(at_old))


def _elsewhere(rng: np.random.Generator, count: int, labels: Sequence[str]) -> list[Observation]:
    """Return looks at `count` things of other kinds in other rooms; their images are not rendered."""
    info = replace(HEAD, width=32, height=24)
    looks: list[Observation] = []
    for k in range(0, count, PER_LOOK):
        far = rng.uniform(8.0, 40.0)
        frame = RgbdImage(
            EVERY * len(looks), info, np.zeros((24, 32, 3), np.uint8), np.zeros((24, 32), np.float32), np.eye(4)
        )
        found: list[LocalizedObject] = []
        for _ in range(min(PER_LOOK, count - k)):
            position = np.array([far, 0.0, 0.9]) + rng.uniform(-3.0, 3.0, 3) * (1.0, 1.0, 0.0)
            box = np.array([10.0, 10.0, 16.0, 16.0])
            detection = Detection(f"thing {rng.integers(STRANGE)}", 0.9, box, (box[:2] + box[2:]) / 2)
            mask = Mask(np.ones((6, 6), bool), 10, 10)
            found.append(LocalizedObject(detection, frame.t, position, position[None], mask))
        looks.append(Observation(frame, found, (*labels, *(f"thing {i}" for i in range(STRANGE)))))
    return looks


def _spots(rng: np.random.Generator, counter: int, count: int) -> list[Array]:
    places: list[Array] = []
    while len(places) < count:
        local = rng.uniform((-0.15, -0.45), (0.15, 0.45))
        if all(np.linalg.norm(local - other[:2]) > SPOT for other in places):
            places.append(np.array([*local, 2.0 * COUNTER[2]]))
    turn = Rotation.from_euler("z", counter * np.pi / 2)
    return [turn.apply(place + (AROUND, 0.0, 0.0)) for place in places]


def _walk(rng: np.random.Generator, room: RelocationRoom, setting: Setting, start: float) -> list[Observation]:
    """Render the eight views of one walk, two of each counter."""
    rates = setting.rates
    model, owners = compile_room(room)
    data = mujoco.MjData(model)
    drift = rates.drift * rng.standard_normal(3) * (1.0, 1.0, 0.0)
    shipped = PlaneClusters(SHIPPED) if setting.clusters else None
    looks: list[Observation] = []
    with CameraRig(model, [HEAD]) as rig:
        for k in range(VIEWS):
            T = view(k)
            place_camera(data, T)
            mujoco.mj_forward(model, data)
            rgb, depth = rig.render(data, HEAD.name)
            depth += (DEPTH_NOISE * depth**2 * rng.standard_normal(depth.shape)).astype(np.float32)
            depth[(depth < HEAD.near) | (depth > HEAD.far)] = 0.0
            believed = T.copy()
            believed[:3, 3] += drift + rates.jitter * rng.standard_normal(3)
            frame = RgbdImage(start + EVERY * k, HEAD, rgb, depth, believed)
            if shipped is None:
                found = _localize(rng, frame, rig.segment(data, HEAD.name), room.things, owners, rates)
            else:
                found = shipped.locate(frame, tuple(KINDS))
            sigma = float(np.hypot(rates.drift, rates.jitter))
            looks.append(Observation(frame, found, tuple(KINDS), sigma))
    return looks


def _localize(
    rng: np.random.Generator,
    frame: RgbdImage,
    segments: np.ndarray,
    things: Sequence[Thing],
    owners: Mapping[int, int],
    rates: Rates,
) -> list[LocalizedObject]:
    found: list[LocalizedObject] = []
    for k, thing in enumerate(things):
        label, luck, swap = thing.kind, float(rng.random()), float(rng.random())
        wrong = str(rng.choice([kind for kind in KINDS if kind != label]))
        shown = np.isin(segments, [geom for geom, owner in owners.items() if owner == k])
        pixels = shown & (frame.depth > 0.0)
        if luck < rates.missed or np.count_nonzero(shown) < LEAST_PIXELS or not pixels.any():
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
