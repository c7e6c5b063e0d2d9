"""Smooth closed shells from a stack of rounded cross sections: what the robot's covers are made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

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
