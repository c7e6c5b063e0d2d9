"""The film of a lost trial: its last seconds, as a camera beside the robot sees them, with what the robot said."""

from __future__ import annotations

import io
import textwrap
from collections import deque
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from golem.interfaces import topics
from golem.middleware.bus import News
from golem.robots.model.table import BASE_LINK
from golem.robots.mujoco.camera import CameraRig
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.scene import ONLOOKER
from golem.robots.mujoco.spectator import Shot, SpectatorView, halved, headlight
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
WHITE, ACCENT = (245, 246, 248), (232, 78, 60)


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
        (start, first, _), frames = self._kept[0], list[Image.Image]()
        x, y, _ = self._posed(first)
        # MuJoCo's azimuth is where the camera looks to.
        shot = replace(SHOT, look_at=(x, y, MIDDLE), azimuth=float(np.degrees(self._bearing)) + 90.0)
        with closing(SpectatorView(self._robot, {"strip": shot}, (2 * SIZE[0], 2 * SIZE[1]))) as view:
            for t, qpos, force in self._kept:
                pelvis = self._posed(qpos)
                frame = Image.fromarray(view.picture("strip")).resize(SIZE, Image.Resampling.LANCZOS)
                frames.append(_annotate(frame, shot, t - start, pelvis, force))
        (width, height), gap = SIZE, 3
        strip = Image.new("RGB", (len(frames) * (width + gap) - gap, height), (255, 255, 255))
        for i, frame in enumerate(frames):
            strip.paste(frame, (i * (width + gap), 0))
        stream = io.BytesIO()
        strip.save(stream, "PNG", optimize=True)
        return stream.getvalue()

    def _posed(self, qpos: Array) -> Array:
        """Put the twin into a posture, and return where its pelvis is then, (3,) in the world [m]."""
        data = self._robot.data
        data.qpos[:] = qpos
        mujoco.mj_kinematics(self._robot.scene.model, data)
        mujoco.mj_camlight(self._robot.scene.model, data)
        return data.body(BASE_LINK).xpos.copy()


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
    draw.text((8, 6), f"{t:.1f} s", fill=WHITE, font=ImageFont.load_default(size=16))
    if size > 0.5:
        draw.text((8, 26), f"{size:.0f} N", fill=ACCENT, font=ImageFont.load_default(size=16))
        away = force / size * max(min(ARROW * size, LONGEST), 0.12)
        tail, head = (np.array(project(shot, SIZE, p)) for p in (pelvis - away, pelvis))
        along = (head - tail) / max(float(np.linalg.norm(head - tail)), 1e-9)
        across = np.array([-along[1], along[0]])
        draw.line([*tail, *(head - 6 * along)], fill=ACCENT, width=4)
        draw.polygon([*head, *(head - 14 * along + 7 * across), *(head - 14 * along - 7 * across)], fill=ACCENT)
    return frame


FILM = "film.webp"
"""Name of the file that holds a lost trial's film among its artefacts."""
FPS = 10.0
"""Pictures per second of robot time."""
LENGTH = 5.0
"""Length of a film [s]."""
AFTER = 1.0
"""How much of it comes after the stage in which the trial was lost, or after the skill said that it failed [s]."""
QUALITY = 45
WIDE, LINE, LINES = 52, 15, 3
"""Letters of a line below the picture, its height [px], and how many there are: what lost the trial, and the words."""
INK, PANEL = (240, 242, 245), (16, 20, 27)


@dataclass(frozen=True, slots=True)
class _Moment:
    t: float
    qpos: Array
    mocap: tuple[Array, Array]
    words: str


class LastSeconds:
    """Keeps the last seconds of the twin of a trial, and those before each stage was last left; an `Onlooker`.

    Only states are kept; pictures are made if the trial turns out to be lost. No trial is changed by it.
    """

    period = 1.0 / FPS

    def __init__(self) -> None:
        self._robot: MujocoRobot | None = None
        self._start()

    def _start(self) -> None:
        self._recent: deque[_Moment] = deque(maxlen=round(LENGTH * FPS))
        self._left: dict[str, list[_Moment]] = {}
        self._failed: dict[str, list[_Moment]] = {}
        self._due: deque[tuple[float, str, dict[str, list[_Moment]]]] = deque()
        self._stage = self._words = ""

    def __call__(self, running: Any, robot: Any) -> None:
        """Look on from now on; see `Onlooker`. What is not the MuJoCo twin has no film."""
        if isinstance(robot, MujocoRobot):
            self._start()
            self._robot, self._news = robot, News(running.bus, topics.FEEDBACK)
            running.executor.add(self)

    def step(self, t: float) -> None:
        """Keep the state at `t` [s]."""
        assert self._robot is not None
        said = self._news.read()
        if said is not None:
            if said.stage != self._stage:
                self._due.append((t + AFTER, self._stage, self._left))
            if said.data.get("failed"):
                self._due.append((t + AFTER, said.stage, self._failed))
            self._stage, self._words = said.stage, f"{said.stage}: {said.text}"
        data = self._robot.data
        mocap = data.mocap_pos.copy(), data.mocap_quat.copy()
        self._recent.append(_Moment(t, data.qpos.copy(), mocap, self._words))
        while self._due and t >= self._due[0][0]:
            self._keep()

    def _keep(self) -> None:
        _, stage, kept = self._due.popleft()
        kept[stage] = list(self._recent)

    def film(self, stage: str, module: str | None) -> bytes | None:
        """Return the film, as animated WebP, of a trial that `module` lost in `stage`; None where no twin was seen.

        It ends a second after a skill last said that it failed in that stage, else after one last left it, else at the
        end of the trial.
        """
        while self._due:  # a trial may end within the second after
            self._keep()
        moments = self._failed.get(stage) or self._left.get(stage) or list(self._recent)
        if self._robot is None or not moments:
            return None
        model, frames = self._robot.scene.model, list[Image.Image]()
        data = mujoco.MjData(model)
        font = ImageFont.load_default(size=12)
        title = f"Lost in {stage}" + (f" by {module}" if module else "")
        with headlight(model), CameraRig(model, [halved(ONLOOKER)]) as rig:
            for moment in moments:
                data.qpos[:] = moment.qpos
                data.mocap_pos[:], data.mocap_quat[:] = moment.mocap
                mujoco.mj_kinematics(model, data)
                mujoco.mj_camlight(model, data)
                picture = Image.fromarray(rig.render(data, ONLOOKER.name)[0])
                image = Image.new("RGB", (picture.width, picture.height + LINES * LINE + 6), PANEL)
                image.paste(picture)
                said = textwrap.wrap(f"{moment.t:.1f} s  {moment.words}", WIDE, max_lines=LINES - 1, placeholder=" ...")
                ImageDraw.Draw(image).multiline_text(
                    (6, picture.height + 2), "\n".join((title, *said)), fill=INK, font=font, spacing=2
                )
                frames.append(image)
        stream = io.BytesIO()
        frames[0].save(
            stream, "WEBP", save_all=True, append_images=frames[1:], duration=round(1000 / FPS), loop=0, method=2,
            quality=QUALITY,
        )  # fmt: skip
        return stream.getvalue()
