"""The film of a lost trial: its last seconds, as a camera beside the robot sees them, with what the robot said."""

from __future__ import annotations

import io
import textwrap
from collections import deque
from dataclasses import dataclass
from typing import Any

import mujoco
from PIL import Image, ImageDraw, ImageFont

from golem.interfaces import topics
from golem.middleware.bus import News
from golem.robots.mujoco.camera import CameraRig
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.scene import ONLOOKER
from golem.robots.mujoco.spectator import halved, headlight
from golem.types import Array

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
        return _packed(frames)


def _packed(frames: list[Image.Image]) -> bytes:
    stream = io.BytesIO()
    frames[0].save(
        stream, "WEBP", save_all=True, append_images=frames[1:], duration=round(1000 / FPS), loop=0, method=2,
        quality=QUALITY,
    )  # fmt: skip
    return stream.getvalue()
