"""Judges what is calibrated after the head, by the simulator's truth: palm cameras and LiDAR."""

from __future__ import annotations

import tempfile
from contextlib import closing
from pathlib import Path

import numpy as np

from golem.evaluation.base import DONE, TrialOutcome
from golem.robots.sensors.calibration_file import Calibration, LidarMount, point_moved, read_calibration
from golem.robots.sensors.mid360 import draw_mount
from golem.runtime.calibrate_command import lidar_stack
from golem.runtime.lockstep import build
from golem.stack import Stack
from golem.types import SIDES, Array

HAND_SKILL = "calibrate_hands"
HAND_AHEAD = 0.1
"""Distance along the optical axis at which a palm camera is judged [m], as in the realism profiles."""
HAND_GOOD = 0.001
"""Error there that counts as calibrated [m], of the worse of the two."""
LIDAR_SKILL = "calibrate_lidar"
LIDAR_AWAY = 3.0
"""Distance at which the LiDAR is judged [m]."""
LIDAR_GOOD = 0.010
"""Error there, RMS over all directions, that counts as calibrated [m]."""


def judge_hands(stack: Stack, seed: int, head: Calibration, views: int, method: str) -> TrialOutcome:
    """Calibrate the palm cameras of a robot whose head was calibrated, and judge them."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "calibration.json"
        head.save(file)
        corrected = stack.with_part("calibration", file=str(file)).with_skill(HAND_SKILL, folder=folder)
        running, robot = build(corrected, seed)
        with closing(robot):
            goal = {"file": file.name, "views": views, "zero": float(head.joint_sigma.max())}
            result = running.execute(HAND_SKILL, goal)
            names = [f"{side}_hand" for side in SIDES]
            before = max(point_moved(robot.calibration[name], HAND_AHEAD) for name in names)
        if not result.success:
            return TrialOutcome(False, result.stage, result.slot, result.reason, result.timings)
        found = read_calibration(file)
    after = max(found.moved(name, HAND_AHEAD) for name in names)
    deviation = max(found.moved_sigma(name, HAND_AHEAD) for name in names)
    good = after <= HAND_GOOD
    return TrialOutcome(
        good,
        DONE if good else "fit",
        None if good else f"skill: {method}",
        f"Palm cameras {before * 1e3:.1f} -> {after * 1e3:.2f} mm at 0.1 m.",
        result.timings,
        {"before": before, "after": after, "sigma": deviation},
    )


def judge_lidar(stack: Stack, seed: int, head: Calibration, method: str) -> TrialOutcome:
    """Calibrate the LiDAR of a robot whose head was calibrated, among the furniture of a kitchen, and judge it."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "calibration.json"
        head.save(file)
        running, robot = build(lidar_stack(stack).with_skill(LIDAR_SKILL, folder=folder), seed)
        with closing(robot):
            result = running.execute(LIDAR_SKILL, {"file": file.name})
        found = read_calibration(file).lidar
    if found is None:
        return TrialOutcome(False, result.stage, result.slot, result.reason, result.timings)
    true = draw_mount(stack.profile, seed)
    left = LidarMount(np.asarray(np.linalg.solve(true, found.pose), np.float64), found.covariance)
    before, after = LidarMount(true, found.covariance).moved(LIDAR_AWAY), left.moved(LIDAR_AWAY)
    good = after <= LIDAR_GOOD
    return TrialOutcome(
        good,
        DONE if good else "fit",
        None if good else f"skill: {method}",
        f"LiDAR {before * 1e3:.0f} -> {after * 1e3:.1f} mm at {LIDAR_AWAY:g} m.",
        result.timings,
        {
            "before": before,
            "after": after,
            "sigma": left.moved_sigma(LIDAR_AWAY),
            "angle_before": _angle(true),
            "angle_after": _angle(left.pose),
            "distance_before": float(np.linalg.norm(true[:3, 3])),
            "distance_after": float(np.linalg.norm(left.pose[:3, 3])),
        },
    )


def _angle(T: Array) -> float:
    """Return the angle by which the (4, 4) pose `T` turns [rad]."""
    return float(np.arccos(np.clip((np.trace(T[:3, :3]) - 1.0) / 2.0, -1.0, 1.0)))
