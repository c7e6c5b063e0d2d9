"""How the robot looks: our own shells and discs over the vendor's proportions, seen but never touched.

Written for the pelvis, the torso and the left side; the right side is the mirror image.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from golem.package_data import load_data
from golem.robots.model import magpie_model
from golem.robots.model.spatial import quat_of, rotation_rpy
from golem.types import Array

Axis = Literal["x", "y", "z"]
Section = tuple[float, float, float, float, float]
"""Station along the axis, centre u, centre v, half width u, half width v [m]."""


@dataclass(frozen=True, slots=True)
class Loft:
    """A shell.

    Attributes:
        axis: direction of the stack. (u, v) are the two other axes in cyclic order: y z for x, z x for y, x y for z.
        sections: the cross sections, in rising order of the station.
        power: exponent of the superellipse of every section: 2 an ellipse, 4 and more a rounded rectangle.
        segments: corners of every section.
    """

    axis: Axis
    sections: Sequence[Section]
    power: float = 2.6
    segments: int = 20

    def mirrored(self) -> Loft:
        """Return the mirror image in the xz plane."""
        if self.axis == "y":
            flipped = [(-s, cu, cv, ru, rv) for s, cu, cv, ru, rv in reversed(self.sections)]
        elif self.axis == "x":
            flipped = [(s, -cu, cv, ru, rv) for s, cu, cv, ru, rv in self.sections]
        else:
            flipped = [(s, cu, -cv, ru, rv) for s, cu, cv, ru, rv in self.sections]
        return Loft(self.axis, flipped, self.power, self.segments)

    def mesh(self) -> tuple[Array, NDArray[np.int32]]:
        """Return vertices (n, 3) [m] and outward triangles (m, 3); the rims of the two caps are sharp."""
        n = self.segments
        angle = (np.arange(n) + 0.5) * 2.0 * np.pi / n
        circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        unit = np.sign(circle) * np.abs(circle) ** (2.0 / self.power)
        rings = [np.column_stack([np.full(n, s), unit * (ru, rv) + (cu, cv)]) for s, cu, cv, ru, rv in self.sections]
        here = np.arange(n)
        following = (here + 1) % n
        faces: list[NDArray[np.int64]] = []
        for k in range(len(rings) - 1):
            a, b = k * n, (k + 1) * n
            faces += [
                np.column_stack([a + here, a + following, b + following]),
                np.column_stack([a + here, b + following, b + here]),
            ]
        vertices = list(rings)
        for ring, outward in ((rings[0], -1), (rings[-1], 1)):
            start = sum(len(v) for v in vertices)
            vertices += [ring, ring.mean(axis=0, keepdims=True)]
            hub = np.full(n, start + n)
            edge = (here, following) if outward > 0 else (following, here)
            faces.append(np.column_stack([hub, start + edge[0], start + edge[1]]))
        swu = np.concatenate(vertices)
        order = {"x": [0, 1, 2], "y": [2, 0, 1], "z": [1, 2, 0]}[self.axis]
        return np.ascontiguousarray(swu[:, order]), np.concatenate(faces).astype(np.int32)


def ring(half_width: float, half_height: float, tube: float, segments: int = 28) -> tuple[Array, NDArray[np.int32]]:
    """Return the mesh of an oval ring in the yz plane: half axes to the middle of the tube, and its radius [m]."""
    sides = 8
    t = np.arange(segments) * 2.0 * np.pi / segments
    p = np.arange(sides) * 2.0 * np.pi / sides
    middle = np.stack([0.0 * t, half_width * np.cos(t), half_height * np.sin(t)], axis=1)
    normal = np.stack([0.0 * t, half_height * np.cos(t), half_width * np.sin(t)], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    out = np.cos(p)[None, :, None] * normal[:, None, :] + np.sin(p)[None, :, None] * np.array([1.0, 0.0, 0.0])
    vertices = (middle[:, None, :] + tube * out).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(segments), np.arange(sides), indexing="ij")
    a = (i * sides + j).ravel()
    b = (i * sides + (j + 1) % sides).ravel()
    c = ((i + 1) % segments * sides + (j + 1) % sides).ravel()
    d = ((i + 1) % segments * sides + j).ravel()
    faces = np.concatenate([np.column_stack([a, c, b]), np.column_stack([a, d, c])])
    return vertices, faces.astype(np.int32)


VISUAL_GROUP = 2
"""Geom group of everything in this module."""

Material = Literal["shell", "graphite", "joint", "visor", "rubber", "accent", "glow", "metal"]
DATA: dict[str, Any] = load_data(__package__, "looks.yaml")
"""Materials, and parts by where they are."""
_KINDS = {
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
}
_ALONG: dict[Axis, tuple[float, float, float]] = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}


@dataclass(frozen=True, slots=True)
class Solid:
    """A primitive: `size` as in MJCF, centre, and the direction of a cylinder's or capsule's length."""

    kind: str
    size: tuple[float, ...]
    pos: tuple[float, float, float]
    along: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def mirrored(self) -> Solid:
        """Return the mirror image in the xz plane."""
        (x, y, z), (a, b, c) = self.pos, self.along
        return replace(self, pos=(x, -y, z), along=(a, -b, c))


@dataclass(frozen=True, slots=True)
class VisualPart:
    """Something to see on a link."""

    link: str
    material: Material
    shape: Loft | Solid

    def mirrored(self) -> VisualPart:
        """Return the same part of the right side."""
        return VisualPart(self.link.replace("left_", "right_", 1), self.material, self.shape.mirrored())


def _disc(axis: Axis, radius: float, half: float, pos: tuple[float, float, float]) -> Solid:
    return Solid("cylinder", (radius, half), pos, _ALONG[axis])


def _rod(start: Sequence[float], end: Sequence[float], radius: float) -> Solid:
    a, b = np.array(start, float), np.array(end, float)
    middle, span = (a + b) / 2.0, b - a
    half = float(np.linalg.norm(span)) / 2.0
    x, y, z = (span / (2.0 * half)).tolist()
    return Solid("capsule", (radius, half), (float(middle[0]), float(middle[1]), float(middle[2])), (x, y, z))


_MAKE: dict[str, Callable[..., Loft | Solid]] = {"loft": Loft, "disc": _disc, "rod": _rod, "solid": Solid}


def _parts(name: str) -> list[VisualPart]:
    return [
        VisualPart(row["link"], row["material"], make(**row[kind]))
        for row in DATA[name]
        for kind, make in _MAKE.items()
        if kind in row
    ]


def _finger() -> Iterable[VisualPart]:
    crank, blade, _ = magpie_model.finger_names("left", "a")
    pivot = magpie_model.FINGER_PIVOT
    for x in (-0.0045, -0.0125):
        yield VisualPart(crank, "accent", _rod((x, 0, 0), (x, pivot[1], pivot[2]), 0.0042))
    yield VisualPart(blade, "metal", _disc("x", 0.0065, 0.0085, (0, 0, 0)))
    yield VisualPart(blade, "graphite", _rod((0, 0, 0), (0, 0.022, -0.004), 0.006))
    # The outer edge curves in to the tip; the inner edge is straight and carries the pad.
    inner = -0.0208
    outer = [(0.0, 0.003), (0.02, 0.004), (0.045, 0.0), (0.065, -0.0075), (0.0813, -0.0175)]
    yield VisualPart(
        blade, "graphite", Loft("z", [(z, 0.003, (inner + y) / 2, 0.008, (y - inner) / 2) for z, y in outer], power=5.0)
    )
    x, y, z = magpie_model.PAD_CENTER.tolist()
    yield VisualPart(blade, "rubber", Solid("box", tuple(magpie_model.PAD_HALF_SIZE.tolist()), (x, y, z)))


def parts(hands: bool) -> list[VisualPart]:
    """Return everything to see of the robot, with or without hands."""
    left = [*_parts("leg"), *_parts("arm")]
    whole = [*_parts("trunk"), *left, *(part.mirrored() for part in left)]
    if hands:
        # The two hands are the same hand twice, not mirror images: only finger b mirrors finger a.
        a = list(_finger())
        b = [VisualPart(p.link.replace("_a_", "_b_"), p.material, p.shape.mirrored()) for p in a]
        hand = [*_parts("hand"), *a, *b]
        whole += [*hand, *(replace(part, link=part.link.replace("left_", "right_", 1)) for part in hand)]
    return whole


def add_looks(spec: mujoco.MjSpec, hands: bool) -> None:
    """Add every part, and the materials and meshes it needs, to the robot's spec."""
    for name, material in DATA["materials"].items():
        spec.add_material(name=f"h12_{name}", **material)
    # The rim of the open face, tilted so that the chin lies further back than the brow.
    _add_mesh(spec, "h12_face", *ring(0.066, 0.080, 0.0085))
    tilt = quat_of(rotation_rpy(0.0, 0.22, 0.0))
    _add_geom(spec.body("torso_link"), "graphite", pos=(0.086, 0.0, 0.632), quat=tilt, meshname="h12_face")
    for number, part in enumerate(parts(hands)):
        body = spec.body(part.link)
        if isinstance(part.shape, Loft):
            mesh = f"h12_{part.link}_{number}"
            _add_mesh(spec, mesh, *part.shape.mesh())
            _add_geom(body, part.material, meshname=mesh)
        else:
            size = [*part.shape.size, 0.0, 0.0][:3]
            quat = quat_of(_turned(part.shape.along))
            _add_geom(body, part.material, kind=_KINDS[part.shape.kind], size=size, pos=part.shape.pos, quat=quat)


def _turned(along: Sequence[float]) -> Array:
    """Return a rotation that takes z to the unit vector `along`."""
    z = np.array(along, float)
    x = np.cross((0.0, 1.0, 0.0) if abs(z[1]) < 0.9 else (0.0, 0.0, 1.0), z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _add_mesh(spec: mujoco.MjSpec, name: str, vertices: Array, faces: NDArray[np.int32]) -> None:
    spec.add_mesh(name=name, uservert=vertices.ravel(), userface=faces.ravel())


def _add_geom(
    body: mujoco.MjsBody,
    material: Material,
    *,
    kind: mujoco.mjtGeom = mujoco.mjtGeom.mjGEOM_MESH,
    size: Sequence[float] = (0.0, 0.0, 0.0),
    pos: Sequence[float] = (0.0, 0.0, 0.0),
    quat: Sequence[float] | Array = (1.0, 0.0, 0.0, 0.0),
    meshname: str = "",
) -> None:
    body.add_geom(
        type=kind,
        size=list(size),
        pos=list(pos),
        quat=list(quat),
        meshname=meshname,
        material=f"h12_{material}",
        contype=0,
        conaffinity=0,
        group=VISUAL_GROUP,
        mass=0.0,
    )
