"""Mugs, bowls, cans and bottles: what they look like, and collision shapes with the hollows that real ones have."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from golem.package_data import load_data
from golem.robots.worlds import parts
from golem.robots.worlds.layout import yaw_quat
from golem.robots.worlds.parts import BOX, CAPSULE, CYLINDER, SPHERE

_DATA = load_data(__package__, "worlds.yaml")["tableware"]
KINDS: dict[str, tuple[float, float]] = {kind: tuple(row["size"]) for kind, row in _DATA.items()}
"""What may be asked for: radius and height [m]."""
WALL = 0.004
"""Thickness of a mug's and a bowl's wall [m]."""
FACETS = 14
"""Boxes that a round wall is made of."""
FOOT = 0.002
"""Radius of the balls that a mug stands on [m]."""
MASSES: dict[str, float] = {kind: row["mass"] for kind, row in _DATA.items()}
"""Of a thing of stoneware, or full [kg]."""
COLOURS: dict[str, list[tuple[float, float, float]]] = {k: [tuple(c) for c in r["colours"]] for k, r in _DATA.items()}
"""What they may look like (r, g, b)."""


def add_object(
    spec: mujoco.MjSpec,
    kind: str,
    name: str,
    position: tuple[float, float, float],
    yaw: float,
    colour: tuple[float, float, float],
    *,
    loose: bool = True,
    size: float = 1.0,
) -> tuple[str, ...]:
    """Stand an object of `KINDS` somewhere; return the names of the geoms that are seen of it.

    Args:
        spec: the world to extend; it has the materials `steel` and `dark`.
        kind: one of `KINDS`.
        name: of its body, and of its free joint.
        position: the middle of its underside in the world [m].
        yaw: heading; that of a mug is where its handle is [rad].
        colour: r, g, b.
        loose: whether it can be moved.
        size: how large it is, as a multiple of what `KINDS` says; its mass stays.
    """
    material = f"{name}_coat"
    spec.add_material(name=material, rgba=[*colour, 1.0], specular=0.5, shininess=0.6)
    body = spec.worldbody.add_body(name=name, pos=list(position), quat=yaw_quat(yaw))
    if loose:
        body.add_freejoint(name=name)
    names = _BUILDERS[kind](spec, body, name, material)
    if size != 1.0:
        _resize(spec, body, size)
    return names


def _resize(spec: mujoco.MjSpec, body: mujoco.MjsBody, size: float) -> None:
    for geom in body.geoms:
        geom.pos = geom.pos * size
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            spec.mesh(geom.meshname).scale = [size] * 3
        elif np.isfinite(geom.fromto).all():
            geom.size[0] *= size
            geom.fromto = geom.fromto * size
        else:
            geom.size = geom.size * size


def _mug(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, material: str) -> tuple[str, ...]:
    radius, height = KINDS["mug"]
    profile = [
        (radius * 0.86, 0.0), (radius * 0.97, 0.006), (radius, 0.02), (radius, height - 0.002),
        (radius - WALL / 2, height), (radius - WALL, height - 0.002), (radius - WALL, 0.012), (0.002, 0.010),
    ]  # fmt: skip
    mesh = parts.add_mesh(spec, f"{name}_shell", *parts.lathe(profile, sides=36))
    parts.visual_mesh(body, mesh, material=material, name=f"{name}_cup")
    _ring(body, radius - WALL / 2, height, 0.9 * MASSES["mug"])
    parts.collider(body, CYLINDER, (radius - WALL, 0.004), (0.0, 0.0, 0.006), mass=0.04 * MASSES["mug"])
    # It stands on a ring of balls: on the corners of its wall it would have 61 contacts.
    for turn in 2 * np.pi * np.arange(8) / 8:
        pos = ((radius - WALL / 2) * np.cos(turn), (radius - WALL / 2) * np.sin(turn), FOOT)
        parts.collider(body, SPHERE, (FOOT,), pos, mass=0.01 * MASSES["mug"] / 8)
    names = [f"{name}_cup"]
    # Half a ring of capsules on one side: what a finger goes through.
    angles = np.linspace(-np.pi / 2, np.pi / 2, 7)
    arc = np.column_stack([radius - 0.004 + 0.028 * np.cos(angles), 0 * angles, height / 2 + 0.032 * np.sin(angles)])
    for k, (a, b) in enumerate(zip(arc, arc[1:], strict=False)):
        geom = parts.collider(body, CAPSULE, (0.0055,), mass=0.05 * MASSES["mug"] / 6)
        geom.fromto = [*a, *b]
        seen = parts.visual(body, CAPSULE, (0.0055,), material=material, name=f"{name}_ear_{k}")
        seen.fromto = [*a, *b]
        names.append(f"{name}_ear_{k}")
    return tuple(names)


def _bowl(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, material: str) -> tuple[str, ...]:
    radius, height = KINDS["bowl"]
    foot = 0.5 * radius
    curve = np.linspace(0.0, 1.0, 7)
    outer = [(foot + (radius - foot) * float(np.sqrt(s)), 0.004 + (height - 0.004) * float(s)) for s in curve]
    inner = [(r - WALL, max(z + 0.002, 0.008)) for r, z in reversed(outer)]
    mesh = parts.add_mesh(spec, f"{name}_shell", *parts.lathe([(foot, 0.0), *outer, *inner, (0.002, 0.008)], sides=40))
    parts.visual_mesh(body, mesh, material=material, name=f"{name}_shape")
    parts.collider(body, CYLINDER, (foot, 0.005), (0.0, 0.0, 0.005), mass=0.3 * MASSES["bowl"])
    # The wall in rings that follow its curve: a straight one leans by 34 deg, and no finger holds that by friction.
    for low, high in zip(outer[0::2], outer[2::2], strict=False):
        _leaning_ring(body, low, high, 0.7 * MASSES["bowl"] / 3)
    return (f"{name}_shape",)


def _can(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, material: str) -> tuple[str, ...]:
    radius, height = KINDS["can"]
    coat = [(radius, 0.008), (radius, height - 0.010)]
    lid = [(radius - 0.007, height), (radius - 0.005, height - 0.0008), (radius, height - 0.010)][::-1]
    for part, profile, look in (
        ("coat", coat, material),
        ("lid", lid, "steel"),
        ("foot", [(radius - 0.006, 0.0), (radius, 0.008)], "steel"),
    ):
        mesh = parts.add_mesh(spec, f"{name}_{part}_mesh", *parts.lathe(profile, sides=32))
        parts.visual_mesh(body, mesh, material=look, name=f"{name}_{part}")
    parts.collider(body, CYLINDER, (radius, height / 2), (0.0, 0.0, height / 2), mass=MASSES["can"])
    return f"{name}_coat", f"{name}_lid", f"{name}_foot"


def _bottle(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, material: str) -> tuple[str, ...]:
    radius, height = KINDS["bottle"]
    profile = [
        (radius * 0.9, 0.0), (radius, 0.006), (radius, 0.055), (radius - 0.002, 0.06), (radius, 0.065),
        (radius, 0.62 * height), (0.016, 0.86 * height), (0.014, 0.90 * height),
    ]  # fmt: skip
    mesh = parts.add_mesh(spec, f"{name}_shell", *parts.lathe(profile, sides=32))
    parts.visual_mesh(body, mesh, material=material, name=f"{name}_shape")
    parts.visual(body, CYLINDER, (0.0155, 0.05 * height), (0, 0, 0.95 * height), "label_white", name=f"{name}_cap")
    parts.visual(body, CYLINDER, (radius + 0.0005, 0.026), (0, 0, 0.096), "label_white", name=f"{name}_label")
    parts.collider(body, CYLINDER, (radius, 0.32 * height), (0, 0, 0.32 * height), mass=0.9 * MASSES["bottle"])
    neck = (0.0155, 0.16 * height)
    parts.collider(body, CYLINDER, neck, (0, 0, 0.84 * height), mass=0.08 * MASSES["bottle"])
    for share, low in ((0.83, 0.64), (0.62, 0.71)):  # the shoulder, in steps
        step = (share * radius, 0.035 * height)
        parts.collider(body, CYLINDER, step, (0, 0, (low + 0.035) * height), mass=0.01 * MASSES["bottle"])
    return f"{name}_shape", f"{name}_cap", f"{name}_label"


def _leaning_ring(body: mujoco.MjsBody, low: tuple[float, float], high: tuple[float, float], mass: float) -> None:
    """Add a wall of boxes around the z axis whose outer side goes from one (radius, height) to another."""
    run, rise = high[0] - low[0], high[1] - low[1]
    lean, length = float(np.arctan2(run, rise)), float(np.hypot(run, rise)) / 2
    radius, height = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])
    # The box's own middle is half a wall behind its outer side.
    radius, height = radius - 0.5 * WALL * np.cos(lean), height + 0.5 * WALL * np.sin(lean)
    for k in range(FACETS):
        turn = 2 * np.pi * k / FACETS
        size = (WALL / 2, np.pi * high[0] / FACETS, length)
        pos = (radius * np.cos(turn), radius * np.sin(turn), height)
        parts.collider(body, BOX, size, pos, quat=_turned(turn, lean), mass=mass / FACETS)


def _ring(body: mujoco.MjsBody, radius: float, height: float, mass: float) -> None:
    """Add an upright wall of boxes around the z axis, from `FOOT` up to `height`."""
    for k in range(FACETS):
        turn = 2 * np.pi * k / FACETS
        size = (WALL / 2, np.pi * radius / FACETS, (height - FOOT) / 2)
        pos = (radius * np.cos(turn), radius * np.sin(turn), (height + FOOT) / 2)
        parts.collider(body, BOX, size, pos, quat=_turned(turn, 0.0), mass=mass / FACETS)


def _turned(turn: float, lean: float) -> tuple[float, float, float, float]:
    """Return the quaternion of a turn about z after a lean outwards about y [rad]."""
    a, b = np.cos(turn / 2), np.sin(turn / 2)
    c, d = np.cos(lean / 2), np.sin(lean / 2)
    return float(a * c), float(-b * d), float(a * d), float(b * c)


_BUILDERS: dict[str, Callable[[mujoco.MjSpec, mujoco.MjsBody, str, str], tuple[str, ...]]] = {
    "mug": _mug,
    "bowl": _bowl,
    "can": _can,
    "bottle": _bottle,
}
