"""What differs from one work place to the next: places, light, finishes, and what lies about; drawn from the seed.

The nominal work place is the one that `PackLayout` describes. A varied one draws every condition anew, each from its
range and in a fixed order, so that a condition that is given leaves the others as they were drawn. The ranges are
assumptions: nobody publishes how packs stand in a plant.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Literal

import numpy as np

from golem.errors import ConfigError, unknown_name
from golem.package_data import load_data
from golem.robots.sensors.streams import stream
from golem.robots.worlds.layout import PackLayout
from golem.types import SIDES, Side

LayoutKind = Literal["nominal", "varied"]
Finish = Literal["zinc", "black_oxide", "brass", "rust"]
FINISHES: tuple[Finish, ...] = ("zinc", "black_oxide", "brass", "rust")
Coat = Literal["grey", "black", "white", "blue", "green", "bare"]
_DATA = load_data(__package__, "worlds.yaml")
COATS: dict[Coat, tuple[float, float, float]] = {name: tuple(colour) for name, colour in _DATA["coats"].items()}
"""Colours of the pack's cover (r, g, b); `grey` is the nominal one."""
TRAYS: dict[str, tuple[float, float, float]] = {name: tuple(colour) for name, colour in _DATA["trays"].items()}
"""Colours of the tray (r, g, b); `teal` is the nominal one."""
REACH_Y = 0.35
"""Near-edge fasteners up to this far from the pack's middle may be loose in a varied work place [m]: what an arm at
either side reaches."""

ASIDE = 0.05
"""How far from the robot's middle a screw is surely one for a hand; as far beyond it, mostly [m]."""
ROOM = 0.04
"""Room that a hand needs between a screw and the tray [m]."""

Value = float | str


@dataclass(frozen=True, slots=True)
class Conditions:
    """The conditions of one work place; the defaults are the nominal ones.

    Attributes:
        pack_x, pack_y: where the pack stands, from its nominal place [m].
        pack_yaw: heading of the pack [rad].
        height: of pack and tray, above the nominal one [m].
        tray_side: of the robot, on which the tray stands.
        tray_x, tray_y: where the tray stands on the cover, from its nominal place, in the pack frame [m]; y
            counts away from the robot's middle.
        tray_yaw: heading of the tray, from the pack's [rad].
        loose: share of the reachable near-edge fasteners that are loose.
        missing: share of the others that are gone.
        light: level of the light, 1 is the nominal one.
        light_azimuth: turn of the lamps about the robot's vertical [rad].
        finish: of all screws.
        cover: colour of the cover.
        tray: colour of the tray.
        clutter: things that lie on the cover.
        tray_wall: height of the trays [m].
        pitch: of the fasteners along the pack's long side, and so its length, as a share of the nominal one; not of a
            real pack.
        palm, arm_friction: of the robot that works there, as shares of what its profile has.
        backlash: of its gears beyond that of its profile, as a share of 0.22 deg.
        hand_offset: distance of each hand's mount from where the robot believes it [m]; the seed draws whither.
    """

    pack_x: float = 0.0
    pack_y: float = 0.0
    pack_yaw: float = 0.0
    height: float = 0.0
    tray_side: Side = "right"
    tray_x: float = 0.0
    tray_y: float = 0.0
    tray_yaw: float = 0.0
    loose: float = 1.0
    missing: float = 0.0
    light: float = 1.0
    light_azimuth: float = 0.0
    finish: Finish = "zinc"
    cover: Coat = "grey"
    tray: str = "teal"
    clutter: float = 0.0
    tray_wall: float = 0.045
    pitch: float = 1.0
    palm: float = 1.0
    arm_friction: float = 1.0
    backlash: float = 0.0
    hand_offset: float = 0.0


RANGES: dict[str, tuple[float, float]] = {k: tuple(r["range"]) for k, r in _DATA["conditions"].items() if "range" in r}
"""Ranges of a varied work place; uniform, the light's in its logarithm. What has none is not drawn."""
HEIGHTS = dict.fromkeys(("ioniq5", "ioniq5_plant"), (-0.107, 0.203))
"""Range of `height` at a real pack: its rim is 0.75 to 1.06 m over the floor."""
CHOICES: dict[str, tuple[str, ...]] = {
    "tray_side": SIDES,
    "finish": FINISHES,
    "cover": tuple(COATS),
    "tray": tuple(TRAYS),
}
BOUNDS: dict[str, tuple[float, float]] = {name: tuple(row["bounds"]) for name, row in _DATA["conditions"].items()}
"""What may be asked for."""
PLACES = ("pack_x", "pack_y", "pack_yaw", "tray_side", "tray_x", "tray_y", "tray_yaw")
"""The conditions that move pack or tray sideways, or turn them."""
NAMES = tuple(f.name for f in fields(Conditions))


def check_condition(name: str, value: object) -> Value:
    """Return a condition's value as it is used. Raises ConfigError: there is none such, or it cannot be that."""
    if name not in NAMES:
        raise unknown_name("condition", name, NAMES)
    if name in CHOICES:
        if value not in CHOICES[name]:
            raise unknown_name(f"value of {name}", str(value), CHOICES[name])
        return str(value)
    low, high = BOUNDS[name]
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise ConfigError(f"The condition {name} is a number from {low:g} to {high:g}, not {value!r}.")
    return float(value)


