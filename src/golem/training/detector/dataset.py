"""Renders and stores labelled images: one folder per split, one file per world, packs and kitchens."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from itertools import chain
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from tqdm import tqdm

from golem.robots.mujoco.auto_exposure import AutoExposure
from golem.robots.sensors.cameras import CAMERAS
from golem.robots.sensors.streams import stream
from golem.robots.worlds.conditions import Conditions, draw_conditions
from golem.robots.worlds.fridge import HINGE
from golem.robots.worlds.kitchen import FRONTS, STEELS, TOPS, add_kitchen, draw_counter, draw_kitchen
from golem.robots.worlds.tableware import COLOURS, KINDS
from golem.training.detector import random_scene
from golem.training.detector.labels import COLUMNS, label_image
from golem.training.detector.random_pack import RandomPack
from golem.training.detector.random_scene import RandomScene
from golem.types import Array, CameraInfo

SIZES = 0.25
"""How much larger or smaller than its kind a thing is at most, as a share."""
LYING = 0.12
"""Share of the things that lie on their side."""
GONE = 0.15
"""Share of the things that are not there."""


class RandomKitchen(RandomScene):
    """A compiled random kitchen."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Compile a kitchen with a random counter, things of random sizes, and distractors."""
        spec, plain = random_scene.begin(rng)
        raised = float(rng.uniform(-0.15, 0.05))
        random_counter = rng.random() < 0.5
        self.layout = draw_counter(rng, raised, sizes=SIZES) if random_counter else draw_kitchen(rng, raised)
        super().__init__(spec, plain, rng, add_kitchen(spec, self.layout))

    def randomise_looks(self, rng: np.random.Generator) -> Conditions:
        """Draw colours of furniture, things, robot and distractors, and the lights; see `RandomScene`."""
        model = self.model
        wild = rng.random() < 0.6
        palettes = {"cabinet": FRONTS, "counter_top": TOPS, "fridge_steel": STEELS} | {
            f"{thing.body}_coat": COLOURS[thing.kind] for thing in self.layout.things
        }
        for name, colours in palettes.items():
            mat = model.material(name).id
            base = np.array(colours[int(rng.integers(len(colours)))])
            if wild and rng.random() < 0.5:
                base = random_scene.random_colour(rng)
            tint = np.exp(0.15 * rng.standard_normal()) * np.exp(0.08 * rng.standard_normal(3))
            model.mat_rgba[mat, :3] = np.clip(base * tint, 0.0, 1.0)
            model.mat_specular[mat], model.mat_shininess[mat] = rng.uniform((0.1, 0.1), (0.8, 0.8))
        bar = model.material("fridge_bar").id
        model.mat_rgba[bar, :3] = random_scene.random_colour(rng) if wild else rng.choice([0.25, 0.8]) * np.ones(3)
        self.randomise_robot(wild, rng)
        self.randomise_lights(rng)
        return draw_conditions("varied", {}, rng)

    def randomise_objects(self, rng: np.random.Generator) -> None:
        """Move the things about the counter, lay some on their side, open the fridge, scatter distractors."""
        model, data, layout = self.model, self.data, self.layout
        mujoco.mj_resetData(model, data)
        if rng.random() < 0.3:
            data.qpos[model.joint(HINGE).qposadr[0]] = rng.uniform(0.0, 1.2)
        sides = [thing.position[1] for thing in layout.things]
        low = np.array([layout.counter_front + 0.06, min(sides) - 0.1, layout.counter_top])
        high = np.array([layout.counter_front + 0.5, max(sides) + 0.1, layout.counter_top])
        placed: list[tuple[Array, float]] = []
        for thing in layout.things:
            at = model.joint(thing.body).qposadr[0]
            radius, height = (thing.size * length for length in KINDS[thing.kind])
            spot = rng.uniform(low, high)
            for _ in range(20):
                if all(np.hypot(*(spot - other)[:2]) > radius + r + 0.01 for other, r in placed):
                    break
                spot = rng.uniform(low, high)
            else:
                spot = random_scene.AWAY
            if rng.random() < GONE:
                spot = random_scene.AWAY
            placed.append((spot, radius))
            turn = Rotation.from_euler("z", rng.uniform(-np.pi, np.pi))
            if thing.kind != "bowl" and rng.random() < LYING:
                turn = turn * Rotation.from_euler("y", np.pi / 2)
                spot = spot + (0.0, 0.0, radius) - 0.5 * height * turn.as_matrix()[:, 2]
            data.qpos[at : at + 3] = spot
            data.qpos[at + 3 : at + 7] = turn.as_quat(scalar_first=True)
        self.scatter(low, high + (0.0, 0.0, 0.012), rng)
        self.pose_arms(rng)

    def place_head(self, rng: np.random.Generator) -> CameraInfo:
        """Stand the robot before the fridge or along the counter, looking at it; returns the camera."""
        handle = next(part for part in self.parts if part.label == "handle")
        place = handle.position if rng.random() < 0.3 else self._random_place(rng)
        at = np.array([rng.uniform(-0.35, 0.1), place[1] + rng.uniform(-0.4, 0.4), rng.uniform(0.95, 1.15)])
        return self.stand(at, rng)

    def place_palm(self, rng: np.random.Generator) -> CameraInfo:
        """Carry a palm camera to where it looks at a random part, from above or from ahead; returns the camera."""
        self.refresh()
        info = CAMERAS[f"{random_scene.random_side(rng)}_hand"]
        places = {part.geoms: self.data.geom_xpos[self.model.geom(part.geoms[0]).id] for part in self.parts}
        there = tuple(part for part in self.parts if places[part.geoms][2] > 0.0)
        part = random_scene.random_part(there, rng)
        target = places[part.geoms].copy()
        distance = float(np.exp(rng.uniform(np.log(0.12), np.log(0.60))))
        pitch = rng.uniform(0.0, 0.35) if part.label == "handle" else rng.uniform(0.2, np.pi / 2)
        view = looking(rng.normal(0.0, 0.4), pitch, rng.uniform(-np.pi, np.pi))
        self.carry(info, random_scene.aim(info, target, view, distance, rng))
        return info

    def _random_place(self, rng: np.random.Generator) -> Array:
        things = self.layout.things
        return np.array(things[int(rng.integers(len(things)))].position)


