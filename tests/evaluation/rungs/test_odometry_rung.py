"""Judging odometries: what is right is told apart from what is wrong, and one walk is heard by all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from golem.capabilities.odometry.base import OdometryEstimate
from golem.errors import ConfigError
from golem.evaluation.base import TrialSpec
from golem.evaluation.episodes.lidar_walk import PoseTrack, ate, end_error, nees, range_and_bearing
from golem.evaluation.harness.ladder import LadderConfig, run_ladder
from golem.evaluation.rungs.odometry import CONDITIONS, OdometryOptions, OdometryRung
from golem.robots.model.spatial import rotation_rpy, transform
from golem.types import Array


def track(offset: Array, deviation: float = 0.01, turn: float = 0.0, n: int = 200) -> PoseTrack:
    """Return 20 s of a walk along a bend, in odom turned by `turn` [rad] and off by `offset` (n, 3) [m]."""
    told: list[tuple[OdometryEstimate, Array]] = []
    frame = transform((1.0, 2.0, 0.1), rotation_rpy(0.0, 0.0, turn))
    for i in range(n):
        t = 0.1 * (i + 1)
        s = 0.5 * max(t - 4.0, 0.0)
        true = transform((s, 0.05 * s * s, 0.0), rotation_rpy(0.0, 0.0, 0.1 * s))
        own = frame @ true
        own[:3, 3] += offset[i]
        none = np.zeros(3)
        told.append((OdometryEstimate(t, own, none, none, deviation**2 * np.eye(6), np.eye(4)), true))
    return PoseTrack.of(told).anchored(4.0)


def test_where_odom_lies_is_no_error() -> None:
    exact = track(np.zeros((200, 3)), turn=0.7)
    assert ate(exact) < 1e-9
    assert np.abs(end_error(exact)).max() < 1e-9


def test_errors_are_the_ones_that_were_made() -> None:
    offset = np.zeros((200, 3))
    offset[150:, 2] = 0.03
    off = track(offset, turn=0.7)
    assert end_error(off) == pytest.approx((0.0, 0.03, 0.0), abs=1e-9)
    assert 0.005 < ate(off) < 0.02


def test_a_wrong_scale_and_a_wrong_direction_are_told_apart() -> None:
    exact = track(np.zeros((200, 3)), turn=0.7)
    assert range_and_bearing(exact) == pytest.approx((0.0, 0.0), abs=1e-9)
    far = float(np.linalg.norm(exact.true[-1, :2, 3]))
    exact.T[:, :3, 3] *= 1.01
    assert range_and_bearing(exact) == pytest.approx((0.01 * far, 0.0), abs=1e-9)
    exact.T[:] = transform(np.zeros(3), rotation_rpy(0.0, 0.0, 0.02)) @ exact.T
    assert range_and_bearing(exact) == pytest.approx((0.01 * far, 0.02), abs=1e-9)
    exact.T[-1] = exact.true[-1] = np.eye(4)
    assert range_and_bearing(exact) is None


@pytest.mark.parametrize("sigma", [0.02, 0.1])
def test_an_honest_covariance_has_a_ratio_of_one(sigma: float) -> None:
    offset = sigma * np.random.default_rng(0).standard_normal((200, 3))
    offset[:40] = 0.0
    found = nees(track(offset, sigma, turn=0.3), 4.0)
    assert found is not None and found[0] == pytest.approx(1.0, abs=0.2)
    late = nees(track(offset, sigma / 3.0), 4.0)
    assert late is not None and late[0] == pytest.approx(9.0, abs=2.0)


def test_a_method_without_covariance_has_no_ratio() -> None:
    assert nees(track(np.zeros((200, 3)), np.nan), 4.0) is None


def test_wrong_names_are_answered_with_the_valid_ones(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="Unknown method 'slam'; valid: kiss_icp, legs, lio, rko_lio"):
        run_ladder(LadderConfig(rung="odometry", method=("slam",), out=tmp_path / "run"))


def test_walks_are_shared_by_conditions_that_do_not_change_them() -> None:
    rung = OdometryRung(OdometryOptions(case=tuple(CONDITIONS)))
    keys = {
        str(case["case"]): rung.together(TrialSpec("odometry", "lio", "field", 0, 0, case=case))
        for case in rung.cases(lambda case: None)
    }
    assert keys["hall-6m"] == keys["dropout"] == keys["mount"] == keys["gap"]
    assert len(set(keys.values())) == 4


@pytest.mark.slow
def test_a_walk_is_followed_and_comes_out_the_same_again() -> None:
    rung = OdometryRung(OdometryOptions(case=("gap",)))
    specs = [TrialSpec("odometry", m, "field", 0, 0, case={"case": "gap"}) for m in ("lio", "legs")]
    first, again = (rung.run_together(specs) for _ in range(2))
    assert first[0].success and first[0].series["ate"] < 0.005
    for a, b in zip(first, again, strict=True):
        assert (a.detail, a.series) == (b.detail, b.series)
