"""Calibrate the palm cameras by the tags on the other hand."""

from __future__ import annotations

from dataclasses import dataclass, replace

from golem.capabilities.calibration.hand_fit import OTHER, fit_hand, hand_view_postures
from golem.capabilities.calibration.kinematic_fit import ZERO
from golem.options import require
from golem.robots.sensors.calibration import Calibration, read_calibration
from golem.skills.base import SkillResult, StageFailed
from golem.skills.calibrate import TagLooks
from golem.skills.context import Context
from golem.skills.kept_file import KeepsFiles, check_file_name, kept_file
from golem.types import SIDES

AHEAD = 0.1
"""Distance ahead of a palm camera at which its mount is judged [m]: where it looks at a part."""


@dataclass(frozen=True, slots=True)
class CalibrateHandsGoal:
    """What to calibrate by.

    Attributes:
        file: plain name of the file; palm cameras are added to a calibration that is there, and empty writes none.
        views: postures per camera.
        settle: time the arms get to come to rest in each [s].
        zero: standard deviation of what the arms' zeros are off by [rad]: 0.002 with the head's calibration in use.
        seed: of the postures.
    """

    file: str = "calibration.json"
    views: int = 16
    settle: float = 0.5
    zero: float = ZERO
    seed: int = 0

    def __post_init__(self) -> None:
        require(
            "",
            ("number of views per camera", self.views, 6 <= self.views <= 60, "6 to 60"),
            ("time to settle", self.settle, 0.0 <= self.settle <= 5.0, "0 to 5 s"),
            ("deviation of the zeros", self.zero, 1e-5 <= self.zero <= 0.2, "0.00001 to 0.2 rad"),
            ("seed", self.seed, self.seed >= 0, "not negative"),
        )
        check_file_name(self.file, ".json")


@dataclass(frozen=True, slots=True)
class CalibrateHandsReport:
    """What was found, the left palm camera first.

    Attributes:
        views: postures in which tags were seen.
        residual: root mean square error that is left of the tags' corners [px].
        camera: by how much a mount moves a point 0.1 m ahead [m].
        camera_sigma: standard deviation of that point, the largest of its axes [m].
    """

    views: tuple[int, ...] = ()
    residual: tuple[float, ...] = ()
    camera: tuple[float, ...] = ()
    camera_sigma: tuple[float, ...] = ()


class CalibrateHands(KeepsFiles):
    """Show each palm camera the other hand in many postures, and find where it sits.

    The hands wear their cuffs of tags. Stages (see `Skill`): `look`, `fit`, `done`.
    """

    Goal = CalibrateHandsGoal
    Result = CalibrateHandsReport

    def timeout(self, goal: CalibrateHandsGoal) -> float:
        return 60.0 + 2 * goal.views * (10.0 + goal.settle)

    async def run(self, context: Context, goal: CalibrateHandsGoal) -> SkillResult:
        start = context.t
        file = kept_file(self.config.folder, goal.file, read_calibration) if goal.file else None
        found: list[Calibration] = []
        for camera in SIDES:
            looks = TagLooks(context, f"{camera}_hand")
            postures = hand_view_postures(
                camera, goal.views, looks.free, looks.robot.model().placed, goal.zero, goal.seed
            )
            views = await looks.views(postures, OTHER[camera], SIDES, goal.settle, f"{camera} palm camera")
            if looks.info is None:
                raise StageFailed("look", "robot", f"The {camera} palm camera sends no images.")
            context.say("fit", f"Fitting {len(views)} views of the {camera} palm camera.")
            found.append(fit_hand(views, camera, looks.info, goal.zero))
        report = CalibrateHandsReport(
            tuple(each.views for each in found),
            tuple(each.residual for each in found),
            tuple(each.moved(camera, AHEAD) for each in found for camera in each.cameras),
            tuple(each.moved_sigma(camera, AHEAD) for each in found for camera in each.cameras),
        )
        if file is not None:
            before = read_calibration(file) if file.exists() else Calibration()
            cameras, covariances = dict(before.cameras), dict(before.covariances)
            for each in found:
                cameras |= each.cameras
                covariances |= each.covariances
            replace(before, cameras=cameras, covariances=covariances).save(file)
        said = " and ".join(
            f"the {side} one sits {moved * 1e3:.1f} mm (+- {sigma * 1e3:.1f}) from where the model has it"
            for side, moved, sigma in zip(SIDES, report.camera, report.camera_sigma, strict=True)
        )
        text = f"{sum(report.views)} views; of the palm cameras {said}, at {AHEAD:g} m"
        context.say("done", text)
        return SkillResult(True, "done", None, f"{text}.", {"calibrate": context.t - start}, report)
