"""What a head camera is off by, carried from one thing to another place."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from golem.skills.poses import head_off, share_off


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_a_camera_that_looks_aside_has_all_things_turned_about_the_robot(yaw: float) -> None:
    T, again = np.eye(4), np.eye(4)
    T[:3, :3] = Rotation.from_euler("z", 0.4).as_matrix()
    T[:3, 3] = (1.0, -2.0, 0.3)
    again[:3, :3] = Rotation.from_euler("z", 0.4 + yaw).as_matrix()  # the robot has turned and gone on
    again[:3, 3] = (3.0, 1.0, 0.3)

    def seen(base: np.ndarray, place: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """Return where a thing at `place` in base_link is in odom, and where a camera off by 0.1 rad has it."""
        error = Rotation.from_euler("z", 0.1).as_matrix()
        points = np.array([(*place, 0.0), error @ (*place, 0.0)]) @ base[:3, :3].T + base[:3, 3]
        return points[0, :2], points[1, :2]

    thing, had = seen(T, (0.56, 0.37))
    share = share_off(T, thing, thing - had)
    there, expected = seen(again, (0.5, -0.2))
    assert expected + head_off(again, expected, share) == pytest.approx(there, abs=1e-12)
    assert head_off(again, expected, (0.0, 0.0)) == pytest.approx((0.0, 0.0))
