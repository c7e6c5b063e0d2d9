"""Loosened screws: drawn from the seed, at rest where they stand, asleep until touched."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from tests.robots.worlds.conftest import Builder

from golem.robots.worlds.screws import ScrewRanges, draw_screws


def test_the_draw_depends_on_the_generator_alone_and_stays_in_range() -> None:
    ranges = ScrewRanges()
    first = draw_screws(np.random.default_rng(7), ranges, range(50))
    assert first == draw_screws(np.random.default_rng(7), ranges, range(50))
    assert first != draw_screws(np.random.default_rng(8), ranges, range(50))
    for name in ranges.__dataclass_fields__:
        low, high = getattr(ranges, name)
        values = np.array([getattr(draw, name) for draw in first])
        assert low <= values.min() and values.max() <= high and np.ptp(values) > 0.5 * (high - low)


def test_orientation_turns_the_vertical_onto_the_bore_axis() -> None:
    for draw in draw_screws(np.random.default_rng(0), ScrewRanges(tilt=(0.5, 0.5)), range(5)):
        out = np.zeros(3)
        mujoco.mju_rotVecQuat(out, np.array([0.0, 0.0, 1.0]), np.array(draw.quat()))
        np.testing.assert_allclose(out, draw.axis(), atol=1e-12)


@pytest.mark.parametrize("step", [0.0005, 0.002])
@pytest.mark.parametrize("seed", [0, 4])
def test_screws_rest_where_they_were_put_and_fall_asleep(world: Builder, seed: int, step: float) -> None:
    w = world(seed, step)
    start = w.data.qpos.copy()
    for _ in range(round(1.0 / step)):
        mujoco.mj_step(w.model, w.data)
    moved = (w.data.qpos - start).reshape(-1, 7)
    assert np.linalg.norm(moved[:, :3], axis=1).max() < 50e-6
    assert 2 * np.linalg.norm(moved[:, 4:], axis=1).max() < np.deg2rad(0.1)
    assert (w.data.tree_asleep >= 0).all() and w.data.ncon == 0


def test_a_sleeping_screw_wakes_alone_when_something_pushes_it(world: Builder) -> None:
    w = world()
    for _ in range(200):
        mujoco.mj_step(w.model, w.data)
    assert (w.data.tree_asleep >= 0).all()
    body = w.model.body(w.names.screws[3]).id
    w.data.xfrc_applied[body, 2] = 1.0
    for _ in range(20):
        mujoco.mj_step(w.model, w.data)
    awake = np.flatnonzero(w.data.tree_asleep < 0)
    assert awake.tolist() == [w.model.body_treeid[body]]


def test_nothing_has_a_contact_margin(world: Builder) -> None:
    model = world().model
    assert np.abs(model.geom_margin).max() == 0.0 and np.abs(model.geom_gap).max() == 0.0


def test_the_bore_leaves_the_drawn_clearance_on_every_side(world: Builder) -> None:
    w = world()
    mujoco.mj_forward(w.model, w.data)
    for draw, name in zip(w.draws, w.names.screws, strict=True):
        bore = w.model.body(f"bore_{draw.slot:02d}").id
        facets = range(w.model.body_geomadr[bore], w.model.body_geomadr[bore] + 12)
        shank = w.model.geom(f"{name}_shank").id
        gaps = [mujoco.mj_geomDistance(w.model, w.data, shank, facet, 0.01, np.zeros(6)) for facet in facets]
        np.testing.assert_allclose(gaps, draw.clearance / 2, atol=3e-6)
