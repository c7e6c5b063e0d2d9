"""A strip of pictures of one trial, seen from the side on which a push does not hide the lean."""

from __future__ import annotations

import io

import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from golem.robots.model.table import BASE_LINK
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.spectator import Shot, SpectatorView
from golem.types import Array

SIZE = (250, 400)
"""Width and height of one picture [px]."""
SHOT = Shot(look_at=(0.0, 0.0, 0.0), azimuth=0.0, elevation=-8.0, distance=4.3, fovy=28.0)
"""The camera, before it is moved before the robot."""
MIDDLE = 0.88
"""Height of the middle of a picture above the floor [m]."""
ARROW = 0.006
"""Length of the arrow per force [m/N], up to `LONGEST` [m]."""
LONGEST = 0.6
INK, ACCENT = (245, 246, 248), (232, 78, 60)


class FilmStrip:
    """Keeps moments of a trial, and draws them when the trial is over."""

    def __init__(self, robot: MujocoRobot, bearing: float) -> None:
        """Watch `robot` across the line at `bearing` [rad] in the world."""
        self._robot = robot
        self._bearing = bearing
        self._kept: list[tuple[float, Array, Array]] = []

    def keep(self, t: float, force: Array) -> None:
        """Remember the present moment: time `t` [s] and the (3,) force on the robot [N]."""
        self._kept.append((t, self._robot.data.qpos.copy(), np.array(force)))

    def picture(self) -> bytes | None:
        """Return the strip as PNG, None where nothing was kept; leaves the twin in the last moment's posture."""
        if not self._kept:
            return None
        data, model = self._robot.data, self._robot.scene.model
        start = self._kept[0][0]
        frames: list[Image.Image] = []
        view: SpectatorView | None = None
        shot = SHOT
        for t, qpos, force in self._kept:
            data.qpos[:] = qpos
            mujoco.mj_kinematics(model, data)
            mujoco.mj_camlight(model, data)
            pelvis = data.body(BASE_LINK).xpos.copy()
            if view is None:
                # MuJoCo's azimuth is where the camera looks to.
                azimuth = float(np.degrees(self._bearing)) + 90.0
                shot = Shot((pelvis[0], pelvis[1], MIDDLE), azimuth, SHOT.elevation, SHOT.distance, SHOT.fovy)
                view = SpectatorView(self._robot, {"strip": shot}, (2 * SIZE[0], 2 * SIZE[1]))
            frame = Image.fromarray(view.picture("strip")).resize(SIZE, Image.Resampling.LANCZOS)
            frames.append(_annotate(frame, shot, t - start, pelvis, force))
        if view is not None:
            view.close()
        return _joined(frames)


def project(shot: Shot, size: tuple[int, int], point: Array) -> tuple[float, float]:
    """Return where the (3,) world `point` is in a picture of `size` (width, height) that `shot` takes [px]."""
    azimuth, elevation = np.radians(shot.azimuth), np.radians(shot.elevation)
    ahead = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
    offset = np.asarray(point) - (np.array(shot.look_at) - shot.distance * ahead)
    focal = 0.5 * size[1] / np.tan(0.5 * np.radians(shot.fovy))
    depth = offset @ ahead
    x, y = focal * (offset @ right) / depth, focal * (offset @ np.cross(right, ahead)) / depth
    return 0.5 * size[0] + float(x), 0.5 * size[1] - float(y)


def _annotate(frame: Image.Image, shot: Shot, t: float, pelvis: Array, force: Array) -> Image.Image:
    """Write time and force on a picture, and draw the force as an arrow that ends at the pelvis."""
    draw = ImageDraw.Draw(frame)
    size = float(np.linalg.norm(force))
    draw.text((8, 6), f"{t:.1f} s", fill=INK, font=ImageFont.load_default(size=16))
    if size > 0.5:
        draw.text((8, 26), f"{size:.0f} N", fill=ACCENT, font=ImageFont.load_default(size=16))
        away = force / size * max(min(ARROW * size, LONGEST), 0.12)
        tail, head = (np.array(project(shot, SIZE, p)) for p in (pelvis - away, pelvis))
        along = (head - tail) / max(float(np.linalg.norm(head - tail)), 1e-9)
        across = np.array([-along[1], along[0]])
        draw.line([*tail, *(head - 6 * along)], fill=ACCENT, width=4)
        draw.polygon([*head, *(head - 14 * along + 7 * across), *(head - 14 * along - 7 * across)], fill=ACCENT)
    return frame


def _joined(frames: list[Image.Image]) -> bytes:
    gap = 3
    width, height = SIZE
    strip = Image.new("RGB", (len(frames) * (width + gap) - gap, height), (255, 255, 255))
    for i, frame in enumerate(frames):
        strip.paste(frame, (i * (width + gap), 0))
    stream = io.BytesIO()
    strip.save(stream, "PNG", optimize=True)
    return stream.getvalue()
