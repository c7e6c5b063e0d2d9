"""Options of the twin."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from golem.errors import ConfigError
from golem.robots.model.contact_shapes import FOOT_FRICTION, Feet
from golem.robots.mujoco.hoist import HoistConfig
from golem.robots.worlds.layout import PackLayout

Support = Literal["hoist", "ground"]
World = Literal["pack", "open", "slope", "rubble"]


@dataclass(frozen=True)
class MujocoConfig:
    """Options of the twin.

    Attributes:
        support: `hoist`: it hangs, its feet clear of the floor. `ground`: it stands, and the hoist's spring keeps it
            upright until it is released.
        world: `pack`: the hall with the battery pack; `open`: the empty hall; `slope`: a ramp ahead; `rubble`: tiles
            of uneven height all around. The floor is flat for a metre around the start in each.
        layout: where the pack stands under a robot in the hoist; under one that stands, pack and tray are lowered
            with it.
        hoist: how the robot is held.
        reach_y: near-edge fasteners with |y| up to this are loosened [m].
        torque_profile: torque limits of the simulated motors (see `robots.model.limits`).
        near: distance of a finger from a screw below which physics runs at the fine step [m].
        slope: inclination of the ramp [rad].
        rubble: height of the highest tile [m]; the others are drawn from 0 to it.
        self_collision: whether limbs stop each other; by default where the robot stands on the ground.
        feet: what the soles are to the floor.
        cone: friction cone of the solver; by default the pack's bores need an elliptic one, other worlds do without.
        noslip: rounds of MuJoCo's no-slip solver, which ends what is left of the soles' creep under side load.
        friction: sliding friction of the soles on whatever they stand on.
        payload: mass fixed in the left and the right hand, at the grasp frame [kg].
        latency: delay of motor commands on top of the profile's [s].
        mjcf: the robot from this file instead of ours: the joints, motors, `imu` site and link names of the vendor's
            27-motor model, to which our hands are mounted. Its soles, torque limits and contacts are its own.
    """

    support: Support = "hoist"
    world: World = "pack"
    layout: PackLayout = field(default_factory=PackLayout)
    hoist: HoistConfig = field(default_factory=HoistConfig)
    reach_y: float = 0.15
    torque_profile: str = "urdf"
    near: float = 0.12
    slope: float = math.radians(5.0)
    rubble: float = 0.03
    self_collision: bool | None = None
    feet: Feet = "spheres"
    cone: Literal["pyramidal", "elliptic"] | None = None
    noslip: int = 0
    friction: float = FOOT_FRICTION
    payload: tuple[float, float] = (0.0, 0.0)
    latency: float = 0.0
    mjcf: Path | None = None

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ConfigError: one of them is outside its range.
        """
        for name, value, minimum, maximum in (
            ("slope", self.slope, 0.0, 0.5),
            ("rubble", self.rubble, 0.0, 0.2),
            ("noslip", self.noslip, 0, 100),
            ("friction", self.friction, 0.01, 5.0),
            ("payload", self.payload[0], 0.0, 20.0),
            ("payload", self.payload[1], 0.0, 20.0),
            ("latency", self.latency, 0.0, 0.2),
        ):
            if not minimum <= value <= maximum:
                raise ConfigError(f"The twin's {name} is from {minimum:g} to {maximum:g}, not {value:g}.")
        own = (self.feet, self.torque_profile, self.self_collision)
        if self.mjcf is not None and own != ("spheres", "urdf", None):
            raise ConfigError(
                "The robot of an mjcf file has soles, torque limits and contacts of its own: leave feet, "
                "torque_profile and self_collision out beside it."
            )