def looking(heading: float, pitch: float, roll: float) -> Array:
    """Return the (3, 3) orientation of an optical frame that looks along `heading`, `pitch` down, turned by `roll`.

    Args:
        heading: 0 is along x of the world [rad].
        pitch: 0 is level, pi / 2 straight down [rad].
        roll: about the optical axis; at 0 the image is upright [rad].
    """
    upright = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    turn = Rotation.from_euler("ZY", [heading, pitch]).as_matrix()
    return turn @ upright @ Rotation.from_euler("z", roll).as_matrix()


BUILDERS: dict[str, Callable[[np.random.Generator], RandomScene]] = {"pack": RandomPack, "kitchen": RandomKitchen}
"""What compiles a world, by its kind."""
JPEG_QUALITY = 96
CONDITIONS = ("finish", "cover", "tray", "light")
"""What is kept of an image's conditions; the light as the name of its range."""
LIGHTS = {"dim": 0.3, "low": 0.7, "nominal": 1.4, "bright": np.inf}
"""Upper ends of the ranges of the light's level, 1 is nominal."""
FANCY_SHARE = 0.25
"""Share of the images with shadows and smooth edges."""


class Labelled(NamedTuple):
    """One image of a split.

    Attributes:
        image: (height, width, 3) RGB, decoded: 5 GB for the default training split.
        labels: (n, 8), columns as in `labels.COLUMNS`.
        camera: `"head"` or `"palm"`.
        conditions: the values of `CONDITIONS`, and the kind of its `world`.
    """

    image: NDArray[np.uint8]
    labels: Array
    camera: str
    conditions: dict[str, str]


