"""A kitchen of RoboCasa (https://github.com/robocasa/robocasa) from the user's checkout, as boxes; none of it is here.

A layout's file has groups of rows, each row a fixture: its place is told, or found beside another fixture. Counters,
cabinets and walls are boxes of the told size. Fridges, stoves and the like have a model, an MJCF that registry and
style name; its collision shapes are taken as boxes, scaled to the told size. All doors stay shut, and sinks closed.
What is sampled onto counters, stools, windows and things on walls are left out. A fixture faces its own -y.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import mujoco
import numpy as np

from golem.errors import ConfigError, unknown_name
from golem.options import read_yaml
from golem.robots.model.spatial import rotation_rpy, transform
from golem.robots.worlds import parts, terrain
from golem.robots.worlds.kitchen import Area, draw_things, set_contacts, stand
from golem.robots.worlds.pack_part import PackPart
from golem.robots.worlds.tableware import KINDS
from golem.types import Array, PlanarPose

CABINETS = ("single_cabinet", "hinge_cabinet", "panel_cabinet", "drawer", "box", "stack")
OPEN = ("open_cabinet", "housing_cabinet")
"""Kinds that are four walls around a room, open to the front."""
MODELS = (
    "fridge", "fridge_french_door", "fridge_side_by_side", "fridge_bottom_freezer", "stove", "stove_wide", "oven",
    "dishwasher", "microwave", "hood", "sink", "stovetop",
)  # fmt: skip
LEFT_OUT = ("floor", "stool", "window", "window_proc", "wall_accessory", "utensil_rack")
SIDES = (("left", "right"), ("front", "back"), ("bottom", "top"))
"""Words for the low and the high side along x, y, z."""
WALL, BOARD, PLINTH, RECESS = 0.02, 0.03, 0.05, 0.07
"""What a wall is longer at both ends; thickness of tops and cabinets; height of a stack's plinth and how far it is back
[m], as RoboCasa has them."""
EDGE, LEAST, ROOM, BODY = 0.35, 0.6, 0.12, 0.25
"""Distance of the counter from the robot, its least width, what is left free at its ends, half of the robot [m]."""
COLOURS = {"wall": (0.86, 0.88, 0.9), "counter": (0.55, 0.55, 0.57), "fridge": (0.8, 0.81, 0.83)}
"""By the beginning of a kind; others are of wood (r, g, b)."""
ROOT = "fixtures/fixture_registry"

Row = Mapping[str, Any]
Box = tuple[Array, Array]
"""Middle and half size, (3,) each, along the fixture's axes [m]."""


@dataclass(frozen=True)
class RobocasaConfig:
    """Options of the world `robocasa`.

    Attributes:
        layout: a layout's YAML file in a checkout, its assets downloaded.
        style: one of its kitchen styles, which names the models; by default the registry's first.
        before: the counter to stand before, its name, `_` and its group's; by default the first wide, whole, free one.
    """

    layout: Path | None = None
    style: str = ""
    before: str = ""


@dataclass(slots=True)
class Fixture:
    """A fixture: its kind, extent, place of its origin [m] and heading [rad] in the kitchen, and boxes around it.

    `offset` (3,) is the extent's middle in its own frame [m]; `rank` is 1 of a wide counter, 2 where it is whole.
    """

    kind: str
    size: Array
    boxes: list[Box]
    pos: Array = field(default_factory=lambda: np.full(3, np.nan))
    yaw: float = 0.0
    offset: Array = field(default_factory=lambda: np.zeros(3))
    rank: int = 0


def read_robocasa(config: RobocasaConfig) -> dict[str, Fixture]:
    """Return the fixtures of a layout by name.

    Raises:
        ConfigError: the file is no layout in a checkout, names what is not there, or a model has not been downloaded.
    """
    layout = cast("Path", config.layout).expanduser()
    assets = next((above for above in layout.resolve().parents if (above / ROOT).is_dir()), None)
    if assets is None:
        raise ConfigError(f"The layout '{layout}' is in no checkout of RoboCasa: no folder above it has {ROOT}.")
    known = {path.stem: path for path in sorted((assets / "scenes" / "kitchen_styles").rglob("*.yaml"))}
    if config.style not in ("", *known):
        raise unknown_name("kitchen style", config.style, known)
    groups, style = _mapping(layout), _mapping(known[config.style]) if config.style else {}
    try:
        return _Reader(assets, style).read(groups)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise ConfigError(f"The layout '{layout}' is none of RoboCasa's: {type(error).__name__} {error}.") from error


