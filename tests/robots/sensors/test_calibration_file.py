"""A calibration comes back from its file as it was; what is none is refused in a sentence."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.robots.sensors.calibration_file import Calibration, CalibrationPart, read_calibration
from golem.types import NUM_JOINTS


def example() -> Calibration:
    offset, sigma = np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS)
    offset[13:], sigma[13:] = 0.02, 0.001
    T = np.eye(4)
    T[:3, 3] = (0.01, 0.02, 0.03)
    return Calibration({"head": T}, {"head": 1e-6 * np.eye(6)}, offset, sigma, 0.4, 24)


def test_it_comes_back_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "calibration.json"
    example().save(path)
    back = read_calibration(path)
    for name in ("joint_offset", "joint_sigma"):
        assert (getattr(back, name) == getattr(example(), name)).all()
    assert (back.cameras["head"] == example().cameras["head"]).all()
    assert (back.covariances["head"] == example().covariances["head"]).all()
    assert (back.residual, back.views) == (0.4, 24)


def test_only_what_was_calibrated_is_replaced() -> None:
    cameras = {"head": 2.0 * np.eye(4), "left_hand": 3.0 * np.eye(4)}
    merged = example().merged(cameras)
    assert (merged["head"] == example().cameras["head"]).all()
    assert (merged["left_hand"] == cameras["left_hand"]).all()
    assert CalibrationPart().load().merged(cameras) == cameras


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"cameras": {"head": 1}}'])
def test_what_is_none_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "none.json"
    path.write_text(text)
    with pytest.raises(ConfigError, match="golem calibrate head writes one"):
        CalibrationPart(path).load()


def test_a_zero_that_cannot_be_one_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "wild.json"
    wild = example()
    replace(wild, joint_offset=wild.joint_offset + 0.5).save(path)
    with pytest.raises(ConfigError, match="no encoder's zero"):
        read_calibration(path)
    rows = json.loads(path.read_text())
    rows["cameras"] = {"nose": rows["cameras"]["head"]}
    path.write_text(json.dumps(rows))
    with pytest.raises(ConfigError, match="a camera is unknown"):
        read_calibration(path)
