"""Calibrate the head camera and the arms' encoders by the tags on the hands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from golem.capabilities.calibration.kinematic_fit import TagView, fit
from golem.capabilities.calibration.view_postures import view_postures
from golem.options import require
from golem.robots.sensors.calibration import read_calibration
from golem.skills.base import SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.kept_file import KeptFileConfig, check_file_name, kept_file
from golem.skills.tag_looks import TagLooks
from golem.types import SIDES

CAMERA = "head"
AHEAD = 1.0
"""Distance ahead of the head camera at which its mount is judged [m]."""


@dataclass(frozen=True, slots=True)
class CalibrateGoal:
    """What to calibrate by.

    Attributes:
        file: plain name of the file of the calibration; empty writes none. The folder is an option of the skill.
        views: postures per hand.
        settle: time the arm gets to come to rest in each [s].
        seed: of the postures.
    """

    file: str = "calibration.json"
    views: int = 16
    settle: float = 0.5
    seed: int = 0

    def __post_init__(self) -> None:
        require(
            "",
            ("number of views per hand", self.views, 6 <= self.views <= 60, "6 to 60"),
            ("time to settle", self.settle, 0.0 <= self.settle <= 5.0, "0 to 5 s"),
            ("seed", self.seed, self.seed >= 0, "not negative"),
        )
        check_file_name(self.file, ".json")


@dataclass(frozen=True, slots=True)
class CalibrateReport:
    """What was found.

    Attributes:
        views: postures in which tags were seen.
        residual: root mean square error that is left of the tags' corners [px].
        camera: by how much the head camera's mount moves a point 1 m ahead [m].
        camera_sigma: standard deviation of that point, the largest of its axes [m].
        joint: largest zero error of an encoder that was found [rad].
        joint_sigma: largest standard deviation of one [rad].
    """

    views: int = 0
    residual: float = 0.0
    camera: float = 0.0
    camera_sigma: float = 0.0
    joint: float = 0.0
    joint_sigma: float = 0.0


class Calibrate:
    """Show the head camera both hands in many postures, and find its mount and the arms' encoder zeros.

    The hands wear their cuffs of tags. Stages: `look`, `fit`, `done`.
    """

    Goal = CalibrateGoal
    Result = CalibrateReport

    def __init__(self, config: KeptFileConfig | None = None) -> None:
        """Keep calibrations in the folder of `config`."""
        self.config = config or KeptFileConfig()

    def timeout(self, goal: CalibrateGoal) -> float:
        """Return the time it may take [s]; see `Skill`."""
        return 60.0 + 2 * goal.views * (8.0 + goal.settle)

    async def run(self, context: Context, goal: CalibrateGoal) -> SkillResult:
        """Calibrate; see `Skill`."""
        start = context.t
        file = kept_file(self.config.folder, goal.file, read_calibration) if goal.file else None
        looks, views = TagLooks(context, CAMERA), list[TagView]()
        for side in SIDES:
            postures = view_postures(side, goal.views, looks.free, looks.robot.model().placed, goal.seed)
            views += await looks.views(postures, side, (side,), goal.settle, f"{side} hand")
        if looks.info is None:
            raise StageFailed("look", "robot", "The head camera sends no images.")
        context.say("fit", f"Fitting {len(views)} views.")
        found = fit(views, looks.info)
        report = CalibrateReport(
            found.views,
            found.residual,
            found.moved(CAMERA, AHEAD),
            found.moved_sigma(CAMERA, AHEAD),
            float(np.abs(found.joint_offset).max()),
            float(found.joint_sigma.max()),
        )
        if file is not None:
            found.save(file)
        text = (
            f"{report.views} views, {report.residual:.2f} px left; the head camera sits "
            f"{report.camera * 1e3:.0f} mm (+- {report.camera_sigma * 1e3:.1f}) from where the model has it, at 1 m"
        )
        context.say("done", text)
        return SkillResult(True, "done", None, f"{text}.", {"calibrate": context.t - start}, report)
