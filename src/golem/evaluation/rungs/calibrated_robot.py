"""Rungs `calibration` and `tether-calibrated`: what a calibration by tags is worth, by the simulator's truth."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from golem import registry
from golem.errors import ConfigError
from golem.evaluation.base import DONE, Rung, TrialOutcome, TrialSpec
from golem.evaluation.blame.oracles import with_modules
from golem.evaluation.episodes.episode import episode_seed
from golem.evaluation.rungs.pick_screw import PickOptions, PickRung
from golem.output_file import write_file
from golem.provenance import stack_facts
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.sensors.calibration import Calibration, LidarMount, point_moved, read_calibration
from golem.robots.sensors.mid360 import draw_mount
from golem.runtime.calibrate_command import lidar_stack
from golem.runtime.lockstep import build, build_robot
from golem.skills.base import SkillResult, StageFailed
from golem.stack import Stack, load_stack
from golem.types import SIDES, Array

VIEWS = 16
"""Postures of each hand, by default."""
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
        result, true = calibrate_hands(stack, seed, head, views, file)
        if not result.success:
            return _failed(result)
        found = read_calibration(file)
    names = [f"{side}_hand" for side in SIDES]
    before = max(point_moved(true[name], HAND_AHEAD) for name in names)
    after = max(found.moved(name, HAND_AHEAD) for name in names)
    deviation = max(found.moved_sigma(name, HAND_AHEAD) for name in names)
    words = f"Palm cameras {before * 1e3:.1f} -> {after * 1e3:.2f} mm at 0.1 m."
    series = {"before": before, "after": after, "sigma": deviation}
    return _fitted(after <= HAND_GOOD, method, words, series, result.timings)


def calibrate_hands(
    stack: Stack, seed: int, head: Calibration, views: int, file: Path
) -> tuple[SkillResult, Mapping[str, Array]]:
    """Write `head` and what the palm cameras are off by to `file`; return how it went, and the true errors."""
    head.save(file)
    corrected = stack.with_part("calibration", file=str(file)).with_skill(HAND_SKILL, folder=str(file.parent))
    running, robot = build(corrected, seed)
    with closing(robot):
        goal = {"file": file.name, "views": views, "zero": float(head.joint_sigma.max())}
        return running.execute(HAND_SKILL, goal), robot.calibration


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
        return _failed(result)
    true = draw_mount(stack.profile, seed)
    left = LidarMount(np.asarray(np.linalg.solve(true, found.pose), np.float64), found.covariance)
    before, after = LidarMount(true, found.covariance).moved(LIDAR_AWAY), left.moved(LIDAR_AWAY)
    words = f"LiDAR {before * 1e3:.0f} -> {after * 1e3:.1f} mm at {LIDAR_AWAY:g} m."
    series = {
        "before": before,
        "after": after,
        "sigma": left.moved_sigma(LIDAR_AWAY),
        "angle_before": _angle(true),
        "angle_after": _angle(left.pose),
        "distance_before": float(np.linalg.norm(true[:3, 3])),
        "distance_after": float(np.linalg.norm(left.pose[:3, 3])),
    }
    return _fitted(after <= LIDAR_GOOD, method, words, series, result.timings)


def _fitted(
    good: bool, method: str, words: str, series: Mapping[str, float], timings: Mapping[str, float] | None = None
) -> TrialOutcome:
    return TrialOutcome(
        good, DONE if good else "fit", None if good else f"skill: {method}", words, timings or {}, series
    )


def _failed(result: SkillResult) -> TrialOutcome:
    return TrialOutcome(False, result.stage, result.slot, result.reason, result.timings)


def _angle(T: Array) -> float:
    return float(np.arccos(np.clip((np.trace(T[:3, :3]) - 1.0) / 2.0, -1.0, 1.0)))


STACK = "tether"
"""The shipped stack whose robot is calibrated."""
SKILL = "calibrate"
AHEAD = 1.0
"""Distance along the optical axis at which the head camera is judged [m], as in the realism profiles."""
GOOD = 0.005
"""Error there that counts as calibrated [m]."""
ERRORS = ("before", "after", "sigma", "joint_before", "joint_after", "views", "residual")
"""What is recorded: of the camera [m], of the arms' encoders, root mean square [rad]."""


@dataclass(frozen=True)
class HowCalibrated:
    """How a robot is calibrated."""

    views: int = VIEWS
    """Postures of each hand."""
    keep: str = ""
    """Folder in which calibrations are kept, by profile and episode, and from which they are taken where they are."""


@dataclass(frozen=True)
class CalibrationOptions(HowCalibrated):
    """What is calibrated, and how."""

    what: tuple[Literal["head", "hand", "lidar"], ...] = ("head",)
    """head; or hand, the palm cameras, or lidar, of a robot whose head was calibrated."""


@dataclass(frozen=True)
class CalibratedPickOptions(HowCalibrated, PickOptions):
    """The work place, and how the robot was calibrated."""


