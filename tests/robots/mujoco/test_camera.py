import multiprocessing

import mujoco
import numpy as np
import pytest

from golem.robots.mujoco.camera import CLIP, CameraRig
from golem.robots.sensors.cameras import CAMERAS, T_MUJOCO_OPTICAL, project, rays
from golem.types import Array, CameraInfo

BOX, SPHERE = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_SPHERE
HEAD, PALM = CAMERAS["head"], CAMERAS["left_hand"]


class Scene:
    """A tilted, displaced camera with geoms given in its optical frame."""

    def __init__(self, info: CameraInfo) -> None:
        self.info = info
        self.spec = mujoco.MjSpec()
        # Lopsided on purpose: the intrinsics must come from the info alone.
        body = self.spec.worldbody.add_body(pos=[1.0, -2.0, 3.0], quat=[0.5, 0.5, -0.1, 0.7])
        body.add_camera(name=info.name, pos=[0.1, 0.2, -0.3], quat=[0.9, -0.3, 0.2, 0.1], fovy=33)
        # Geoms hang on a body whose frame is the optical frame, aligned below.
        model = self.spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        R = data.cam_xmat[0].reshape(3, 3) @ T_MUJOCO_OPTICAL[:3, :3]
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, R.ravel())
        self.optical = self.spec.worldbody.add_body(pos=data.cam_xpos[0].tolist(), quat=quat.tolist())

    def add(self, geom: mujoco.mjtGeom, position: Array, size: list[float], group: int = 0) -> None:
        self.optical.add_geom(type=geom, pos=list(position), size=size, group=group, rgba=[1, 1, 1, 1])

    def compile(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        model = self.spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        return model, data


def blob_centers(info: CameraInfo, points: Array) -> Array:
    """Render thin squares, face on, and return the mean pixel of each."""
    scene = Scene(info)
    for p in points:
        scene.add(BOX, p, [0.02 * p[2], 0.02 * p[2], 1e-5])
    model, data = scene.compile()
    with CameraRig(model, [info]) as rig:
        ids = rig.segment(data, info.name)
    return np.array([np.argwhere(ids == k).mean(axis=0)[::-1] for k in range(len(points))])


@pytest.mark.parametrize("info", [HEAD, PALM], ids=lambda info: info.name)
def test_known_points_fall_on_the_pixels_the_intrinsics_say(info: CameraInfo) -> None:
    rng = np.random.default_rng(0)
    errors = []
    for _ in range(8):
        grid = np.stack(np.meshgrid([-0.3, 0.0, 0.3], [-0.2, 0.0, 0.2]), axis=-1).reshape(-1, 2)
        grid = grid + rng.uniform(-0.05, 0.05, grid.shape)
        points = np.column_stack([grid, np.ones(len(grid))]) * rng.uniform(0.2, 1.5, (len(grid), 1))
        errors.append(blob_centers(info, points) - project(info, points))
    # One blob's centre is known to a fraction of a pixel, the mean over many blobs to far less.
    assert np.abs(np.concatenate(errors)).max() < 0.55
    assert np.abs(np.concatenate(errors).mean(axis=0)).max() < 0.1


def test_off_centre_and_unequal_intrinsics_hold_too() -> None:
    info = CameraInfo("odd", 320, 240, 300.0, 330.0, 140.0, 130.0, 0.1, 3.0, 15.0)
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-0.3, 0.3, (12, 2)), np.ones(12)])
    points = points[np.argsort(points[:, 0])][::2]
    errors = blob_centers(info, points) - project(info, points)
    assert np.abs(errors).max() < 0.55
    assert np.abs(errors.mean(axis=0)).max() < 0.25


@pytest.mark.parametrize(("info", "z"), [(HEAD, 0.3), (HEAD, 3.0), (PALM, 0.07), (PALM, 0.5)])
def test_depth_is_metres_along_the_optical_axis(info: CameraInfo, z: float) -> None:
    scene = Scene(info)
    scene.add(BOX, np.array([0, 0, z + 0.01]), [3 * z, 3 * z, 0.01])
    model, data = scene.compile()
    with CameraRig(model, [info]) as rig:
        _, depth = rig.render(data, info.name)
    assert depth.shape == (info.height, info.width)
    assert depth.dtype == np.float32
    # A plane at right angles to the axis has one depth, up to the corners.
    np.testing.assert_allclose(depth, z, atol=2e-5 * z + 1e-5)


