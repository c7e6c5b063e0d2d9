"""Calibrate the LiDAR by surfaces that the calibrated head camera sees, too."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.calibration.scan_fit import SurfaceView, fit_lidar
from golem.capabilities.planning.base import PlanRefused
from golem.errors import ConfigError
from golem.interfaces import topics
from golem.options import require
from golem.robots.sensors.calibration import read_calibration
from golem.skills.base import SkillResult, StageFailed
from golem.skills.calibrate import FRAME_TIME, SPEED, WORK_PLACE
from golem.skills.context import Context
from golem.skills.kept_file import KeepsFiles, check_file_name, kept_file
from golem.skills.planned_motion import PlannedMotion
from golem.types import SIDES, CameraInfo

CAMERA = "head"
AWAY = 3.0
"""Distance at which the mount is judged [m]: where walls and furniture are."""
FRAMES = 8
"""Images of one view; their mean has a third of the noise of one."""
FIT_TIME = 2.0
"""What a fit takes [s]."""


@dataclass(frozen=True, slots=True)
class CalibrateLidarGoal:
    """What to calibrate by.

    Attributes:
        file: plain name of the file that has the head camera; the LiDAR is added to it. The folder is an option of the
            skill.
        views: angles of the torso.
        turn: how far it turns to either side [rad].
        settle: time it gets to come to rest in each [s].
    """

    file: str = "calibration.json"
    views: int = 5
    turn: float = 0.8
    settle: float = 0.5

    def __post_init__(self) -> None:
        require(
            "",
            ("number of views", self.views, 1 <= self.views <= 20, "1 to 20"),
            ("turn of the torso", self.turn, 0.0 <= self.turn <= 1.5, "0 to 1.5 rad"),
            ("time to settle", self.settle, 0.0 <= self.settle <= 5.0, "0 to 5 s"),
        )
        if not self.file:
            raise ConfigError("A LiDAR is calibrated by the head camera in a calibration: name its file.")
        check_file_name(self.file, ".json")


@dataclass(frozen=True, slots=True)
class CalibrateLidarReport:
    """What was found.

    Attributes:
        views: angles of the torso from which something was seen.
        points: of the scans that lay on surfaces.
        residual: their distance from them, root mean square [m].
        moved: by how much the mount moves what is 3 m away, RMS over all directions [m].
        moved_sigma: standard deviation of that [m].
    """

    views: int = 0
    points: int = 0
    residual: float = 0.0
    moved: float = 0.0
    moved_sigma: float = 0.0


class CalibrateLidar(KeepsFiles):
    """Look at floor, walls and furniture with head camera and LiDAR, turn the torso, and find where the LiDAR sits.

    The head camera is calibrated first. Stages (see `Skill`): `look`, `fit`, `done`.
    """

    Goal = CalibrateLidarGoal
    Result = CalibrateLidarReport

    def timeout(self, goal: CalibrateLidarGoal) -> float:
        return 60.0 + goal.views * (15.0 + goal.settle)

    async def run(self, context: Context, goal: CalibrateLidarGoal) -> SkillResult:
        start = context.t
        file = kept_file(self.config.folder, goal.file, read_calibration)
        before = read_calibration(file) if file.exists() else None
        if before is None or CAMERA not in before.cameras:
            raise ConfigError(f"'{file}' has no head camera, by which the LiDAR is calibrated: golem calibrate head.")
        views, info = await self._views(context, goal)
        context.say("fit", f"Fitting {len(views)} views.")
        head, covariance = before.cameras[CAMERA], before.covariances[CAMERA]
        found = await context.think(lambda: fit_lidar(views, info, head, covariance), FIT_TIME)
        report = CalibrateLidarReport(
            len(views), found.points, found.residual, found.mount.moved(AWAY), found.mount.moved_sigma(AWAY)
        )
        replace(before, lidar=found.mount).save(file)
        text = (
            f"{report.points} points on surfaces, {report.residual * 1e3:.0f} mm left; the LiDAR's mount moves what is "
            f"{AWAY:g} m away by {report.moved * 1e3:.0f} mm (+- {report.moved_sigma * 1e3:.1f})"
        )
        context.say("done", text)
        return SkillResult(True, "done", None, f"{text}.", {"calibrate": context.t - start}, report)

    async def _views(self, context: Context, goal: CalibrateLidarGoal) -> tuple[list[SurfaceView], CameraInfo]:
        """Return what was seen from each angle of the torso that it could be turned to; it comes back at the end."""
        motion, home = PlannedMotion(context), context.commanded_joints.copy()
        motion.world = WORK_PLACE
        views, info = list[SurfaceView](), None
        angles = goal.turn * np.linspace(-1.0, 1.0, goal.views) if goal.views > 1 else [0.0]
        for k, angle in enumerate(angles):
            context.say("look", f"View {k + 1} of {goal.views}.")
            q = home.copy()
            q[0] += angle
            try:
                await motion.to_joints(q, SIDES, SPEED)
            except PlanRefused:
                continue
            await context.sleep(goal.settle)
            view, info = await self._look(context)
            views.append(view)
        await motion.to_joints(home, SIDES, SPEED)
        if info is None:
            raise StageFailed("look", "planner", "The torso can be turned to none of the angles.")
        return views, info

    async def _look(self, context: Context) -> tuple[SurfaceView, CameraInfo]:
        """Return what camera and LiDAR see of what rests, and the camera. Raises StageFailed: one of them is silent."""
        bus, begin = context.bus, context.t
        depth: list[NDArray[np.float32]] = []
        points: dict[float, NDArray[np.float32]] = {}
        info: CameraInfo | None = None
        with context.watch(CAMERA, "screw") as stream:
            for _ in range(FRAMES):
                if await stream.look(FRAME_TIME) is None:
                    continue
                frame, scan = bus.latest(topics.rgbd_images(CAMERA)), bus.latest(topics.LIDAR_SCAN)
                if frame is not None:
                    depth.append(frame.depth)
                    info = frame.info
                if scan is not None and scan.t - scan.duration >= begin:
                    points[scan.t] = scan.points
        if info is None:
            raise StageFailed("look", "robot", "The head camera sends no images.")
        if not points:
            raise StageFailed(
                "look", "robot", "The LiDAR sends no scans; a stack hears it with 'odometry: {use: lio}'."
            )
        return SurfaceView(depth, np.concatenate(list(points.values()))), info