def render(
    seed: int, world_index: int, split: str, per_camera: int, kind: str = "pack"
) -> Iterator[tuple[NDArray[np.uint8], Array, str, Conditions]]:
    """Yield (image RGB, labels, camera, conditions) of one world; depends on the arguments only.

    Args:
        seed: of the dataset.
        world_index: number of the world of its kind in its split.
        split: `"train"` or `"held_out"`; the two never share a world.
        per_camera: images of the head camera, and as many of the palm cameras.
        kind: of `BUILDERS`.
    """
    # A pack's stream is named as before there were kitchens, so that held-out images stay the same.
    rng = stream(
        seed, f"detector/{split}/{world_index}" if kind == "pack" else f"detector/{split}/{kind}/{world_index}"
    )
    scene = BUILDERS[kind](rng)
    plain, fancy = scene.make_rigs()
    with plain, fancy:
        for k in range(2 * per_camera):
            conditions = scene.randomise_looks(rng)
            scene.randomise_objects(rng)
            info = (scene.place_head if k % 2 == 0 else scene.place_palm)(rng)
            rig = fancy if rng.random() < FANCY_SHARE else plain
            rgb, _ = rig.render(scene.data, info.name)
            labels = label_image(scene, info, plain.segment(scene.data, info.name))
            exposed = AutoExposure(conditions.light, rng).expose(rgb)
            yield exposed, labels, "head" if info.name == "head" else "palm", conditions


def named(conditions: Conditions) -> list[str]:
    """Return the values of `CONDITIONS` as words."""
    light = next(name for name, end in LIGHTS.items() if conditions.light <= end)
    return [conditions.finish, conditions.cover, conditions.tray, light]


def generate(folder: Path, seed: int, split: str, worlds: dict[str, int], per_camera: int, jobs: int = 1) -> None:
    """Render a split into `folder/split`; worlds already there are kept."""
    target = folder / split
    target.mkdir(parents=True, exist_ok=True)
    # Kinds take turns, so that a split that was stopped has its share of each.
    wanted = sorted(
        ((kind, index) for kind, count in worlds.items() for index in range(count)),
        key=lambda world: world[1] / worlds[world[0]],
    )
    missing = [world for world in wanted if not _path(target, *world).exists()]
    # A rig's OpenGL context does not outlive a fork.
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        running: list[Future[None]] = [
            pool.submit(_write, _path(target, kind, index), seed, index, split, per_camera, kind)
            for kind, index in missing
        ]
        for done in tqdm(as_completed(running), total=len(running), desc=f"render {split}"):
            done.result()


def _path(folder: Path, kind: str, index: int) -> Path:
    return folder / f"{kind}_{index:04d}.npz"


def _write(path: Path, seed: int, index: int, split: str, per_camera: int, kind: str) -> None:
    arrays: dict[str, NDArray[np.float32] | NDArray[np.uint8] | NDArray[np.str_]] = {}
    for k, (rgb, labels, camera, conditions) in enumerate(render(seed, index, split, per_camera, kind)):
        ok, code = cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        if not ok:
            raise RuntimeError("JPEG encoding failed")
        arrays[f"image_{camera}_{k:04d}"] = np.asarray(code, np.uint8)
        arrays[f"label_{camera}_{k:04d}"] = labels.astype(np.float32)
        arrays[f"conditions_{camera}_{k:04d}"] = np.array(named(conditions))
    part = path.with_suffix(".part")
    with part.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)
    part.rename(path)


def load(folder: Path, split: str) -> list[Labelled]:
    """Read a split. Raises FileNotFoundError: nothing was rendered there."""
    paths = sorted((folder / split).glob("*.npz"))
    if not paths:
        raise FileNotFoundError(f"no rendered worlds in {folder / split}")
    with ThreadPoolExecutor() as pool:  # decoding leaves the other threads free
        return list(chain.from_iterable(pool.map(_read, paths)))


def _read(path: Path) -> list[Labelled]:
    data: list[Labelled] = []
    with np.load(path) as file:
        for key in sorted(k for k in file.files if k.startswith("image_")):
            image = cv2.imdecode(file[key], cv2.IMREAD_COLOR)
            if image is None:
                raise ValueError(f"{key} in {path} cannot be decoded")
            rgb = np.ascontiguousarray(image[..., ::-1], np.uint8)
            labels = file[key.replace("image_", "label_")].reshape(-1, len(COLUMNS)).astype(float)
            words = file[key.replace("image_", "conditions_")].tolist()
            conditions = {"world": path.stem.split("_")[0], **dict(zip(CONDITIONS, words, strict=True))}
            data.append(Labelled(rgb, labels, key.split("_")[1], conditions))
    return data
