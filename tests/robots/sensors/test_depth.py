import dataclasses

import numpy as np
import pytest

from golem.robots.sensors.cameras import CAMERAS, rays
from golem.robots.sensors.depth import STEREO, DepthErrors, StereoDepth
from golem.robots.sensors.profiles import D400
from golem.robots.sensors.streams import stream

NOISE = DepthErrors(subpixel=0.08, correlated=0.5, patch=8)


def wall(name: str, z: float) -> np.ndarray:
    info = CAMERAS[name]
    return np.full((info.height, info.width), z, np.float32)


def camera(name: str, errors: DepthErrors, seed: int = 0) -> StereoDepth:
    return StereoDepth(CAMERAS[name], errors, stream(seed, f"depth/{name}"))


# Published depth noise at 848 px width [m]: 0.08 px RMS, D435i (50 mm baseline) and D405 (18 mm).
@pytest.mark.parametrize(
    ("name", "z", "published", "rounding"),
    [
        ("head", 0.5, 0.0010, 0.00005),
        ("head", 1.0, 0.0038, 0.00005),
        ("head", 2.0, 0.0150, 0.0005),
        ("left_hand", 0.1, 0.0001, 0.00005),
        ("left_hand", 0.3, 0.0009, 0.00005),
        ("left_hand", 0.5, 0.0025, 0.0001),
    ],
)
def test_noise_follows_the_published_figures(name: str, z: float, published: float, rounding: float) -> None:
    measured = np.std(camera(name, D400).measure(wall(name, z)))
    assert measured * CAMERAS[name].width / 848 == pytest.approx(published, abs=rounding + 0.03 * published)


@pytest.mark.parametrize("z", [0.3, 0.5, 1.0, 2.0])
def test_noise_grows_with_the_square_of_the_distance(z: float) -> None:
    stereo = STEREO["head"]
    measured = np.std(camera("head", NOISE).measure(wall("head", z)))
    assert measured == pytest.approx(z**2 * 0.08 / (stereo.focal * stereo.baseline), rel=0.04)


def test_noise_is_unbiased() -> None:
    depth = camera("head", D400).measure(wall("head", 1.0))
    assert depth.mean() == pytest.approx(1.0, abs=0.0003)


@pytest.mark.parametrize(("share", "near_by"), [(0.0, 0.0), (0.5, 0.5), (1.0, 1.0)])
def test_share_of_the_noise_is_correlated_over_a_patch(share: float, near_by: float) -> None:
    errors = dataclasses.replace(NOISE, correlated=share)
    noise = np.concatenate([camera("head", errors, s).measure(wall("head", 1.0)) - 1 for s in range(4)])
    variance = noise.var()
    assert (noise[:, 1:] * noise[:, :-1]).mean() / variance == pytest.approx(near_by, abs=0.06)
    assert (noise[:, 32:] * noise[:, :-32]).mean() / variance == pytest.approx(0, abs=0.06)


def test_every_frame_differs_and_the_seed_repeats_them() -> None:
    first, again = camera("head", D400), camera("head", D400)
    a, b = first.measure(wall("head", 1.0)), first.measure(wall("head", 1.0))
    assert (a != b).mean() > 0.5
    np.testing.assert_array_equal(a, again.measure(wall("head", 1.0)))


def test_disparity_is_quantised() -> None:
    depth = camera("head", D400).measure(wall("head", 1.0))
    disparity = STEREO["head"].focal * STEREO["head"].baseline / depth * 32
    np.testing.assert_allclose(disparity, np.rint(disparity), atol=1e-3)


def test_no_depth_out_of_range() -> None:
    depth = wall("left_hand", 0.3)
    depth[:, :100], depth[:, 100:200] = 0.069, 0.501
    out = camera("left_hand", DepthErrors()).measure(depth)
    assert not out[:, :200].any()
    np.testing.assert_array_equal(out[:, 200:], depth[:, 200:])


def test_band_left_of_a_near_object_has_no_depth() -> None:
    info = CAMERAS["head"]
    depth = wall("head", 1.0)
    depth[200:280, 300:400] = 0.5
    lost = camera("head", DepthErrors(occlusion=True)).measure(depth)[240] == 0
    width = info.fx * STEREO["head"].baseline * (1 / 0.5 - 1 / 1.0)
    np.testing.assert_allclose(np.flatnonzero(lost)[[0, -1]], [300 - width, 299], atol=1)
    assert not (camera("head", DepthErrors(occlusion=True)).measure(depth)[100] == 0).any()


@pytest.mark.parametrize(("tilt", "seen"), [(60, True), (68, True), (72, False), (80, False)])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_surface_seen_too_flat_has_no_depth(tilt: float, seen: bool, axis: int) -> None:
    info = CAMERAS["head"]
    slope = np.zeros(3)
    slope[axis], slope[2] = np.sin(np.deg2rad(tilt)), np.cos(np.deg2rad(tilt))
    # The plane through (0, 0, 1) with that normal; looked at along the optical axis.
    depth = (slope[2] / np.maximum(rays(info) @ slope, 1e-6)).astype(np.float32)
    out = camera("head", DepthErrors(grazing=np.deg2rad(70))).measure(depth)
    assert (out[238:242, 318:322] > 0).all() == seen
    assert (out[238:242, 318:322] > 0).any() == seen


def test_a_specular_surface_loses_its_share() -> None:
    mirror = np.zeros((480, 640), bool)
    mirror[:, :320] = True
    depth = camera("head", DepthErrors(specular_loss=0.3)).measure(wall("head", 1.0), mirror)
    assert (depth[:, :320] == 0).mean() == pytest.approx(0.3, abs=0.04)
    assert (depth[:, 320:] > 0).all()


def test_the_input_is_left_alone() -> None:
    depth = wall("head", 1.0)
    camera("head", D400).measure(depth)
    np.testing.assert_array_equal(depth, wall("head", 1.0))