def test_depth_and_colour_of_a_sphere_agree_with_geometry() -> None:
    center, radius = np.array([0.1, -0.05, 0.8]), 0.1
    scene = Scene(HEAD)
    scene.add(SPHERE, center, [radius, 0, 0])
    model, data = scene.compile()
    with CameraRig(model, [HEAD]) as rig:
        rgb, depth = rig.render(data, "head")
        ids = rig.segment(data, "head")
    points = rays(HEAD) * depth[..., None]
    distance = np.linalg.norm(points[ids == 0] - center, axis=1)
    # MuJoCo draws spheres as polyhedra: the surface may lie a little inside.
    assert radius * 0.985 < distance.min()
    assert distance.max() < radius * 1.001
    assert rgb[ids == 0].mean() > 30
    np.testing.assert_array_equal(rgb[ids == -1], 0)
    np.testing.assert_allclose(depth[ids == -1], CLIP[1], rtol=1e-5)


def test_collision_shapes_are_not_seen() -> None:
    scene = Scene(PALM)
    for group, x in [(0, -0.1), (2, 0.0), (3, 0.1)]:
        scene.add(BOX, np.array([x, 0, 0.3]), [0.02, 0.02, 0.02], group)
    model, data = scene.compile()
    with CameraRig(model, [PALM]) as rig:
        assert set(np.unique(rig.segment(data, "left_hand"))) == {-1, 0, 1}


def two_cameras() -> tuple[mujoco.MjModel, mujoco.MjData]:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(pos=[0, 0, 1], quat=[0.9, 0.1, 0.2, 0.3])
    for info in (HEAD, PALM):
        body.add_camera(name=info.name, pos=[0.1, 0.0, 0.0])
    rng = np.random.default_rng(0)
    for _ in range(40):
        spec.worldbody.add_geom(
            type=BOX, pos=rng.uniform(-1, 1, 3), size=rng.uniform(0.02, 0.2, 3), rgba=[*rng.random(3), 1]
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def checksum(seed: int) -> tuple[int, float]:
    del seed
    model, data = two_cameras()
    with CameraRig(model, [HEAD]) as rig:
        rgb, depth = rig.render(data, "head")
    return int(rgb.sum()), float(depth.sum())


def test_rigs_share_a_context_without_disturbing_each_other() -> None:
    model, data = two_cameras()
    with CameraRig(model, [HEAD, PALM]) as plain:
        before = [plain.render(data, name) for name in ("head", "left_hand")]
        with CameraRig(model, [HEAD], fancy=True) as fancy:
            smooth, _ = fancy.render(data, "head")
            after = [plain.render(data, name) for name in ("head", "left_hand")]
        last = plain.render(data, "head")
    for (rgb, depth), (rgb2, depth2) in zip([*before, before[0]], [*after, last], strict=True):
        np.testing.assert_array_equal(rgb, rgb2)
        np.testing.assert_array_equal(depth, depth2)
    # Smoothing and shadows change the picture, not what is in it.
    assert (smooth != before[0][0]).any()
    assert np.abs(smooth.astype(float) - before[0][0]).mean() < 20


def test_the_models_own_settings_survive() -> None:
    model, _ = two_cameras()
    before = (model.vis.global_.offwidth, model.vis.quality.offsamples, model.vis.quality.shadowsize)
    with CameraRig(model, [HEAD]):
        pass
    assert (model.vis.global_.offwidth, model.vis.quality.offsamples, model.vis.quality.shadowsize) == before


def test_spawned_workers_see_what_this_process_sees() -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.map(checksum, [0]) == [checksum(0)]


def test_a_closed_rig_refuses_and_closes_twice() -> None:
    model, data = two_cameras()
    rig = CameraRig(model, [HEAD])
    rig.close()
    rig.close()
    with pytest.raises(RuntimeError, match="closed"):
        rig.render(data, "head")


def test_a_camera_the_model_lacks_is_refused() -> None:
    model, _ = two_cameras()
    with pytest.raises(KeyError, match="right_hand"):
        CameraRig(model, [CAMERAS["right_hand"]])
