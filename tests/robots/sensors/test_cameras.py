import numpy as np
import pytest

from golem.robots.sensors.cameras import CAMERAS, T_MUJOCO_OPTICAL, project, rays


@pytest.mark.parametrize("name", CAMERAS)
def test_rays_undo_projection(name: str) -> None:
    info = CAMERAS[name]
    points = rays(info).astype(float) * 0.7
    u, v = np.meshgrid(np.arange(info.width), np.arange(info.height))
    np.testing.assert_allclose(project(info, points), np.stack([u, v], axis=-1), atol=1e-3)


@pytest.mark.parametrize("name", CAMERAS)
def test_optical_axis_is_the_middle_of_the_image(name: str) -> None:
    info = CAMERAS[name]
    assert (info.cx, info.cy) == ((info.width - 1) / 2, (info.height - 1) / 2)


def test_palm_camera_has_the_field_of_view_of_the_labs_model() -> None:
    info = CAMERAS["left_hand"]
    assert np.degrees(2 * np.arctan(info.height / 2 / info.fy)) == pytest.approx(58, abs=0.05)


def test_optical_frame_looks_forward_and_down() -> None:
    np.testing.assert_array_equal(T_MUJOCO_OPTICAL[:3, :3] @ [0, 0, 1], [0, 0, -1])
    np.testing.assert_array_equal(T_MUJOCO_OPTICAL[:3, :3] @ [0, 1, 0], [0, -1, 0])


def test_rays_are_shared_and_cannot_be_written() -> None:
    info = CAMERAS["head"]
    assert rays(info) is rays(info)
    with pytest.raises(ValueError, match="read-only"):
        rays(info)[0, 0, 0] = 1
