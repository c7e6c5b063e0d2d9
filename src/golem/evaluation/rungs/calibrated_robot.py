"""Rungs `calibration` and `tether-calibrated`: what a calibration by tags is worth, by the simulator's truth."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from golem import registry
from golem.errors import ConfigError
from golem.evaluation.base import DONE, Rung, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import episode_seed
from golem.evaluation.rungs.pick_screw import SLOT, PickRung
from golem.provenance import stack_facts
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.sensors.calibration_file import read_calibration
from golem.runtime.lockstep import build
from golem.stack import Stack, load_stack
from golem.types import Array

STACK = "tether"
"""The shipped stack whose robot is calibrated."""
SKILL = "calibrate"
AHEAD = np.array([0.0, 0.0, 1.0, 1.0])
"""Point on the optical axis at which the head camera is judged [m], as in the realism profiles."""
GOOD = 0.005
"""Error there that counts as calibrated [m]."""
ERRORS = ("before", "after", "sigma", "joint_before", "joint_after", "views", "residual")
"""What is recorded: of the camera [m], of the arms' encoders, root mean square [rad]."""


@dataclass(frozen=True)
class CalibrationOptions:
    """How long it is looked."""

    views: int = 20
    """Postures per hand."""


class CalibrationRung(Rung[CalibrationOptions]):
    """Calibrate a robot that was never calibrated: success is a head camera within 5 mm at 1 m."""

    name = "calibration"
    Options = CalibrationOptions
    default_methods = (SKILL,)

    def methods(self) -> tuple[str, ...]:
        """Return the one shipped skill; one's own may be named."""
        return (SKILL,)

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        """Return what determines a trial besides its seed; see `Rung`."""
        return stack_facts(tagged_stack(profile, overrides))

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        """Run one trial; see `Rung`."""
        running, robot = build(
            tagged_stack(spec.profile, spec.overrides), episode_seed(spec.seed, spec.index)
        )
        with closing(robot), tempfile.TemporaryDirectory() as folder:
            file = (artefacts or Path(folder)) / "calibration.json"
            goal = {"file": str(file), "views": self.options.views}
            result = running.execute(spec.method, goal)
            if not result.success:
                return TrialOutcome(False, result.stage, result.slot, result.reason, result.timings)
            found = read_calibration(file)
            true, claimed = robot.calibration["head"], found.cameras["head"]
            zeros = robot.true_joint_offset[13:], found.joint_offset[13:]
            values = (
                _apart(true),
                _apart(claimed),
                result.value.camera_sigma,
                _rms(zeros[0]),
                _rms(zeros[0] - zeros[1]),
                float(found.views),
                found.residual,
            )
        good = values[1] <= GOOD
        series: dict[str, float] = dict(zip(ERRORS, values, strict=True))
        return TrialOutcome(
            good,
            DONE if good else "fit",
            None if good else f"skill: {spec.method}",
            f"Head camera {values[0] * 1e3:.0f} -> {values[1] * 1e3:.1f} mm at 1 m.",
            result.timings,
            series,
        )


class CalibratedTether(PickRung):
    """Rung `tether` with a robot that was calibrated first: the same screws and errors, and a calibration's file."""

    name = "tether-calibrated"

    def __init__(self, options: Any = None) -> None:
        """Read the sweep; see `Rung`."""
        super().__init__(options)
        self._file: Path | None = None

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        """Calibrate, then run one trial; see `Rung`."""
        with tempfile.TemporaryDirectory() as folder:
            text = calibrated(spec.profile, episode_seed(spec.seed, spec.index))
            if not text:
                return TrialOutcome(False, "calibrate", f"skill: {SKILL}", "The calibration failed.")
            self._file = Path(folder) / "calibration.json"
            self._file.write_text(text, encoding="utf-8")
            try:
                return super().run(spec, artefacts)
            finally:
                self._file = None

    def _stack(self, method: str, profile: str, overrides: Mapping[str, str]) -> Stack:
        if SLOT in overrides:
            raise ConfigError(f"The method is what sits in {SLOT}; leave out --use {SLOT}=...")
        stack = load_stack(STACK, profile=profile).with_choice(SLOT, method)
        for slot, use in overrides.items():
            stack = stack.with_choice(slot, use)
        return stack if self._file is None else stack.with_part("calibration", file=str(self._file))


@lru_cache(maxsize=64)
def calibrated(profile: str, seed: int) -> str:
    """Return the calibration of a twin as its file's text; empty where it failed."""
    running, robot = build(tagged_stack(profile, {}), seed)
    with closing(robot), tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "calibration.json"
        result = running.execute(SKILL, {"file": str(file), "views": CalibrationOptions().views})
        return file.read_text(encoding="utf-8") if result.success else ""


def tagged_stack(profile: str, overrides: Mapping[str, str]) -> Stack:
    """Return the stack whose robot wears the tags.

    Raises:
        ConfigError: an override is wrong, or brings another robot.
    """
    stack = load_stack(STACK, profile=profile)
    for slot, use in overrides.items():
        stack = stack.with_choice(slot, use)
    if not issubclass(registry.load("robot", stack.choice("robot").use), MujocoRobot):
        raise ConfigError("This rung judges on the simulator's truth; leave out --use robot=...")
    return stack.with_options("robot", tags=True)


def _apart(T: Array) -> float:
    """Return how far the pose `T` (4, 4) moves the point at which the camera is judged [m]; the truth moves nothing."""
    return float(np.linalg.norm(T @ AHEAD - AHEAD))


def _rms(v: Array) -> float:
    return float(np.sqrt(np.mean(v * v)))
