"""Random kitchens: tableware that stands, lies and hides on a counter, and the bar of a fridge."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from golem.robots.sensors.cameras import CAMERAS
from golem.robots.worlds.conditions import Conditions, draw_conditions
from golem.robots.worlds.fridge import HINGE
from golem.robots.worlds.kitchen import (
    FRONTS,
    STEELS,
    TOPS,
    KitchenLayout,
    add_kitchen,
    draw_counter,
    draw_kitchen,
)
from golem.robots.worlds.pack import PackPart
from golem.robots.worlds.tableware import COLOURS, KINDS
from golem.training.detector import random_scene
from golem.training.detector.random_scene import Compiled, RandomScene
from golem.types import Array, CameraInfo

SIZES = 0.25
"""How much larger or smaller than its kind a thing is at most, as a share."""
LYING = 0.12
"""Share of the things that lie on their side."""
GONE = 0.15
"""Share of the things that are not there."""


class RandomKitchen(RandomScene):
    """A compiled random kitchen.

    Attributes:
        layout: where fridge and counter stand.
    """

    def __init__(self, world: Compiled, layout: KitchenLayout, parts: tuple[PackPart, ...]) -> None:
        """Keep what was compiled."""
        super().__init__(world, parts)
        self.layout = layout

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
        model.mat_rgba[bar, :3] = (
            random_scene.random_colour(rng) if wild else rng.choice([0.25, 0.8]) * np.ones(3)
        )
        random_scene.randomise_robot(self.world, wild, rng)
        random_scene.randomise_lights(model, rng)
        return draw_conditions("varied", {}, rng)

    def randomise_objects(self, rng: np.random.Generator) -> None:
        """Move the things about the counter, lay some on their side, open the fridge, scatter distractors."""
        model, data, layout = self.model, self.data, self.layout
        random_scene.reset(self.world)
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
        random_scene.scatter(self.world, low, high + (0.0, 0.0, 0.012), rng)
        random_scene.pose_arms(self.world, rng)

    def place_head(self, rng: np.random.Generator) -> CameraInfo:
        """Stand the robot before the fridge or along the counter, looking at it; returns the camera."""
        handle = next(part for part in self.parts if part.label == "handle")
        place = handle.position if rng.random() < 0.3 else self._random_place(rng)
        at = np.array([rng.uniform(-0.35, 0.1), place[1] + rng.uniform(-0.4, 0.4), rng.uniform(0.95, 1.15)])
        random_scene.stand(self.world, at, (0.2, 0.08, 0.05), rng)
        return CAMERAS["head"]

    def place_palm(self, rng: np.random.Generator) -> CameraInfo:
        """Carry a palm camera to where it looks at a random part, from above or from ahead; returns the camera."""
        random_scene.refresh(self.world)
        info = CAMERAS[f"{random_scene.random_side(rng)}_hand"]
        places = {part.geoms: self.data.geom_xpos[self.model.geom(part.geoms[0]).id] for part in self.parts}
        there = tuple(part for part in self.parts if places[part.geoms][2] > 0.0)
        part = random_scene.random_part(there, rng)
        target = places[part.geoms].copy()
        distance = float(np.exp(rng.uniform(np.log(0.12), np.log(0.60))))
        pitch = rng.uniform(0.0, 0.35) if part.label == "handle" else rng.uniform(0.2, np.pi / 2)
        view = looking(rng.normal(0.0, 0.4), pitch, rng.uniform(-np.pi, np.pi))
        random_scene.carry(self.world, info, random_scene.aim(info, target, view, distance, rng))
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


def build_kitchen(rng: np.random.Generator) -> RandomKitchen:
    """Compile a kitchen with a random counter, things of random sizes, and distractors."""
    spec, plain = random_scene.begin(rng)
    raised = float(rng.uniform(-0.15, 0.05))
    layout = draw_counter(rng, raised, sizes=SIZES) if rng.random() < 0.5 else draw_kitchen(rng, raised)
    parts = add_kitchen(spec, layout)
    return RandomKitchen(random_scene.compile_scene(spec, plain, rng), layout, parts)