def add_robocasa(
    spec: mujoco.MjSpec, config: RobocasaConfig, stance: PlanarPose, rng: np.random.Generator
) -> tuple[PackPart, ...]:
    """Add a kitchen and our tableware on its counter; return what a detector can be asked for.

    Args:
        spec: the world to extend; only the robot is there.
        config: which kitchen.
        stance: where the robot should stand; the counter's middle is `EDGE` ahead of it.

    Raises:
        ConfigError: see `read_robocasa`; or there is no such counter.
    """
    fixtures = read_robocasa(config)
    counters = {name: f for name, f in fixtures.items() if f.rank}
    if not counters or config.before not in ("", *counters):
        raise unknown_name("counter to stand before", config.before, counters)
    counter = counters[config.before or max(counters, key=lambda name: _rank(counters[name], fixtures))]
    set_contacts(spec)
    terrain.add_open(spec)
    at = transform((stance.x, stance.y, 0.0), np.eye(3)) @ np.linalg.inv(_before(counter))
    body = spec.worldbody.add_body(name="kitchen")
    for f in fixtures.values():
        _add(body, f, at @ transform(f.pos, rotation_rpy(0.0, 0.0, f.yaw)))
    half = 0.5 * float(counter.size[0]) - ROOM
    area = Area((EDGE + 0.09, EDGE + 0.22), (-min(half, 0.38), min(half, 0.38)), 0.04)
    kinds = [str(kind) for kind in rng.permutation(list(KINDS))]
    top = float(counter.pos[2] + 0.5 * counter.size[2])
    return tuple(stand(spec, draw_things(rng, kinds, top, area, 1.0), (stance.x, stance.y)))


def _before(counter: Fixture) -> Array:
    """Return the (4, 4) pose of who stands before a counter, x towards it, in the kitchen."""
    T = transform(counter.pos, rotation_rpy(0.0, 0.0, counter.yaw + 0.5 * math.pi))
    T[:3, 3] -= (0.5 * counter.size[1] + EDGE) * T[:3, 0]
    T[2, 3] = 0.0
    return T


def _rank(counter: Fixture, fixtures: Mapping[str, Fixture]) -> int:
    """Return how good a counter is to stand before: 2 more where nothing is in the way there."""
    spot, clear = _before(counter)[:3, 3], True
    for f in (f for f in fixtures.values() if f is not counter):
        at = rotation_rpy(0.0, 0.0, -f.yaw) @ (spot - f.pos)
        clear = clear and all((np.abs(at - m)[:2] > h[:2] + BODY).any() for m, h in f.boxes if m[2] + f.pos[2] < 1.6)
    return counter.rank + 2 * clear


def _add(body: mujoco.MjsBody, f: Fixture, T: Array) -> None:
    colour = next((c for kind, c in COLOURS.items() if f.kind.startswith(kind)), (0.62, 0.5, 0.38))
    yaw = math.atan2(T[1, 0], T[0, 0])
    for middle, half in f.boxes:
        geom = parts.collider(
            body, parts.BOX, half.tolist(), (T[:3, :3] @ middle + T[:3, 3]).tolist(),
            quat=(math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)),
        )  # fmt: skip
        geom.rgba, geom.group = [*colour, 1.0], parts.VISUAL_GROUP


def _mapping(path: Path) -> dict[str, Any]:
    try:
        found = read_yaml(path.read_text(encoding="utf-8"), str(path), foreign=True)
    except (OSError, ValueError) as error:
        raise ConfigError(f"The file '{path}' of RoboCasa cannot be read: {error}.") from error
    if not isinstance(found, dict):
        raise ConfigError(f"The file '{path}' is none of RoboCasa's: it has no groups by name.")
    return cast("dict[str, Any]", found)


