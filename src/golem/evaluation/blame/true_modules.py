"""Modules fed with the simulator's truth, and worse ones with a planted defect: for trials of blame only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from golem.capabilities.odometry.base import OdometryEstimate, Source
from golem.capabilities.odometry.legs import Legs
from golem.capabilities.odometry.lio import Lio
from golem.capabilities.perception.onnx_detector import OnnxDetector
from golem.evaluation.blame.altered_twin import AlteredTwin
from golem.interfaces.lidar import LegOdometry
from golem.types import BaseEstimate, LocalizedObject, LowState, RgbdImage


class TrueBase:
    """A `BaseEstimator` that knows pose, velocity and contacts of the base."""

    def __init__(self) -> None:
        """Look into the twin of the trial."""
        self._truth = AlteredTwin.newest().truth

    def reset(self, state: LowState) -> None:
        """Forget nothing."""

    def step(self, state: LowState, dt: float) -> BaseEstimate:
        """Return the truth; see `BaseEstimator`."""
        return self._truth.estimate(state.t)


class TrueOdometry(Legs):
    """A `LidarOdometry` that knows where the base is."""

    sources: tuple[Source, ...] = ("imu", "legs", "scan")

    def __init__(self) -> None:
        """Look into the twin of the trial."""
        super().__init__()
        self._truth = AlteredTwin.newest().truth

    def add_legs(self, legs: LegOdometry) -> None:
        """Take the waist from the legs, and the rest from the truth."""
        true = self._truth.estimate(legs.t)
        velocity = true.T_odom_base[:3, :3].T @ true.velocity
        super().add_legs(replace(legs, T_odom_base=true.T_odom_base, velocity=velocity, stale=False))


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
