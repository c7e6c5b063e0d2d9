"""The last look before a grasp: what is narrow comes between the pads."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.skills.conftest import seen
from tests.skills.test_take_place import table_with_can

from golem.capabilities.grasping.base import Grasp
from golem.capabilities.grasping.centroid import grasp_pose
from golem.skills import palm_look
from golem.skills.palm_look import PalmLook, centred
from golem.skills.planned_motion import PlannedMotion
from golem.skills.runner import SkillRun
from golem.skills.take_config import TakeThingConfig
from golem.types import Array, LocalizedObject

UP = np.array([0.0, 0.0, 1.0])


def ring(radius: float, middle: Array, low: float, high: float) -> Array:
    """Return points (n, 3) of an upright round wall around `middle` (2,) [m]."""
    turn, z = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 2 * np.pi, 90), np.linspace(low, high, 30)))
    return np.column_stack([middle[0] + radius * np.cos(turn), middle[1] + radius * np.sin(turn), z])


@pytest.mark.parametrize("yaw", [0.0, 1.2])
def test_a_neck_beside_the_pads_comes_between_them(yaw: float) -> None:
    T = grasp_pose(np.array([0.5, 0.2, 1.0]), yaw, UP)
    neck = ring(0.015, T[:2, 3] + 0.012 * T[:2, 0] + 0.005 * T[:2, 1], 0.99, 1.04)
    got = centred(Grasp(T, 0.055, 1.0), neck).T_odom_gripper
    np.testing.assert_allclose(got[:3, 3], T[:3, 3] + 0.012 * T[:3, 0], atol=0.001)
    np.testing.assert_array_equal(got[:3, :3], T[:3, :3])


def test_what_is_wide_or_not_there_leaves_the_grasp_where_it_is() -> None:
    T = grasp_pose(np.array([0.5, 0.2, 1.0]), 0.0, UP)
    grasp = Grasp(T, 0.075, 1.0)
    can = ring(0.033, T[:2, 3] + 0.012 * T[:2, 0], 0.95, 1.04)
    below = ring(0.015, T[:2, 3], 0.90, 0.99)
    assert centred(grasp, can) is grasp and centred(grasp, below) is grasp


def test_what_a_localizer_gives_no_points_of_is_found_beside_where_it_seemed(
    world: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def nothing(*_: object, **__: object) -> None: ...

    async def view(*_: object) -> Array:
        return np.concatenate(table_with_can((0.52, -0.21)))

    monkeypatch.setattr(PlannedMotion, "to", nothing)
    monkeypatch.setattr(palm_look, "palm_view", view)
    look = PalmLook(world.context, PlannedMotion(world.context), "right", TakeThingConfig())
    target = seen("can", np.array([0.5, -0.2, -0.05]), 0.0)
    found: list[LocalizedObject] = []

    async def at() -> None:
        found.append((await look.at(target, -UP, 0.0))[0])

    run = SkillRun("look", at())  # pyright: ignore[reportArgumentType]
    for _ in range(2000):
        world.step()
        run.step()
        if found or run.result is not None:
            break
    np.testing.assert_allclose(np.median(found[0].points, axis=0)[:2], (0.52, -0.21), atol=0.01)
    assert np.isfinite(look.off).all() and 0.0 < np.hypot(*look.off) < 0.06