class _Reader:
    """Places fixtures one after the other, each beside those before it."""

    def __init__(self, assets: Path, style: Mapping[str, Any]) -> None:
        self.assets, self.style = assets, style
        self.found: dict[str, Fixture] = {}

    def read(self, groups: Mapping[str, Any]) -> dict[str, Fixture]:
        for group, lists in groups.items():
            mine: list[Fixture] = []
            for row in (row for key, rows in lists.items() if not key.startswith("group_") for row in rows):
                kind = row["type"]
                if kind in LEFT_OUT or "placement" in row or not row.get("enable", True):
                    continue
                if kind not in (*CABINETS, *OPEN, *MODELS, "counter", "wall"):
                    raise unknown_name("kind of fixture", str(kind), [*CABINETS, *OPEN, *MODELS, "counter", "wall"])
                if kind != "wall" or not row.get("backing"):
                    self.found[f"{row['name']}_{group}"] = f = self._fixture(row, kind, group)
                    mine.append(f)
            turn, origin = float(lists.get("group_z_rot", 0.0)), np.array([*lists.get("group_origin", (0, 0)), 0.0])
            for f in (f for f in mine if f.kind != "wall" and "group_pos" in lists):
                f.pos = rotation_rpy(0.0, 0.0, turn) @ (f.pos - origin) + (*lists["group_pos"], 0.0)
                f.yaw += turn
        return {name: f for name, f in self.found.items() if np.isfinite(f.pos).all()}

    def _fixture(self, row: Row, kind: str, group: str) -> Fixture:
        if kind == "wall":
            return _wall(row)
        size = [self._length(x, k, group) for k, x in enumerate(row.get("size") or (None,) * 3)]
        if "stack_height" in row:
            size[2] = row["stack_height"] - sum(self.found[f"{n}_{group}"].size[2] for n in row["stack_fixtures"])
        inner = self.found.get(f"{row.get('interior_obj')}_{group}")
        pads = np.zeros((3, 2))
        if kind == "housing_cabinet" and inner is not None:
            pads = np.array([p or (0.0, 0.0) for p in row.get("padding") or (None,) * 3], float)
            size = [inner.size[k] + pads[k].sum() if x is None else x for k, x in enumerate(size)]
            rest = (np.array(size, float) - inner.size)[:, None] - pads[:, ::-1]
            pads = np.nan_to_num(np.where(np.isnan(pads), rest, pads))
        f = self._model(row, kind, size) if kind in MODELS else _boxed(row, kind, np.array(size, float))
        if not np.isfinite(f.size).all() or (f.size <= 0.0).any():
            raise ValueError(f"{row['name']} has no size")
        f.yaw = float(row.get("z_rot", 0.0))
        if "align_to" in row:
            f.pos = _beside(f, row, self.found[f"{row['align_to']}_{group}"])
        elif row.get("pos") is not None:
            f.pos = np.array(row["pos"], float)
        if inner is not None:
            inner.pos = f.pos + (_in_top(f, row, inner) if kind == "counter" else 0.5 * (pads[:, 0] - pads[:, 1]))
            inner.pos -= inner.offset
        return f

    def _length(self, told: object, axis: int, group: str) -> float | None:
        if isinstance(told, str):
            return float(self.found[f"{told}_{group}"].size[axis])
        return float(told) if isinstance(told, int | float) and told > 0.0 else None

    def _model(self, row: Row, kind: str, size: list[float | None]) -> Fixture:
        registry = _mapping(self.assets / ROOT / f"{kind}.yaml")
        styled = row.get("config_name") or self.style.get(kind, "default")
        if isinstance(styled, dict):
            styled = styled.get(row.get("default_config_name"), styled["default"])
        entry: dict[str, Any] = dict(registry["default"])
        for name in styled if isinstance(styled, list) else [styled]:
            entry |= registry[name]
        told = entry.get("size") if "size" not in row else None
        size = size if told is None else [x if x is not None and x > 0.0 else None for x in told]
        path = self.assets / f"{entry['xml']}{'' if str(entry['xml']).endswith('.xml') else '/model.xml'}"
        if path.is_file():
            return _scaled(kind, size, path)
        if None in size:
            raise ConfigError(
                f"The {kind} '{row['name']}' takes its size from '{path}', which is not there: download RoboCasa's "
                "assets first (python -m robocasa.scripts.download_kitchen_assets)."
            )
        return _boxed(row, kind, np.array(size, float))


def _beside(f: Fixture, row: Row, other: Fixture) -> Array:
    """Return where the origin of `f` is on one side of another fixture, flush where the row says so."""
    middle, side, flush = other.pos + other.offset, str(row["side"]).lower(), str(row.get("alignment", "")).lower()
    for k, words in enumerate(SIDES):
        apart = 0.5 * (other.size[k] + f.size[k])
        for sign, word in zip((-1.0, 1.0), words, strict=True):
            if word == side:
                middle[k] += sign * apart
            elif word in flush:
                middle[k] += sign * (apart - f.size[k])
    return middle + np.array(row.get("offset", (0.0,) * 3), float) - f.offset


