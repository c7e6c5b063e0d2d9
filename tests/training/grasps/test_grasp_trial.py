"""Simulated grasps: what is held and what is not, and that labels depend on seed and number alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from golem.capabilities.grasping.centroid import grasp_pose
from golem.robots.worlds.tableware import KINDS
from golem.training.grasps import grasp_labels
from golem.training.grasps.grasp_labels import WARE, WRIST, GraspTrial, WareDraw, build_world

DOWN = np.array([0.0, 0.0, -1.0])


def test_a_can_is_held_by_its_middle_and_not_beside_it() -> None:
    trial = GraspTrial(build_world(WareDraw("can", 1.0, 0.0, DOWN)))
    middle = grasp_pose(np.array([0.0, 0.0, 0.09]), 0.3, -DOWN)
    assert trial.held(middle, 0.09)
    beside = middle.copy()
    beside[:3, 3] += 0.04 * middle[:3, 0]
    assert not trial.held(beside, 0.09)
    above = middle.copy()
    above[2, 3] = 0.14
    assert not trial.held(above, 0.09)
    assert trial.held(middle, 0.09)  # what was tried before changes nothing


def test_the_wrist_weighs_where_it_is() -> None:
    model = build_world(WareDraw("can", 1.0, 0.0, DOWN))
    np.testing.assert_array_equal(model.body(WRIST).ipos, 0.0)


def test_wares_keep_their_shape_in_every_size() -> None:
    for kind, (radius, height) in KINDS.items():
        large = build_world(WareDraw(kind, 1.2, 0.0, DOWN))
        nominal = build_world(WareDraw(kind, 1.0, 0.0, DOWN))
        ware = large.body(WARE).id
        assert large.body_mass[ware] == pytest.approx(nominal.body_mass[ware])
        trial = GraspTrial(large)
        geoms = np.flatnonzero((large.geom_bodyid == ware) & (large.geom_contype > 0))
        top = max(trial.data.geom_xpos[g, 2] + large.geom_aabb[g, 5] for g in geoms)
        assert top == pytest.approx(1.2 * height, abs=0.035), (kind, radius)


def test_labels_depend_on_seed_and_number_alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(grasp_labels, "PER_WARE", 5)
    one, again = (grasp_labels.label_ware(0, "train", 2) for _ in range(2))
    np.testing.assert_array_equal(one.held, again.held)
    np.testing.assert_array_equal(one.cells, again.cells)
    assert len(one.held) == 5

    monkeypatch.setattr(grasp_labels, "SHARD", 1)
    monkeypatch.setattr(grasp_labels, "label_ware", lambda seed, split, number: one)
    first = grasp_labels.label(tmp_path, 0, "train", 1)
    np.testing.assert_array_equal(first.cells, one.cells)
    monkeypatch.delattr(grasp_labels, "label_ware")
    kept = grasp_labels.label(tmp_path, 0, "train", 1)  # reads what is there
    np.testing.assert_array_equal(kept.facts, one.facts)
