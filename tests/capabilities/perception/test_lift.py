"""Known depths lift to known points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from golem.capabilities.perception.lift import LiftConfig, lift, surface_depth
from golem.robots.sensors.cameras import CAMERAS, project
from golem.types import Array, Detection, RgbdImage

PALM = CAMERAS["right_hand"]
PLATE = 0.200
HEAD = 0.188


def frame(depth: NDArray[np.float32], pose: Array | None = None) -> RgbdImage:
    """Return a palm frame with this depth."""
    rgb = np.zeros((PALM.height, PALM.width, 3), np.uint8)
    return RgbdImage(1.5, PALM, rgb, depth.astype(np.float32), np.eye(4) if pose is None else pose)


def scene(center: tuple[float, float], radius: float, inside: float) -> NDArray[np.float32]:
    """Return a plate with a disc of another depth."""
    v, u = np.mgrid[: PALM.height, : PALM.width]
    disc = np.hypot(u - center[0], v - center[1]) <= radius
    return np.where(disc, inside, PLATE).astype(np.float32)


def detection(label: str, center: tuple[float, float], radius: float) -> Detection:
    """Return a square detection."""
    c = np.array(center)
    return Detection(label, 0.9, np.concatenate([c - radius, c + radius]), c)


def test_a_pixel_at_integer_coordinates_lies_on_its_own_ray() -> None:
    c = (300.0, 200.0)
    found = lift(frame(scene(c, 8, HEAD)), detection("screw", c, 8), LiftConfig())
    assert found is not None and found.t == 1.5
    expected = np.array([(300 - PALM.cx) / PALM.fx, (200 - PALM.cy) / PALM.fy, 1.0]) * HEAD
    np.testing.assert_allclose(found.position, expected, atol=1e-6)


@pytest.mark.parametrize(
    ("label", "inside", "found"),
    [("screw", PLATE + 0.02, False), ("screw", PLATE, True), ("screw", HEAD, True), ("tray", PLATE + 0.02, True)],
)
def test_what_lies_deeper_than_its_ground_is_no_screw(label: str, inside: float, found: bool) -> None:
    c = (300.0, 200.0)
    seen = lift(frame(scene(c, 8, inside)), detection(label, c, 8), LiftConfig())
    assert (seen is not None) is found


def test_position_and_points_go_through_the_pose_of_the_frame() -> None:
    c = (239.5, 134.5)  # the principal point
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", [2.9, 0.1, 0.7]).as_matrix()
    pose[:3, 3] = [0.4, -0.2, 1.2]
    found = lift(frame(scene(c, 8, HEAD), pose), detection("screw", c, 8), LiftConfig())
    assert found is not None
    np.testing.assert_allclose(found.position, pose[:3, 3] + pose[:3, 2] * HEAD, atol=1e-6)
    depths = (found.points - pose[:3, 3]) @ pose[:3, 2]
    assert set(np.round(depths, 4)) == {HEAD, PLATE}


def test_the_mask_says_which_pixel_each_point_was_lifted_from() -> None:
    c, depth = (60.0, 40.0), scene((60.0, 40.0), 8, HEAD)
    depth[38:43, 50:58] = 0.0  # a hole in the depth
    found = lift(frame(depth), detection("screw", c, 8), LiftConfig())
    assert found is not None and found.mask is not None
    mask = found.mask
    rows, columns = np.nonzero(mask.pixels)
    assert mask.pixels.dtype == np.bool_ and len(rows) == len(found.points) > 100
    pixels = project(PALM, found.points)
    np.testing.assert_allclose(pixels, np.column_stack([columns + mask.x, rows + mask.y]), atol=1e-3)
    assert not mask.pixels[40 - mask.y, 52 - mask.x]


def test_a_screw_is_the_near_mode_even_where_its_head_is_a_minority() -> None:
    c = (100.0, 100.0)
    found = lift(frame(scene(c, 3, HEAD)), detection("screw", c, 8), LiftConfig(near_share=0.2))
    assert found is not None
    np.testing.assert_allclose(found.position[2], HEAD, atol=1e-6)


def test_a_hole_is_as_high_as_the_plate_around_it() -> None:
    c = (100.0, 100.0)
    found = lift(frame(scene(c, 4, PLATE + 0.02)), detection("screw_hole", c, 4), LiftConfig())
    assert found is not None
    np.testing.assert_allclose(found.position[2], PLATE, atol=1e-6)


def test_a_few_flying_pixels_in_front_do_not_move_it() -> None:
    c = (100.0, 100.0)
    depth = scene(c, 8, HEAD)
    depth[99:101, 99] = 0.12
    found = lift(frame(depth), detection("screw", c, 8), LiftConfig())
    assert found is not None
    np.testing.assert_allclose(found.position[2], HEAD, atol=1e-6)


@pytest.mark.parametrize("invalid", [0.0, np.nan, np.inf])
def test_without_valid_depth_there_is_no_object(invalid: float) -> None:
    c = (100.0, 100.0)
    depth = scene(c, 8, HEAD)
    depth[90:111, 90:111] = invalid
    assert lift(frame(depth), detection("screw", c, 8), LiftConfig()) is None


def test_half_of_the_head_without_depth_is_enough() -> None:
    c = (100.0, 100.0)
    depth = scene(c, 8, HEAD)
    depth[:, ::2] = 0.0
    found = lift(frame(depth), detection("screw", c, 8), LiftConfig())
    assert found is not None
    np.testing.assert_allclose(found.position[2], HEAD, atol=1e-6)


def test_a_box_over_the_edge_of_the_image_is_clipped() -> None:
    c = (2.0, 1.0)
    found = lift(frame(scene(c, 8, HEAD)), detection("screw", c, 8), LiftConfig())
    assert found is not None
    np.testing.assert_allclose(found.position[2], HEAD, atol=1e-6)


@given(st.floats(0.08, 1.5), st.floats(0.0, 0.0005), st.integers(0, 2**31), st.floats(0.3, 1.0))
def test_the_nearest_mode_is_found_under_noise(z: float, noise: float, seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    near = z + noise * rng.standard_normal(round(100 * share))
    far = z + 0.05 + noise * rng.standard_normal(100 - len(near))
    depth = surface_depth(rng.permutation(np.concatenate([near, far])).astype(np.float32), LiftConfig(), flush=False)
    assert depth is not None and abs(depth - z) < 0.0015
