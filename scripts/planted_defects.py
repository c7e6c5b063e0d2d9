"""Modules with a defect of a given size, which `scripts/blame_check.py` plants; a stack file may, too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from golem.capabilities.odometry.base import OdometryEstimate
from golem.capabilities.odometry.lio import Lio
from golem.capabilities.perception.onnx_detector import OnnxDetector
from golem.types import LocalizedObject, RgbdImage


class ShiftedDetector(OnnxDetector):
    """The shipped detector, whose objects are all `shift` [m] too far to the right in the image."""

    def __init__(self, shift: float = 0.0) -> None:
        """Load the shipped network; see `OnnxDetector`."""
        super().__init__()
        self._shift = shift

    def locate(self, frame: RgbdImage, labels: Sequence[str]) -> list[LocalizedObject]:
        """Return what the detector finds, beside where it is; see `Localizer`."""
        by = self._shift * frame.T_odom_optical[:3, 0]
        found = super().locate(frame, labels)
        return [replace(one, position=one.position + by, points=one.points + by) for one in found]


class ScaledOdometry(Lio):
    """The shipped odometry, which takes every way for `scale` times as long."""

    def __init__(self, scale: float = 1.0) -> None:
        """Begin; see `Lio`."""
        super().__init__()
        self._scale = np.array([scale, scale, 1.0])

    def estimate(self) -> OdometryEstimate | None:
        """Return where the robot is, by its wrong measure; see `LidarOdometry`."""
        found = super().estimate()
        if found is None:
            return None
        T = found.T_odom_base.copy()
        T[:3, 3] *= self._scale
        return replace(found, T_odom_base=T, velocity=found.velocity * self._scale)
