"""Calibrate the head camera and the arms' encoders by the tags on the hands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from golem.capabilities.calibration.kinematic_fit import TagView, fit
from golem.capabilities.calibration.tag_detector import TagDetector
from golem.capabilities.calibration.view_postures import view_postures
from golem.capabilities.collision.obstacles import Obstacle, World
from golem.capabilities.planning.base import PlanRefused
from golem.capabilities.planning.joint_space import JointSpace, PlanningRobot
from golem.interfaces import topics
from golem.options import require
from golem.robots.model.magpie_model import cuff_tags
from golem.robots.model.spatial import transform
from golem.robots.sensors.calibration import read_calibration
from golem.skills.base import SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.kept_file import KeepsFiles, check_file_name, kept_file
from golem.skills.planned_motion import PlannedMotion
from golem.types import SIDES, Array, CameraInfo, Side

WORK_PLACE = World((Obstacle("box", transform((0.85, 0.0, -0.22)), (0.55, 1.3, 0.28), "work place"),))
"""What the arms keep out of, in base_link [m]: whatever stands before the robot, up to 6 cm above its pelvis."""
SPEED = 0.6
"""How fast a hand goes from view to view [m/s]."""
FRAMES = 2
"""Frames that are looked at in one posture: the second one tells nothing new of a tag, but may show one at all."""
FRAME_TIME = 1.0
"""How long a frame is waited for [s]."""


class TagLooks:
    """Brings a hand with tags before a camera, again and again; `info` is that camera, None until an image came."""

    def __init__(self, context: Context, camera: str) -> None:
        """Look with `camera`, from how the arms are now."""
        self._context, self._camera = context, camera
        self._detector, self._motion = TagDetector(), PlannedMotion(context)
        self._motion.world = WORK_PLACE
        self.robot = PlanningRobot()
        self._space = JointSpace(self.robot, context.joints, WORK_PLACE)
        self.info: CameraInfo | None = None

    def free(self, q: Array) -> bool:
        """Return whether nothing touches in the posture `q` (15,) [rad] of torso and arms."""
        return self._space.verdict(q) == 0

    async def views(
        self, postures: Sequence[Array], shown: Side, moving: Sequence[Side], settle: float, what: str
    ) -> list[TagView]:
        """Return what was seen from `postures`, those left out that no way leads to; the arms come back at the end.

        Args:
            postures: (15,) each, of torso and arms; the torso stays as it is [rad].
            shown: the hand that is looked at.
            moving: the arms that move.
            settle: time they get to come to rest in each [s].
            what: what feedback calls it.
        """
        home, views = self._context.commanded_joints.copy(), list[TagView]()
        for k, q in enumerate(postures):
            self._context.say("look", f"{what}, view {k + 1} of {len(postures)}.")
            q[0] = home[0]
            try:
                await self._motion.to_joints(q, moving, SPEED)
            except PlanRefused:
                continue
            await self._context.sleep(settle)
            seen = await self._look(shown)
            if seen is not None:
                views.append(seen)
        await self._motion.to_joints(home, moving, SPEED)
        return views

    async def _look(self, shown: Side) -> TagView | None:
        """Look at a hand that rests; return what was seen with the joints of that moment, None for nothing."""
        own, bus = cuff_tags(shown), self._context.bus
        with self._context.watch(self._camera, "screw") as stream:
            for _ in range(FRAMES):
                if await stream.look(FRAME_TIME) is None:
                    continue
                frame, state = bus.latest(topics.rgbd_images(self._camera)), bus.latest(topics.LOW_STATE)
                if frame is None or state is None:
                    continue
                self.info = frame.info
                corners = {n: c for n, c in self._detector.find(frame.rgb).items() if n in own}
                if corners:
                    return TagView(shown, state.q.copy(), corners)
        return None


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


class Calibrate(KeepsFiles):
    """Show the head camera both hands in many postures, and find its mount and the arms' encoder zeros.

    The hands wear their cuffs of tags. Stages (see `Skill`): `look`, `fit`, `done`.
    """

    Goal = CalibrateGoal
    Result = CalibrateReport

    def timeout(self, goal: CalibrateGoal) -> float:
        return 60.0 + 2 * goal.views * (8.0 + goal.settle)

    async def run(self, context: Context, goal: CalibrateGoal) -> SkillResult:
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