def world_stream(seed: int) -> np.random.Generator:
    """Return what the conditions of the work place of episode `seed` are drawn from."""
    return stream(seed, "world/conditions")


def draw_conditions(
    kind: LayoutKind, given: Mapping[str, Value], rng: np.random.Generator, world: str = "pack"
) -> Conditions:
    """Return the conditions of one work place. Raises ConfigError: see `check_condition`.

    Args:
        kind: `nominal` draws nothing.
        given: conditions that are not left to the draw.
        rng: the same state draws the same.
        world: which pack stands there.
    """
    values: dict[str, Value] = {}
    if kind == "varied":
        for name in NAMES:
            if name in CHOICES:
                values[name] = CHOICES[name][int(rng.integers(len(CHOICES[name])))]
            elif name in RANGES:
                low, high = HEIGHTS[world] if name == "height" and world in HEIGHTS else RANGES[name]
                logarithmic = name == "light"
                drawn = rng.uniform(math.log(low), math.log(high)) if logarithmic else rng.uniform(low, high)
                values[name] = math.exp(drawn) if logarithmic else float(drawn)
    values |= {name: check_condition(name, value) for name, value in given.items()}
    return replace(Conditions(), **values)  # pyright: ignore[reportArgumentType]


def arranged(layout: PackLayout, conditions: Conditions) -> PackLayout:
    """Return where pack and tray stand under `conditions`; `layout` is the nominal place."""
    c = conditions
    moved = replace(
        layout.raised(c.height),
        near_edge=layout.near_edge + c.pack_x,
        center_y=layout.center_y + c.pack_y,
        yaw=c.pack_yaw,
        tray_size=(*layout.tray_size[:2], c.tray_wall),
        size_y=layout.size_y * (c.pitch if type(layout) is PackLayout else 1.0),
    )
    if all(getattr(c, name) == getattr(Conditions(), name) for name in PLACES):
        return moved  # to the last bit where it was
    outwards = -1.0 if c.tray_side == "right" else 1.0
    nominal = (layout.tray_xy[0], outwards * abs(layout.tray_xy[1]), layout.tray_z, 1.0)
    on_cover = np.linalg.inv(layout.pose()) @ nominal + (c.tray_x, outwards * c.tray_y, 0.0, 0.0)
    x, y, z, _ = moved.pose() @ on_cover
    return replace(moved, tray_xy=(float(x), float(y)), tray_z=float(z), tray_yaw=c.pack_yaw + c.tray_yaw)


@dataclass(frozen=True, slots=True)
class Fasteners:
    """What is in the places of the near edge, of an `Ioniq5Layout` in all.

    Attributes:
        loose: places of the loosened screws, from right to left.
        missing: places that are empty beside the layout's own.
    """

    loose: tuple[int, ...]
    missing: tuple[int, ...]


def draw_fasteners(layout: PackLayout, conditions: Conditions, reach_y: float, rng: np.random.Generator) -> Fasteners:
    """Return which of the fasteners `around` are loose and which are gone; the others are tight.

    At least one is loose where any could be, and of those, where there are such, one on the tray's side of the robot:
    no hand carries a screw across. What a hand cannot come to for the tray stays tight.

    Args:
        reach_y: fasteners with |y| up to this take part [m].
        rng: the same state draws the same.
    """
    spots = [s for s in layout.around(reach_y) if s not in layout.empty_holes and not _under_tray(layout, s)]
    near = set(layout.reachable(reach_y))
    luck = rng.random((len(spots), 2))
    order = np.argsort(luck[:, 0])
    count = max(1, round(conditions.loose * len(spots))) if spots else 0
    aside = [_on_trays_side(layout, s) if s in near else -np.inf for s in spots]
    others = [k for least in (ASIDE, -ASIDE) for k in order.tolist() if aside[k] > least]
    if others and not any(aside[k] > -ASIDE for k in order[:count]):
        order[count - 1] = others[0]
    chosen = set(order[:count].tolist())
    rest = [k for k in range(len(spots)) if k not in chosen]
    gone = [spots[k] for k in rest if luck[k, 1] < conditions.missing]
    return Fasteners(tuple(spots[k] for k in sorted(chosen)), tuple(gone))


def _on_trays_side(layout: PackLayout, slot: int) -> float:
    """Return how far a place is from the robot's middle, to the side on which the tray is [m]."""
    y = float((layout.pose() @ (*layout.fasteners()[slot], 1.0))[1])
    return float(np.copysign(1.0, layout.tray_xy[1])) * y


def _under_tray(layout: PackLayout, slot: int) -> bool:
    spot, room = layout.pose() @ (*layout.fasteners()[slot], 1.0), 0.5 * np.array(layout.tray_size[:2]) + ROOM
    return any((np.abs(np.linalg.inv(t.pose()) @ spot)[:2] < room).all() for t in layout.trays())
