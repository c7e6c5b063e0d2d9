"""Spheres of links: what they cover, how far they stand out, and which meshes are refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh

from golem.capabilities.collision.sphere_robot import SphereKind
from golem.errors import ConfigError
from golem.evaluation.spheres.packing_report import coverage
from golem.evaluation.spheres.sphere_packer import pack
from golem.evaluation.spheres.surface import LinkSurface, link_surface, open_edges
from golem.robots.model.link_geometry import SurfacePart


def part(mesh: trimesh.Trimesh) -> SurfacePart:
    return SurfacePart(np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64))


def surface(seed: int = 0) -> LinkSurface:
    rod = trimesh.creation.cylinder(radius=0.04, height=0.2)
    knob = trimesh.creation.box(extents=(0.06, 0.06, 0.06)).apply_translation((0.04, 0.0, 0.08))
    return link_surface("rod", [part(rod), part(knob)], seed)


def test_the_surface_is_that_of_the_union() -> None:
    s = surface()
    radius = np.linalg.norm(s.points[:, :2], axis=1)
    assert not ((radius < 0.035) & (np.abs(s.points[:, 2]) < 0.09)).any()  # the knob's faces inside the rod
    assert s.volume == pytest.approx(np.pi * 0.04**2 * 0.2 + 0.06**2 * 0.03, rel=0.08)
    heights = s.height(np.array([[0.0, 0.0, 0.0], [0.0, 0.06, 0.0]]))
    assert heights == pytest.approx([-0.04, 0.02], abs=2e-3)


@pytest.mark.parametrize("most", [8, 40])
def test_a_conservative_set_covers_what_it_has_not_seen(most: int) -> None:
    row = coverage("rod", surface(seed=1), pack(surface(), "conservative", 0.006, most))
    assert row.spheres <= most
    assert row.covered > 0.9995 and row.gap < 5e-4


@pytest.mark.slow
def test_more_spheres_stand_out_less_and_a_tight_set_is_smaller() -> None:
    def mean(kind: SphereKind, most: int) -> tuple[float, float]:
        row = coverage("rod", surface(), pack(surface(), kind, 0.003, most))
        return row.stands_out, row.volume_ratio

    few, many, tight = mean("conservative", 6), mean("conservative", 40), mean("tight", 40)
    assert many[0] < few[0] and tight[0] < 0.5 * many[0]
    assert few[1] > many[1] > 1.0 and tight[1] == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_a_packing_is_the_same_each_time() -> None:
    one, other = (pack(surface(), "conservative", 0.006, 10) for _ in range(2))
    assert np.array_equal(one.centres, other.centres) and np.array_equal(one.radii, other.radii)


@pytest.mark.parametrize("missing", [1, 2, 4])
def test_holes_are_closed_and_named(missing: int) -> None:
    box = trimesh.creation.box(extents=(0.1, 0.1, 0.1))
    vertices, faces = np.asarray(box.vertices, float), np.asarray(box.faces, np.int64)
    whole = link_surface("box", [SurfacePart(vertices, faces)])
    holed = link_surface("box", [SurfacePart(vertices, faces[missing:])])
    assert open_edges(vertices, faces) == 0 and open_edges(vertices, faces[missing:]) >= 3
    assert holed.volume == pytest.approx(whole.volume, rel=0.1 if missing < 4 else 0.6)
    assert (holed.height(np.zeros((1, 3))) < 0.0).all()


def test_edges_that_join_four_faces_are_no_hole() -> None:
    one = trimesh.creation.box(extents=(0.1, 0.1, 0.1))
    other = one.copy()
    other.apply_translation((0.1, 0.1, 0.0))
    both: Any = trimesh.util.concatenate([one, other])
    vertices, faces = np.asarray(both.vertices, float), np.asarray(both.faces, np.int64)
    assert not trimesh.Trimesh(vertices, faces).is_watertight and open_edges(vertices, faces) == 0
    assert link_surface("pair", [SurfacePart(vertices, faces)]).volume == pytest.approx(0.002, rel=0.05)


def test_a_plate_is_covered_though_it_has_no_inside() -> None:
    plate = np.array([[0, 0, 0], [0.2, 0, 0], [0.2, 0.1, 0], [0, 0.1, 0]], float)
    surface = link_surface("plate", [SurfacePart(plate, np.array([[0, 1, 2], [0, 2, 3]], np.int64))])
    packing = pack(surface, "conservative", 0.006, 30)
    assert packing.gap(surface.points).max() <= 0.0 and packing.radii.max() < 0.05


def test_meshes_that_are_not_finite_are_refused() -> None:
    box = trimesh.creation.box(extents=(0.1, 0.1, 0.1))
    vertices = np.asarray(box.vertices, float).copy()
    vertices[0, 0] = np.nan
    with pytest.raises(ConfigError, match="'lid' has a mesh with vertices that are not finite"):
        link_surface("lid", [SurfacePart(vertices, np.asarray(box.faces, np.int64))])
