"""The pack is solid where it should be and says where its parts are."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from tests.robots.worlds.conftest import Builder

from golem.errors import ConfigError
from golem.robots.worlds.layout import PackLayout
from golem.robots.worlds.pack import add_pack
from golem.robots.worlds.parts import COLLISION_GROUP
from golem.robots.worlds.screws import ScrewRanges, draw_screws


def height(model: mujoco.MjModel, data: mujoco.MjData, x: float, y: float) -> float:
    """Return the height of the highest collision shape under (x, y)."""
    groups = np.zeros(6, np.uint8)
    groups[COLLISION_GROUP] = 1
    start = 2.0
    geom = np.zeros(1, np.int32)
    down = mujoco.mj_ray(model, data, np.array([x, y, start]), np.array([0.0, 0.0, -1.0]), groups, 1, -1, geom)
    return start - down


def test_the_rim_has_no_gap_beside_the_bores(world: Builder) -> None:
    w = world()
    for name in w.names.screws:  # out of the way
        w.data.qpos[w.model.joint(name).qposadr[0] + 2] = -3.0
    mujoco.mj_forward(w.model, w.data)
    radii = {tuple(m[:2]): d.bore_radius for m, d in zip(w.names.mouths, w.draws, strict=True)}
    deep = 0
    for x in np.arange(0.001, 0.06, 0.0013):
        for y in np.arange(-0.30, -0.08, 0.0013):
            at = np.array([w.layout.near_edge + x, y])
            into_bore = any(np.hypot(*(at - m)) < 1.06 * r + 1e-4 for m, r in radii.items())
            z = height(w.model, w.data, *at) - w.layout.top_z
            if into_bore:
                deep += z < -0.004
            else:
                assert -0.0015 < z < 0.008
    assert deep > 10


def test_a_dropped_screw_stays_on_the_cover_and_in_the_tray(world: Builder) -> None:
    w = world()
    on_cover, in_tray = (w.model.joint(n).qposadr[0] for n in w.names.screws[:2])
    w.data.qpos[on_cover : on_cover + 3] = [w.layout.near_edge + 0.07, 0.4, w.layout.top_z + 0.05]
    w.data.qpos[in_tray : in_tray + 3] = [*w.layout.tray_xy, w.layout.tray_z + 0.10]
    for _ in range(1600):
        mujoco.mj_step(w.model, w.data)
    z = w.data.qpos[on_cover + 2] - w.layout.top_z
    assert 0.0 < z < 0.03
    inside = np.abs(w.data.qpos[in_tray : in_tray + 2] - w.layout.tray_xy) < np.array(w.layout.tray_size[:2]) / 2
    assert inside.all() and 0.0 < w.data.qpos[in_tray + 2] - w.layout.tray_z < 0.03


def test_parts_are_where_they_are_seen(world: Builder) -> None:
    w = world()
    mujoco.mj_forward(w.model, w.data)
    counts = {}
    for part in w.names.parts:
        counts[part.label] = counts.get(part.label, 0) + 1
        if part.geoms:
            centres = np.array([w.data.geom(name).xpos for name in part.geoms])
            assert np.linalg.norm(centres[:, :2].mean(axis=0) - part.position[:2]) < 0.004
    assert counts["screw"] + counts["screw_hole"] == 68
    assert counts["screw_hole"] == len(w.layout.empty_holes) and counts["tray"] == 1
    assert counts["nut"] == 2 * counts["bus_bar"] >= 8


@pytest.mark.parametrize("slots", [[3, 3], [68], [PackLayout().empty_holes[0]]])
def test_places_that_cannot_hold_a_screw_are_refused(slots: list[int]) -> None:
    draws = draw_screws(np.random.default_rng(0), ScrewRanges(), slots)
    with pytest.raises(ConfigError, match="0 to 67 once"):
        add_pack(mujoco.MjSpec(), PackLayout(), draws)
