"""The meshes are closed, face outwards and have the asked-for size."""

from __future__ import annotations

import numpy as np

from golem.robots.worlds import parts
from golem.types import Array


def volume(vertices: Array, faces: parts.Faces) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def test_lathe_encloses_the_volume_of_a_cone_frustum() -> None:
    vertices, faces = parts.lathe([(0.02, 0.0), (0.01, 0.03)], sides=200)
    exact = np.pi * 0.03 / 3 * (0.02**2 + 0.02 * 0.01 + 0.01**2)
    np.testing.assert_allclose(volume(vertices, faces), exact, rtol=1e-3)


def test_hexagon_has_the_width_across_flats() -> None:
    vertices, faces = parts.hexagon(0.010, 0.006, chamfer=0.0)
    flats = vertices @ np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0])
    np.testing.assert_allclose(np.ptp(flats), 0.010, rtol=1e-9)
    np.testing.assert_allclose(volume(vertices, faces), np.sqrt(3) / 2 * 0.010**2 * 0.006, rtol=1e-9)


def test_holed_plate_faces_up_and_is_open_in_the_middle() -> None:
    half, radius, sides = 0.007, 0.003, 24
    vertices, faces = parts.holed_plate(half, radius, 0.02, sides)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a) / 2
    on_top = (a[:, 2] == 0) & (b[:, 2] == 0) & (c[:, 2] == 0)
    assert (normal[on_top, 2] > 0).all()
    polygon = sides / 2 * radius**2 * np.sin(2 * np.pi / sides)
    np.testing.assert_allclose(normal[on_top, 2].sum(), (2 * half) ** 2 - polygon, rtol=1e-9)
