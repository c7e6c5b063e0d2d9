"""The mapper on a made room: what moves is forgotten, what is broken is left out, a map from before is found again."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from golem.capabilities.mapping.map_file import save_map
from golem.capabilities.mapping.voxel_grid import FEWEST_IN_CELL, GridConfig, VoxelGridMapper, WallMeans
from golem.errors import ConfigError
from golem.evaluation.conformance.mapper_suite import _near as value_near
from golem.evaluation.conformance.room import HEIGHT, ROOM, MadeWalk
from golem.interfaces.nav_payloads import Scan
from golem.types import PlanarPose

FLOOR = np.array([0.0, 0.0, -HEIGHT])


def scans(count: int, at: PlanarPose | None = None, first: int = 1) -> list[Scan]:
    """Return scans of the room, in a frame that is at `at` in the room: what a robot there sees in its odom."""
    walk, rng = MadeWalk(ROOM, still=1e3), np.random.default_rng(first)
    pose = at or PlanarPose(0.0, 0.0, 0.0)
    walls = ROOM.copy()
    found = []
    T = walk.T_base_lidar
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    for i in range(first, first + count):
        scan = walk.scan(0.1 * i, rng)
        rays = scan.points / np.linalg.norm(scan.points, axis=1, keepdims=True)
        world = rays @ T[:3, :3].T @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        origin = np.array([pose.x + c * T[0, 3], pose.y + s * T[0, 3], T[2, 3]])
        with np.errstate(divide="ignore"):
            distance = ((np.where(world > 0, walls[:, 1], walls[:, 0]) - origin) / world).min(axis=1)
        noisy = distance + 0.02 * rng.standard_normal(len(distance))
        points = rays @ T[:3, :3].T * noisy[:, None] + T[:3, 3]
        found.append(Scan(scan.t, points, T[:3, 3].copy(), FLOOR))
    return found


def with_box(scan: Scan, x: float, y: float) -> Scan:
    """Return a scan in which somebody stands at a place: 200 points instead of what is behind."""
    rng = np.random.default_rng(round(100 * scan.t))
    body = np.column_stack([x + 0.1 * rng.random(200), y + 0.2 * rng.random(200), -0.8 + 1.1 * rng.random(200)])
    bearing = np.arctan2(scan.points[:, 1], scan.points[:, 0]) - math.atan2(y + 0.1, x)
    return replace(scan, points=np.concatenate([scan.points[np.abs(bearing) > 0.2 / x], body]))


def mapped(given: list[Scan], config: GridConfig | None = None) -> VoxelGridMapper:
    mapper = VoxelGridMapper(config)
    for scan in given:
        mapper.add_scan(scan)
    return mapper


def test_somebody_who_walked_on_is_forgotten() -> None:
    empty = scans(60)
    mapper = mapped([with_box(scan, 1.5, 0.0) for scan in empty[:6]], GridConfig(rays=1))
    grid = mapper.grid()
    assert grid is not None and value_near(grid, 1.55, 0.1, 0.1) == 100
    for scan in empty[6:]:
        mapper.add_scan(scan)
    grid = mapper.grid()
    assert grid is not None and value_near(grid, 1.55, 0.1, 0.1) == 0


def test_points_that_are_none_and_scans_of_other_clocks_are_left_out() -> None:
    good = scans(6)
    broken = replace(good[2], points=np.concatenate([good[2].points, np.full((50, 3), np.nan)]))
    late = replace(good[2], t=1e6)
    one, other = mapped(good), mapped([*good[:2], broken, late, *good[3:]])
    a, b = one.grid(), other.grid()
    assert a is not None and b is not None and (a.cells == b.cells).all()


def test_it_maps_on_after_a_time_without_scans() -> None:
    mapper = mapped(scans(3))
    for scan in scans(3, first=100):
        mapper.add_scan(with_box(scan, 1.5, 0.0))
    grid = mapper.grid()
    assert grid is not None and grid.t == pytest.approx(10.2) and value_near(grid, 1.55, 0.1, 0.1) == 100


def test_a_map_from_before_is_found_from_a_rough_guess(tmp_path: Path) -> None:
    stored = mapped(scans(8)).stored()
    assert stored is not None
    save_map(tmp_path / "room", stored)
    true = PlanarPose(1.2, -0.6, 0.3)
    config = GridConfig(file=str(tmp_path / "room.yaml"), guess=(0.8, -0.2, 0.1))
    mapper = mapped(scans(3, true, first=50), config)
    place = mapper.T_odom_map
    assert place is not None
    found = place.to(PlanarPose(0.0, 0.0, 0.0))
    off = true.to(found)
    assert math.hypot(off.x, off.y) < 0.02 and abs(off.yaw) < 0.005
    grid = mapper.grid()
    assert grid is not None
    assert grid.in_map.origin.x == pytest.approx(stored.origin.x) and grid.cells.shape == stored.cells.shape


def test_a_heading_that_drifted_far_from_where_odom_began_is_corrected(tmp_path: Path) -> None:
    stored = mapped(scans(8)).stored()
    assert stored is not None
    save_map(tmp_path / "room", stored)
    true, here = PlanarPose(1.2, -0.6, 0.3), PlanarPose(20.0, 0.0, 0.0)
    shift = np.array([here.x, 0.0, 0.0])
    seen = [replace(one, points=one.points + shift, origin=one.origin + shift) for one in scans(23, true, first=50)]
    began = true @ here.to(PlanarPose(0.0, 0.0, 0.0))
    config = GridConfig(file=str(tmp_path / "room.yaml"), guess=(began.x, began.y, began.yaw), follow=0.1)
    mapper = mapped(seen[:3], config)
    drift = PlanarPose(0.0, 0.0, 0.04)
    for one in seen[3:]:  # the odometry believes to have turned, where it is
        R = drift.matrix()[:3, :3]
        mapper.add_scan(replace(one, points=(one.points - shift) @ R.T + shift))
    place = mapper.T_odom_map
    assert place is not None
    off = true.to(place.to(here @ drift))
    assert math.hypot(off.x, off.y) < 0.02 and abs(off.yaw) < 0.005


def test_a_map_of_somewhere_else_is_not_believed(tmp_path: Path) -> None:
    stored = mapped(scans(8)).stored()
    assert stored is not None
    rng = np.random.default_rng(0)
    save_map(tmp_path / "else", replace(stored, walls=rng.uniform(-4.0, 9.0, (40, 2))))
    mapper = mapped(scans(3, first=50), GridConfig(file=str(tmp_path / "else.yaml")))
    assert mapper.T_odom_map is None and mapper.grid() is None
    assert "fits the map" in mapper.locate(PlanarPose(0.0, 0.0, 0.0))


def test_a_map_that_cannot_be_read_is_refused_when_the_mapper_is_made(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        VoxelGridMapper(GridConfig(file=str(tmp_path / "nothing.yaml")))


def test_the_map_grows_with_what_is_seen() -> None:
    mapper = mapped(scans(3))
    grid = mapper.grid()
    assert grid is not None
    before = grid.cells.shape
    far = scans(6)[5]
    mapper.add_scan(replace(far, points=far.points + [20.0, 0.0, 0.0], origin=far.origin + [20.0, 0.0, 0.0]))
    grid = mapper.grid()
    assert grid is not None and grid.cells.shape[1] > before[1]
    assert value_near(grid, float(ROOM[0, 0]), 0.5, 0.2) == 100 and value_near(grid, 1.5, 0.0, 0.0) == 0


def test_a_cell_of_a_wall_counts_from_few_points_on() -> None:
    walls = WallMeans(0.1)
    walls.add(np.full((FEWEST_IN_CELL - 1, 2), 0.05))
    assert not len(walls.places())
    walls.add(np.full((1, 2), 0.09))
    np.testing.assert_allclose(walls.places(), [[0.06, 0.06]])
