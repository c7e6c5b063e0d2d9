"""A kitchen drawn from a seed: a fridge before the robot, a counter beside it, and tableware on the counter.

Ours, built of boxes and turned shapes; nothing of RoboCasa is in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from golem.package_data import load_data
from golem.robots.worlds import hall, parts
from golem.robots.worlds.fridge import HANDLE, FridgeLayout, add_fridge
from golem.robots.worlds.pack import PackPart
from golem.robots.worlds.parts import ALONG_X, BOX, CYLINDER
from golem.robots.worlds.tableware import COLOURS, KINDS, add_object

FRONTS, TOPS, STEELS = (
    [tuple(colour) for colour in row] for row in load_data(__package__, "worlds.yaml")["kitchen"].values()
)
"""Colours of the cabinets' fronts, of the counter's top and of the fridge (r, g, b)."""
APART = 0.04
"""Least distance between two things on the counter [m]."""
LEAST_APART = 0.10
"""The same of things before the robot [m]: an open finger comes between them."""
GRIP = 20.0
"""How much stiffer friction is than contact (MuJoCo's `impratio`): at 1 a can creeps out of a hand in seconds."""


@dataclass(frozen=True, slots=True)
class StandingThing:
    """A thing on the counter: its kind, the body's name, and the middle of its underside in the world [m].

    Its size is a multiple of what `KINDS` says.
    """

    kind: str
    body: str
    position: tuple[float, float, float]
    yaw: float
    colour: tuple[float, float, float]
    size: float = 1.0


@dataclass(frozen=True, slots=True)
class KitchenLayout:
    """One kitchen, as seen from where the robot should stand: that is the origin, and the robot heads along x.

    Attributes:
        counter_top: height of the counter [m].
        counter_front: x of its front edge [m].
        counter_start: where along y it begins, on the far side of the fridge's bar [m].
        front, top, steel: colours of cabinets, counter and fridge.
    """

    fridge: FridgeLayout
    counter_top: float
    counter_front: float
    counter_start: float
    things: tuple[StandingThing, ...]
    front: tuple[float, float, float]
    top: tuple[float, float, float]
    steel: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Area:
    """Where on the counter things stand: bounds along x and y, and what is left between two of them [m]."""

    x: tuple[float, float]
    y: tuple[float, float]
    apart: float


def draw_kitchen(rng: np.random.Generator, raised: float = 0.0, varied: bool = True) -> KitchenLayout:
    """Return a kitchen.

    Args:
        rng: the same state gives the same kitchen.
        raised: how much higher than for a pelvis of 1.10 m the bar and the counter are [m].
        varied: places, sizes and colours are drawn; else only what stands on the counter.
    """
    nominal = FridgeLayout()
    left = bool(rng.random() < 0.5) if varied else False
    sign = -1.0 if left else 1.0
    draws: list[float] = rng.uniform(-1.0, 1.0, 9).tolist()
    fridge = replace(nominal, hinge_left=left, handle_y=sign * nominal.handle_y, handle_z=nominal.handle_z + raised)
    if varied:
        fridge = replace(
            fridge,
            front=nominal.front + 0.03 * draws[0],
            handle_y=sign * (nominal.handle_y + 0.04 * draws[1]),
            handle_z=nominal.handle_z + raised + 0.04 * draws[2],
            yaw=0.08 * draws[3],
            length=nominal.length + 0.08 * draws[4],
            radius=nominal.radius + 0.0025 * draws[5],
            standoff=nominal.standoff + 0.01 * draws[6],
            seal=nominal.seal + 5.0 * draws[7],
            mass=nominal.mass + 5.0 * draws[8],
        )
    picks = rng.integers(0, (len(FRONTS), len(TOPS), len(STEELS))) if varied else np.zeros(3, int)
    top, edge = 0.94 + raised, 0.44
    kinds = [*KINDS, *(str(kind) for kind in rng.choice(list(KINDS), size=int(rng.integers(0, 4))))]
    area = Area((edge + 0.09, edge + 0.40), (0.12, 1.25), APART)
    things = draw_things(rng, kinds, top, area, sign)
    colours = FRONTS[picks[0]], TOPS[picks[1]], STEELS[picks[2]]
    return KitchenLayout(fridge, top, edge, 0.06, things, *colours)


def draw_counter(
    rng: np.random.Generator, raised: float = 0.0, varied: bool = True, sizes: float = 0.0
) -> KitchenLayout:
    """Return a kitchen whose counter is before the robot, with four things within reach, and whose fridge is aside.

    Args:
        rng: the same state gives the same kitchen.
        raised: as for `draw_kitchen`.
        varied: height, edge and colours are drawn; else only what stands where.
        sizes: how much larger or smaller than its kind a thing is at most, as a share.
    """
    draws: list[float] = rng.uniform(-1.0, 1.0, 2).tolist() if varied else [0.0, 0.0]
    picks = rng.integers(0, (len(FRONTS), len(TOPS), len(STEELS))) if varied else np.zeros(3, int)
    top, edge = 0.96 + raised + 0.04 * draws[0], 0.35 + 0.02 * draws[1]
    kinds = [str(kind) for kind in rng.permutation(list(KINDS))]
    area = Area((edge + 0.09, edge + 0.22), (-0.38, 0.38), LEAST_APART)
    # Where one finds no room, all are put elsewhere.
    drawn = (draw_things(rng, kinds, top, area, 1.0) for _ in range(40))
    things = next(some for some in drawn if len(some) == len(kinds))
    grown = (1.0 + sizes * rng.uniform(-1.0, 1.0, len(things))).tolist()
    things = tuple(replace(thing, size=size) for thing, size in zip(things, grown, strict=True))
    nominal = FridgeLayout()
    fridge = replace(nominal, handle_y=-1.10, handle_z=nominal.handle_z + raised)
    colours = FRONTS[picks[0]], TOPS[picks[1]], STEELS[picks[2]]
    return KitchenLayout(fridge, top, edge, -0.88, things, *colours)


def mirrored(layout: KitchenLayout) -> KitchenLayout:
    """Return a kitchen whose things stand as in a mirror: what was left of the robot is right of it."""
    things = tuple(
        replace(t, position=(t.position[0], -t.position[1], t.position[2]), yaw=-t.yaw) for t in layout.things
    )
    return replace(layout, things=things)


def draw_things(
    rng: np.random.Generator, kinds: Sequence[str], top: float, area: Area, sign: float
) -> tuple[StandingThing, ...]:
    """Return things of `kinds` on the counter, apart from each other; one that finds no room is left out."""
    things: list[StandingThing] = []
    for k, kind in enumerate(kinds):
        radius = KINDS[kind][0] + (0.03 if kind == "mug" else 0.0)
        for _ in range(60):
            x, y = rng.uniform((area.x[0], area.y[0]), (area.x[1], area.y[1]))
            others = ((t, KINDS[t.kind][0]) for t in things)
            if all(np.hypot(x - t.position[0], sign * y - t.position[1]) > radius + r + area.apart for t, r in others):
                colour = COLOURS[kind][int(rng.integers(len(COLOURS[kind])))]
                yaw = float(rng.uniform(-np.pi, np.pi))
                place = (float(x), float(sign * y), top)
                things.append(StandingThing(kind, f"{kind}_{k}", place, yaw, colour))
                break
    return tuple(things)


def add_kitchen(
    spec: mujoco.MjSpec, layout: KitchenLayout, at: tuple[float, float] = (0.0, 0.0)
) -> tuple[PackPart, ...]:
    """Add floor, walls, cabinets, fridge and tableware; return what a detector can be asked for.

    Args:
        spec: the world to extend; only the robot is there.
        layout: as seen from where the robot should stand.
        at: that place in the world, x and y [m].
    """
    set_contacts(spec)
    _add_materials(spec, layout)
    sign = 1.0 if layout.fridge.handle_y < 0.0 else -1.0
    _add_room(spec, at)
    room = spec.worldbody.add_body(name="kitchen", pos=[*at, 0.0])
    _add_counter(room, layout, sign)
    fridge = replace(layout.fridge, front=layout.fridge.front + at[0], handle_y=layout.fridge.handle_y + at[1])
    add_fridge(spec, fridge)
    reach = fridge.standoff
    c, s = float(np.cos(fridge.yaw)), float(np.sin(fridge.yaw))
    place = np.array([fridge.front - c * reach, fridge.handle_y - s * reach, fridge.handle_z])
    size = np.array([2 * fridge.radius, 2 * fridge.radius, fridge.length])
    return (PackPart("handle", "fridge_door", (HANDLE,), place, size), *stand(spec, layout.things, at))


def set_contacts(spec: mujoco.MjSpec) -> None:
    """Set the solver's options so that a hand holds tableware."""
    # MuJoCo's native collision of convex shapes gives a can at a pad's edge a normal across the pad, which throws it
    # out of the hand; libccd gives it the right one.
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_NATIVECCD
    spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    spec.option.impratio, spec.option.cone = GRIP, mujoco.mjtCone.mjCONE_ELLIPTIC


def stand(spec: mujoco.MjSpec, things: Sequence[StandingThing], at: tuple[float, float]) -> list[PackPart]:
    """Add `things` as seen from `at`, x and y in the world [m]; return what a detector can be asked for."""
    found: list[PackPart] = []
    for thing in things:
        x, y, z = thing.position
        place = (x + at[0], y + at[1], z)
        geoms = add_object(spec, thing.kind, thing.body, place, thing.yaw, thing.colour, size=thing.size)
        radius, height = (thing.size * length for length in KINDS[thing.kind])
        top = np.array(place) + (0.0, 0.0, height)
        found.append(PackPart(thing.kind, thing.body, geoms, top, np.array([2 * radius, 2 * radius, height])))
    return found


def _add_materials(spec: mujoco.MjSpec, layout: KitchenLayout) -> None:
    hall.add_materials(spec)
    texture, builtin = mujoco.mjtTexture, mujoco.mjtBuiltin
    spec.add_texture(
        name="sky", type=texture.mjTEXTURE_SKYBOX, builtin=builtin.mjBUILTIN_GRADIENT,
        rgb1=[0.97, 0.97, 0.96], rgb2=[0.80, 0.82, 0.85], width=64, height=64,
    )  # fmt: skip
    spec.add_texture(
        name="tiles", type=texture.mjTEXTURE_2D, builtin=builtin.mjBUILTIN_FLAT, mark=mujoco.mjtMark.mjMARK_EDGE,
        rgb1=[0.90, 0.92, 0.91], rgb2=[0.90, 0.92, 0.91], markrgb=[0.70, 0.72, 0.72], width=128, height=128,
    )  # fmt: skip
    spec.add_texture(
        name="boards", type=texture.mjTEXTURE_2D, builtin=builtin.mjBUILTIN_CHECKER,
        mark=mujoco.mjtMark.mjMARK_EDGE, markrgb=[0.38, 0.28, 0.19],
        rgb1=[0.58, 0.43, 0.29], rgb2=[0.62, 0.47, 0.33], width=256, height=64,
    )  # fmt: skip
    for name, repeat in (("tiles", (12, 5)), ("boards", (3, 14))):
        material = spec.add_material(name=name, specular=0.2, shininess=0.3, texrepeat=list(repeat))
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    for name, colour, specular, shininess in (
        ("cabinet", layout.front, 0.15, 0.3),
        ("counter_top", layout.top, 0.5, 0.6),
        ("fridge_steel", layout.steel, 0.5, 0.5),
        ("fridge_bar", (0.80, 0.81, 0.82) if sum(layout.steel) < 1.5 else (0.25, 0.26, 0.28), 0.8, 0.7),
        ("sink", (0.62, 0.64, 0.66), 0.9, 0.8),
    ):
        spec.add_material(name=name, rgba=[*colour, 1.0], specular=specular, shininess=shininess)
    spec.add_material(name="fridge_glass", rgba=[0.75, 0.85, 0.88, 0.35], specular=0.8, shininess=0.8)


def _add_room(spec: mujoco.MjSpec, at: tuple[float, float]) -> None:
    world = spec.worldbody
    hall.add_floor(spec, 5.0, "boards")
    for size, x, y in (((0.05, 4.0, 1.35), 1.40, 0.0), ((3.0, 0.05, 1.35), -1.6, 3.2), ((3.0, 0.05, 1.35), -1.6, -3.2)):
        parts.solid(world, BOX, size, (x + at[0], y + at[1], 1.35), "wall_paint")
    for x, y, level in ((0.1, 0.7, 0.40), (0.1, -0.9, 0.36), (-1.2, 0.0, 0.28)):
        world.add_light(
            pos=[x + at[0], y + at[1], 2.6], dir=[0.45, -0.3 * y, -1.0], diffuse=[level] * 3,
            specular=[0.5 * level] * 3, ambient=[0.09] * 3, castshadow=False, cutoff=75, exponent=1.0,
        )  # fmt: skip


def _add_counter(body: mujoco.MjsBody, layout: KitchenLayout, sign: float) -> None:
    """Add the counter with base and wall cabinets on the far side of the fridge's bar."""
    top, front = layout.counter_top, layout.counter_front
    # Clear of the fridge, whose corner turns with it.
    near, far = layout.counter_start, layout.counter_start + 2.54
    back = 1.34
    y, half = sign * (near + far) / 2, (far - near) / 2
    x, deep = (front + back) / 2, (back - front) / 2
    slab = 0.02
    parts.solid(body, BOX, (deep, half, slab), (x, y, top - slab), "counter_top", friction=0.7)
    low = (top - 2 * slab - 0.10) / 2
    size, pos = (deep - 0.015, half - 0.005, low), (x + 0.015, y, 0.10 + low)
    parts.solid(body, BOX, size, pos, "cabinet")
    parts.visual(body, BOX, (deep - 0.05, half, 0.05), (x + 0.05, y, 0.05), "dark")
    parts.visual(body, BOX, (0.012, half, 0.32), (back, y, top + 0.32), "tiles")
    width = 2 * half / 4
    for k in range(4):
        middle = sign * (near + (k + 0.5) * width)
        _front(body, (front + 0.012, middle, 0.10 + low), (width / 2 - 0.006, low - 0.008), sign)
        _front(body, (back - 0.36, middle, top + 0.98), (width / 2 - 0.006, 0.34), sign)
    upper = (0.175, half, 0.35)
    parts.solid(body, BOX, upper, (back - 0.175, y, top + 0.98), "cabinet")
    # A sink with a tap, well away from where things stand.
    at = sign * 1.75
    parts.visual(body, BOX, (0.20, 0.26, 0.002), (x, at, top + 0.001), "sink")
    parts.visual(body, BOX, (0.17, 0.23, 0.002), (x, at, top + 0.002), "dark")
    parts.visual(body, CYLINDER, (0.014, 0.13), (x + 0.24, at, top + 0.13), "sink")
    parts.visual(body, CYLINDER, (0.011, 0.09), (x + 0.16, at, top + 0.255), "sink", quat=ALONG_X)


def _front(body: mujoco.MjsBody, at: tuple[float, float, float], size: tuple[float, float], sign: float) -> None:
    """Add a cabinet's front with a frame and a knob, facing the robot."""
    x, y, z = at
    half_w, half_h = size
    parts.visual(body, BOX, (0.010, half_w, half_h), (x, y, z), "cabinet")
    parts.visual(body, BOX, (0.002, half_w - 0.05, half_h - 0.05), (x - 0.0105, y, z), "cabinet")
    knob = (x - 0.022, y - sign * (half_w - 0.04), z + (0.7 * half_h if z < 1.0 else -0.7 * half_h))
    parts.visual(body, CYLINDER, (0.010, 0.012), knob, "steel", quat=ALONG_X)