def _in_top(f: Fixture, row: Row, inner: Fixture) -> Array:
    """Return the middle of what is let into a counter, from the counter's [m]."""
    lip = float(row.get("overhang", 0.05))
    extent, share = f.size - (0.0, lip, 0.0), [float(row.get(f"obj_{axis}_percent", 0.5)) for axis in "xy"]
    most = np.maximum(0.5 * (extent - inner.size)[:2] - 0.02, 0.0)
    x, y = np.clip((np.array(share) - 0.5) * extent[:2], -most, most)
    return np.array([x, 0.5 * lip + y, 0.5 * (f.size[2] - inner.size[2])])


def _wall(row: Row) -> Fixture:
    wide, tall, thick = (float(x) for x in row["size"])
    side, pos = row.get("wall_side", "back"), np.array(row["pos"], float)
    axis, sign = {"left": (0, -1.0), "right": (0, 1.0), "front": (1, -1.0), "back": (1, 1.0)}[side]
    half = np.array([thick, wide + 2.0 * WALL, tall] if axis == 0 else [wide + 2.0 * WALL, thick, tall])
    pos[axis] += sign * thick
    return Fixture("wall", 2.0 * half, [(np.zeros(3), half)], pos)


def _between(low: Array, high: Array) -> Box:
    return 0.5 * (low + high), 0.5 * (high - low)


def _boxed(row: Row, kind: str, size: Array) -> Fixture:
    """Return a fixture of boxes about its middle."""
    h, t = 0.5 * size, BOARD
    boxes = [_between(-h, h)]
    if kind in OPEN:
        boxes = [_between(*_slice(-h, h, k, s, t)) for k, s in ((0, -1.0), (0, 1.0), (1, 1.0), (2, -1.0), (2, 1.0))]
    elif kind == "stack":
        boxes.append(_between(np.array([-h[0], RECESS - h[1], -h[2] - PLINTH]), np.array([h[0], h[1], -h[2]])))
    elif kind == "counter":
        low, high = -h, h - (0.0, 0.0, t)
        front, back = row.get("base_opening", (False, False))
        low[1], high[1] = 0.0 if front else low[1] + float(row.get("overhang", 0.05)), 0.0 if back else high[1]
        boxes = [_between(*_slice(-h, h, 2, 1.0, t)), _between(low, high)]
    wide = kind == "counter" and size[0] >= LEAST and any(row.get("hollow", (True,)))
    return Fixture(kind, size, boxes, rank=(1 if "interior_obj" in row else 2) if wide else 0)


def _slice(low: Array, high: Array, axis: int, sign: float, thick: float) -> tuple[Array, Array]:
    low, high = low.copy(), high.copy()
    (low if sign > 0.0 else high)[axis] = (high[axis] - thick) if sign > 0.0 else (low[axis] + thick)
    return low, high


def _scaled(kind: str, size: list[float | None], path: Path) -> Fixture:
    """Return a fixture with the collision shapes of an MJCF as boxes, scaled to `size` where that is told."""
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        seen = [g for g in spec.geoms if g.type == mujoco.mjtGeom.mjGEOM_MESH or g.contype == 0]
        moves = (*spec.actuators, *spec.sensors, *spec.equalities, *spec.tendons, *spec.joints)
        for element in (*seen, *moves, *spec.materials, *spec.textures, *spec.meshes):
            spec.delete(element)
        for geom in spec.geoms:
            geom.material = ""
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        at = {end: data.site_xpos[model.site(f"ext_{end}").id] for end in ("p0", "px", "py", "pz")}
    except (ValueError, KeyError) as error:
        raise ConfigError(f"The model '{path}' is none of RoboCasa's: {' '.join(str(error).split())}.") from error
    extent = np.array([at[end][k] - at["p0"][k] for k, end in enumerate(("px", "py", "pz"))])
    told = [None if x is None else x / extent[k] for k, x in enumerate(size)]
    order = ((0, 2, 1), (1, 0, 2), (2, 0, 1))
    scale = np.array([next((told[j] for j in turn if told[j] is not None), 1.0) for turn in order], float)
    turned = np.abs(data.geom_xmat.reshape(-1, 3, 3)) @ model.geom_aabb[:, 3:, None]
    boxes: list[Box] = [(scale * x, scale * half[:, 0]) for x, half in zip(data.geom_xpos, turned, strict=True)]
    return Fixture(kind, scale * extent, boxes, offset=scale * (at["p0"] + 0.5 * extent))