class CalibrationRung(Rung[CalibrationOptions]):
    """Calibrate a robot that was never calibrated: success is a head camera within 5 mm at 1 m.

    With `--what hand` it is two palm cameras within 1 mm at 0.1 m, with `--what lidar` a LiDAR within 10 mm at 3 m,
    both after the head.
    """

    name = "calibration"
    varied = {"what": "what"}
    Options = CalibrationOptions
    default_methods = (SKILL,)

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        return stack_facts(tagged_stack(profile, overrides))

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        stack = tagged_stack(spec.profile, spec.overrides)
        seed = episode_seed(spec.seed, spec.index)
        found = calibrate(stack, seed, self.options.views, self.options.keep)
        if isinstance(found, SkillResult):
            return _failed(found)
        if spec.case["what"] == "hand":
            return judge_hands(stack, seed, found, self.options.views, spec.method)
        if spec.case["what"] == "lidar":
            return judge_lidar(stack, seed, found, spec.method)
        with closing(build_robot(stack, seed)) as robot:
            zeros = robot.true_joint_offset[13:], found.joint_offset[13:]
            values = (
                point_moved(robot.calibration["head"], AHEAD),
                found.moved("head", AHEAD),
                found.moved_sigma("head", AHEAD),
                _rms(zeros[0]),
                _rms(zeros[0] - zeros[1]),
                float(found.views),
                found.residual,
            )
        words = f"Head camera {values[0] * 1e3:.0f} -> {values[1] * 1e3:.1f} mm at 1 m."
        return _fitted(values[1] <= GOOD, spec.method, words, dict(zip(ERRORS, values, strict=True)))


class CalibratedTether(PickRung):
    """Rung `tether` with a robot that was calibrated first: the same screws and errors, and a calibration's file."""

    name = "tether-calibrated"
    stack_name = STACK
    Options = CalibratedPickOptions
    options: CalibratedPickOptions
    _file: Path | None = None

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        seed = episode_seed(spec.seed, spec.index)
        found = calibrate(tagged_stack(spec.profile, {}), seed, self.options.views, self.options.keep)
        if isinstance(found, SkillResult):
            return _failed(found)
        with tempfile.TemporaryDirectory() as folder:
            self._file = Path(folder) / "calibration.json"
            found.save(self._file)
            try:
                return super().run(spec, artefacts)
            finally:
                self._file = None

    def _stack(self, method: str, profile: str, overrides: Mapping[str, str]) -> Stack:
        stack = super()._stack(method, profile, overrides)
        return stack if self._file is None else stack.with_part("calibration", file=str(self._file))


def calibrate(stack: Stack, seed: int, views: int, keep: str = "") -> Calibration | SkillResult:
    """Return the calibration of a twin that wears its tags, or how it failed."""
    kept = Path(keep) / f"{stack.profile}-{views}-{seed}.json" if keep else None
    if kept is not None and kept.is_file():
        return read_calibration(kept)
    with tempfile.TemporaryDirectory() as folder:
        file = kept or Path(folder) / "calibration.json"
        running, robot = build(stack.with_skill(SKILL, folder=str(file.parent)), seed)
        with closing(robot):
            result = running.execute(SKILL, {"file": file.name, "views": views})
        return read_calibration(file) if result.success else result


def calibrated(stack: Stack, seed: int, keep: str) -> Stack:
    """Return a stack whose robot was calibrated by its tags, head, encoders and palm cameras; files stay in `keep`.

    Raises StageFailed: calibrating failed.
    """
    tagged, file = tagged_stack(stack.profile, {}), Path(keep) / f"{stack.profile}-all-{seed}.json"
    if not file.is_file():
        file.parent.mkdir(parents=True, exist_ok=True)
        found = calibrate(tagged, seed, VIEWS, keep)
        with tempfile.TemporaryDirectory() as folder:
            draft = Path(folder) / file.name
            if isinstance(found, Calibration):
                found, _ = calibrate_hands(tagged, seed, found, VIEWS, draft)
            if not found.success:
                raise StageFailed(found.stage, found.slot or SKILL, found.reason)
            write_file(file, draft.read_text(encoding="utf-8"))
    return stack.with_part("calibration", file=str(file.resolve()))


def tagged_stack(profile: str, overrides: Mapping[str, str]) -> Stack:
    """Return the stack whose robot wears the tags, in an empty hall: it is the same robot as at the pack.

    Raises ConfigError: an override is wrong, or brings another robot.
    """
    stack = load_stack(STACK, profile=profile)
    stack = with_modules(stack, overrides)
    if not issubclass(registry.load("robot", stack.choice("robot").use), MujocoRobot):
        raise ConfigError("This rung judges on the simulator's truth; leave out --use robot=...")
    return stack.with_options("robot", tags=True, world="open")


def _rms(v: Array) -> float:
    return float(np.sqrt(np.mean(v * v)))
