"""The cover has the published number of fasteners, evenly around its rim."""

from __future__ import annotations

import numpy as np

from golem.robots.worlds.layout import RIM_INSET, PackLayout


def test_sixty_eight_fasteners_on_the_rim_one_pitch_apart() -> None:
    layout = PackLayout()
    spots = layout.fasteners()
    assert spots.shape == (68, 3) and not spots[:, 2].any()
    steps = np.linalg.norm(np.roll(spots, -1, axis=0) - spots, axis=1)
    assert steps.min() > 0.085 and steps.max() < 0.098
    to_edge = np.minimum.reduce([spots[:, 0], layout.size_x - spots[:, 0], layout.size_y / 2 - np.abs(spots[:, 1])])
    np.testing.assert_allclose(to_edge, RIM_INSET, atol=1e-12)


def test_reachable_ones_are_on_the_near_edge_from_right_to_left() -> None:
    layout = PackLayout()
    slots = layout.reachable(0.35)
    y = layout.fasteners()[slots]
    assert len(slots) == 8
    np.testing.assert_allclose(y[:, 0], RIM_INSET)
    assert (np.diff(y[:, 1]) > 0).all() and np.abs(y[:, 1]).max() <= 0.35
    assert layout.reachable(0.0) == []
