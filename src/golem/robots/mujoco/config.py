"""Options of the twin."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from golem.errors import ConfigError
from golem.robots.model.contact_shapes import FOOT_FRICTION, Feet
from golem.robots.mujoco.external_forces import HoistConfig
from golem.robots.worlds.conditions import LayoutKind, check_condition
from golem.robots.worlds.robocasa import RobocasaConfig

Support = Literal["hoist", "ground"]
World = Literal[
    "pack", "ioniq5", "plant", "ioniq5_plant",
    "open", "slope", "step", "rubble", "furnished", "corridor", "kitchen", "counter", "robocasa",
]  # fmt: skip
IONIQ5, PLANTS, WORKSHOPS = ("ioniq5", "ioniq5_plant"), ("plant", "ioniq5_plant"), ("pack", "ioniq5")
"""Worlds with the real pack, those with a pack in a furnished hall, and those with one in a workshop."""
WITH_PACK = (*WORKSHOPS, *PLANTS)
"""Worlds with a pack to work on."""
KITCHENS = ("kitchen", "counter")
"""Worlds with a fridge and a counter."""


@dataclass(frozen=True)
class MujocoConfig:
    """Options of the twin.

    Attributes:
        support: `hoist`: it hangs, its feet clear of the floor. `ground`: it stands, and the hoist's spring keeps it
            upright until it is released.
        world: `pack`: the hall with the battery pack; `open`: the empty hall; `slope`: a ramp ahead; `step`: a
            platform ahead; `rubble`: tiles of uneven height all around. The floor is flat for a metre around the start
            in each. `furnished`: a hall with walls, shelves, pillars, gantry and packs, drawn from the seed; `plant`:
            that hall with the pack to work on; `corridor`: two bare walls; `kitchen`: a fridge before the robot and a
            counter with tableware beside it; `counter`: that kitchen with the counter before the robot, four things
            within reach. `ioniq5` and `ioniq5_plant`: as `pack` and `plant`, with the fasteners of a real pack, its rim
            0.857 m over the floor on which the robot would stand. `robocasa`: a kitchen of the user's RoboCasa.
        arms: where they are when the world begins: at home, or hanging as they do while the motors are limp.
        stance: where the robot should stand before pack or counter, from where it begins: x, y [m] and yaw [rad], which
            is 0 in a kitchen.
        layout: `nominal`: pack and tray stand where `PackLayout` says, under a robot in the hoist; under one that
            stands they are lowered with it. `varied`: places, light, finishes and clutter are drawn from the seed; of
            a kitchen also sizes, heights, and which way its fridge opens.
        mirrored: whether what stands on a counter is mirrored, left to right.
        sizes: how much larger or smaller than its kind a thing on a counter is at most, as a share; the seed draws it.
        conditions: those of `worlds.conditions` that are not left to the layout, e.g. `{light: 0.3}`.
        robocasa: which kitchen of RoboCasa.
        hoist: how the robot is held.
        reach_y: near-edge fasteners with |y| up to this are loosened [m]; a varied layout draws among those up to
            `REACH_Y`. Of an ioniq5 those all round.
        torque_profile: torque limits of the simulated motors (see `robots.model.table`).
        near: distance of a finger from a screw below which physics runs at the fine step [m].
        slope: inclination of the ramp [rad].
        step: height of the platform [m].
        rubble: height of the highest tile [m]; the others are drawn from 0 to it.
        people: how many people walk about in the furnished hall or the plant.
        obstacles: how many walls and obstacles stand in the lane of the furnished hall or the plant; a way is left.
        self_collision: whether limbs stop each other; they do unless this is False.
        feet: what the soles are to the floor.
        cone: friction cone of the solver; by default the pack's bores need an elliptic one, other worlds do without.
        noslip: rounds of MuJoCo's no-slip solver, which ends what is left of the soles' creep under side load.
        friction: sliding friction of the soles on whatever they stand on.
        payload: mass fixed in the left and the right hand, at the grasp frame [kg].
        latency: delay of motor commands on top of the profile's [s].
        mjcf: the robot from this file instead of ours: the joints, motors, `imu` site and link names of the vendor's
            27-motor model, to which our hands are mounted. Its soles, torque limits and contacts are its own.
        gantry: whether the tool of a gantry hangs above the pack, for a judge to move.
        tags: whether the hands wear their cuffs of tags, for a calibration.
    """

    support: Support = "hoist"
    world: World = "pack"
    arms: Literal["home", "hanging"] = "home"
    stance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    layout: LayoutKind = "nominal"
    mirrored: bool = False
    sizes: float = 0.0
    conditions: dict[str, float | str] = field(default_factory=dict[str, "float | str"])
    robocasa: RobocasaConfig = field(default_factory=RobocasaConfig)
    hoist: HoistConfig = field(default_factory=HoistConfig)
    reach_y: float = 0.15
    torque_profile: str = "urdf"
    near: float = 0.12
    slope: float = math.radians(5.0)
    step: float = 0.05
    rubble: float = 0.03
    people: int = 0
    obstacles: int = 0
    self_collision: bool | None = None
    feet: Feet = "spheres"
    cone: Literal["pyramidal", "elliptic"] | None = None
    noslip: int = 0
    friction: float = FOOT_FRICTION
    payload: tuple[float, float] = (0.0, 0.0)
    latency: float = 0.0
    mjcf: Path | None = None
    gantry: bool = False
    tags: bool = False

    def __post_init__(self) -> None:
        for name, value, minimum, maximum in (
            ("slope", self.slope, 0.0, 0.5),
            ("step", self.step, 0.0, 0.1),
            ("rubble", self.rubble, 0.0, 0.2),
            ("sizes", self.sizes, 0.0, 0.3),
            ("people", self.people, 0, 20),
            ("obstacles", self.obstacles, 0, 12),
            ("noslip", self.noslip, 0, 100),
            ("friction", self.friction, 0.01, 5.0),
            ("payload", self.payload[0], 0.0, 20.0),
            ("payload", self.payload[1], 0.0, 20.0),
            ("latency", self.latency, 0.0, 0.2),
            ("stance x", self.stance[0], -0.5, 20.0),
            ("stance y", self.stance[1], -10.0, 10.0),
            ("stance yaw", self.stance[2], -math.pi, math.pi),
        ):
            if not minimum <= value <= maximum:
                raise ConfigError(f"The twin's {name} is from {minimum:g} to {maximum:g}, not {value:g}.")
        if not isinstance(self.conditions, dict):
            raise ConfigError("The twin's conditions are a mapping, e.g. {light: 0.3}.")
        for name, value in self.conditions.items():
            check_condition(name, value)
        varied = self.layout != "nominal" and self.world not in KITCHENS
        if self.world not in WITH_PACK and (self.conditions or varied or self.gantry):
            raise ConfigError(f"The world '{self.world}' has no pack with layout, conditions or a gantry.")
        if (self.world == "robocasa") != (self.robocasa.layout is not None):
            raise ConfigError("The world 'robocasa', and no other, takes a layout file: robocasa: {layout: PATH}.")
        if (self.mirrored or self.sizes) and self.world != "counter":
            raise ConfigError(
                f"Only a counter's things are mirrored or of other sizes, not those of the world '{self.world}'."
            )
        if self.world in (*KITCHENS, "robocasa") and self.stance[2] != 0.0:
            raise ConfigError(f"The twin's stance before a {self.world} has the yaw 0, not {self.stance[2]:g}.")
        own = (self.feet, self.torque_profile, self.self_collision)
        if self.mjcf is not None and own != ("spheres", "urdf", None):
            raise ConfigError(
                "The robot of an mjcf file has soles, torque limits and contacts of its own: leave feet, "
                "torque_profile and self_collision out beside it."
            )
