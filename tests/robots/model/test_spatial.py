"""Poses seen from other frames."""

from __future__ import annotations

import numpy as np

from golem.robots.model.spatial import rotation_rpy, seen_from, transform


def test_a_pose_seen_from_another_frame_leads_back() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        base, palm = (transform(rng.normal(size=3), rotation_rpy(*rng.normal(size=3))) for _ in range(2))
        np.testing.assert_allclose(seen_from(base, palm), np.linalg.inv(base) @ palm, rtol=0.0, atol=1e-12)
