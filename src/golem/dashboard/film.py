"""Films the robot at work: a spectator's camera, the robot's own cameras as insets, and what the robot says."""

from __future__ import annotations

import math
import os
import queue
import tempfile
import threading
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from tqdm import tqdm

from golem.dashboard.status import GATE_STATES, SPAN, Status, balance_chart, camera_picture, map_view, read_status
from golem.errors import OutputError
from golem.interfaces import topics
from golem.robots.model.table import BASE_LINK
from golem.robots.mujoco.balance import BalanceRecorder
from golem.robots.mujoco.config import WORKSHOPS
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.spectator import Shot, SpectatorView
from golem.runtime.lockstep import LockstepRunner

HANGING = {
    "wide": Shot(look_at=(0.32, 0.04, 1.18), azimuth=-148.0, elevation=-17.0, distance=2.15),
    "close": Shot(look_at=(0.38, -0.07, 1.14), azimuth=-120.0, elevation=-13.0, distance=0.80),
}
STANDING = {
    "wide": Shot(look_at=(0.30, 0.0, 0.84), azimuth=62.0, elevation=-11.0, distance=3.3),
    "close": Shot(look_at=(0.38, -0.07, 0.99), azimuth=-120.0, elevation=-13.0, distance=0.80),
}
"""Cameras for a robot in the hoist, and for one on its feet: farther away, from where its legs are seen."""
CLOSE_STAGES = ("descend", "servo", "grasp", "extract")
"""Stages that are filmed from near; the others are filmed wide."""
OVERSAMPLING = 4 / 3
"""Pictures are rendered larger than shown by this: smooth edges at a third of the price of multisampling."""
WEBP_SCALE, QUALITY = 2 / 3, 60
"""Size of an animated WebP's pictures, relative to the film's, and their quality, of 100."""
WEBP_FRAMES = 240
"""A film with more pictures than this leaves some out there."""
CHART = (230, 64)
"""Size of the chart of the CoM margin in a film of 540 lines [px]."""
LIVE = (640, 360)
"""Size of the pictures of a film of the live view [px]: each is rendered while the robot waits."""
FILMS = Path("runs/live")
PANEL = (16, 20, 27)
INK, MUTED, ACCENT = (240, 242, 245), (150, 160, 173), (255, 196, 0)


def shots(robot: MujocoRobot) -> dict[str, Shot]:
    """Return the cameras that show `robot` at work: `wide` and `close`, which is on the tray's side."""
    found = STANDING if robot.config.support == "ground" else HANGING
    if robot.config.world not in WORKSHOPS or robot.scene.layout.tray_xy[1] < 0.0:
        return found
    close = found["close"]
    x, y, z = close.look_at
    return found | {"close": replace(close, look_at=(x, -y, z), azimuth=-close.azimuth)}


class Film:
    """Collects pictures of a running stack in robot time.

    Attributes:
        fps: pictures per second of robot time.
        headline: words at the top of every picture from now on.
    """

    def __init__(
        self,
        robot: MujocoRobot,
        size: tuple[int, int] = (960, 540),
        fps: float = 12.5,
        recorder: BalanceRecorder | None = None,
        speed: float = 1.0,
    ) -> None:
        """Film `robot`.

        Args:
            size: width and height of the film [px].
            fps: pictures per second of robot time.
            recorder: whoever samples its balance; its CoM margin is then in the picture.
            speed: robot time per time of the film.
        """
        self._size, self.fps, self._recorder, self._speed = size, fps, recorder, speed
        rendered = (round(size[0] * OVERSAMPLING), round(size[1] * OVERSAMPLING))
        self._view = SpectatorView(robot, shots(robot), rendered)
        self._frames: list[NDArray[np.uint8]] = []
        self._fonts = {k: ImageFont.load_default(size=round(k * size[1] / 540)) for k in (13, 15, 19)}
        self._due = 0.0
        self.headline = ""

    def __len__(self) -> int:
        return len(self._frames)

    def tick(self, running: LockstepRunner) -> None:
        """Take a picture if one is due; call it at every tick of `running`."""
        if running.executor.t >= self._due - 1e-9:
            self._due = running.executor.t + 1.0 / self.fps
            self.frame(running)

    def frame(self, running: LockstepRunner) -> NDArray[np.uint8]:
        """Take one picture, (height, width, 3) RGB, keep it and return it."""
        status = read_status(running)
        if running.bus.latest(topics.MAP) is not None:
            self._view.follow(BASE_LINK)
        shot = "close" if status.stage in CLOSE_STAGES else "wide"
        picture = _resized(self._view.picture(shot), self._size)
        floor = map_view(running.bus)
        cameras = {"palm camera": "right_hand", "head camera": "head"} if floor is None else {}
        insets = {label: camera_picture(running, self._view, name) for label, name in cameras.items()}
        insets |= {} if floor is None else {"map": floor}
        plan = running.bus.latest(topics.PACK_PLAN)
        insets |= {} if plan is None else {"pack": plan.rgb}
        picture = self._compose(picture, insets, status)
        packed = cv2.imencode(".png", picture[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 1])[1]
        self._frames.append(packed)
        return picture

    def _compose(
        self, picture: NDArray[np.uint8], insets: dict[str, NDArray[np.uint8]], status: Status
    ) -> NDArray[np.uint8]:
        """Lay insets and words over a picture."""
        image = Image.fromarray(picture)
        draw = ImageDraw.Draw(image)
        width, height = self._size
        unit = height / 540
        bar = round(44 * unit)
        top, edge = height - bar, round(10 * unit)
        for label, inset in insets.items():
            w = round((200 if len(insets) > 1 else 260) * unit)
            h = round(w * inset.shape[0] / inset.shape[1])
            x, y = width - w - edge, top - h - edge
            draw.rectangle((x - 2, y - 2, x + w + 1, y + h + 1), fill=INK)
            image.paste(Image.fromarray(_resized(inset, (w, h))), (x, y))
            draw.rectangle((x, y, x + round(88 * unit), y + round(18 * unit)), fill=PANEL)
            draw.text((x + 5 * unit, y + 2 * unit), label, fill=INK, font=self._fonts[13])
            top = y - 2
        top = height - bar
        draw.rectangle((0, top, width, height), fill=PANEL)
        if self._recorder is not None:
            chart = balance_chart(self._recorder.trace(last=SPAN), (round(CHART[0] * unit), round(CHART[1] * unit)))
            if chart is not None:
                image.paste(Image.fromarray(chart), (edge, top - edge - chart.shape[0]))
        middle = top + bar / 2
        draw.text((14 * unit, middle), status.stage, fill=ACCENT, font=self._fonts[19], anchor="lm")
        draw.text((120 * unit, middle), status.text, fill=INK, font=self._fonts[15], anchor="lm")
        clock = f"{status.t:.1f} s"
        draw.text((width - 14 * unit, middle), clock, fill=MUTED, font=self._fonts[15], anchor="rm")
        if self.headline:
            draw.text((16 * unit, 14 * unit), self.headline, fill=PANEL, font=self._fonts[19])
        word = f"safety {status.safety}" + (f"  {status.reason}" if status.reason else "")
        wide = draw.textlength(word, font=self._fonts[13]) + 34 * unit
        x = width - wide - edge
        draw.rounded_rectangle((x, edge, width - edge, edge + 24 * unit), radius=12 * unit, fill=PANEL)
        dot = tuple(GATE_STATES[status.safety]["film"])
        draw.ellipse((x + 9 * unit, edge + 8 * unit, x + 17 * unit, edge + 16 * unit), fill=dot)
        draw.text((x + 24 * unit, edge + 12 * unit), word, fill=INK, font=self._fonts[13], anchor="lm")
        return np.asarray(image)

    def save(self, path: Path) -> list[Path]:
        """Write the film as an animated WebP, and in full beside it as MP4 where this machine can encode that.

        Args:
            path: the WebP; the other file gets its name with another suffix.

        Returns:
            The files written, the WebP first. Each appears complete or not at all.

        Raises:
            OutputError: there is no picture yet, or the file cannot be written.
        """
        if not self._frames:
            raise OutputError(f"No picture was taken for {path}; let the robot run first.")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=path.parent, prefix=".film-") as folder:
                small, video = Path(folder) / "film.webp", Path(folder) / "film.mp4"
                self._write_webp(small)
                os.replace(small, path)
                written = [path]
                if self._write_video(video):
                    os.replace(video, path.with_suffix(".mp4"))
                    written.append(path.with_suffix(".mp4"))
        except OSError as error:
            raise OutputError(f"Cannot write the film {path}: {error.strerror}; choose another --out.") from error
        return written

    def picture(self, index: int, scale: float = 1.0) -> NDArray[np.uint8]:
        """Return one of the pictures, (height, width, 3) RGB."""
        picture = cv2.imdecode(self._frames[index], cv2.IMREAD_COLOR)
        assert picture is not None
        if scale != 1.0:
            picture = _resized(picture, (round(self._size[0] * scale), round(self._size[1] * scale)))
        return np.ascontiguousarray(picture[..., ::-1]).astype(np.uint8, copy=False)

    def _write_webp(self, path: Path) -> None:
        """Write the pictures, some left out of a long film, smaller than they are."""
        stride = math.ceil(len(self._frames) / WEBP_FRAMES)
        numbers = tqdm(range(0, len(self._frames), stride), path.name, leave=False, disable=None)
        first, *others = (Image.fromarray(self.picture(i, WEBP_SCALE)) for i in numbers)
        duration = round(1000.0 * stride / (self.fps * self._speed))
        first.save(
            path, "WEBP", save_all=True, append_images=others, duration=duration, loop=0, method=2, quality=QUALITY
        )

    def _write_video(self, path: Path) -> bool:
        """Write all pictures as VP9, which is free of royalties; returns False where OpenCV cannot encode it."""
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"vp09"), self.fps * self._speed, self._size)
        if not writer.isOpened():
            return False
        for i in tqdm(range(len(self._frames)), path.name, leave=False, disable=None):
            writer.write(self.picture(i)[..., ::-1])
        writer.release()
        return path.is_file() and path.stat().st_size > 0

    def close(self) -> None:
        """Release the renderer."""
        self._view.close()


class LiveFilm:
    """A film that is begun and ended while the robot is watched; it is written beside the robot, which goes on."""

    def __init__(self) -> None:
        self._film: Film | None = None
        self._said: queue.SimpleQueue[str] = queue.SimpleQueue()

    def toggle(self, robot: MujocoRobot, recorder: BalanceRecorder) -> bool:
        """Begin a film, or end the one that was begun; return whether one is being taken."""
        film, self._film = self._film, None
        if film is None:
            self._film = Film(robot, LIVE, recorder=recorder)
        else:
            film.close()
            path = FILMS / f"{datetime.now():%Y%m%d-%H%M%S}.webp"
            threading.Thread(target=self._write, args=(film, path), daemon=True).start()
        return self._film is not None

    def tick(self, running: LockstepRunner) -> str:
        """Take a picture if one is due; return where a film was written, or why not, once, else nothing."""
        if self._film is not None:
            self._film.tick(running)
        return "" if self._said.empty() else self._said.get_nowait()

    def _write(self, film: Film, path: Path) -> None:
        try:
            self._said.put("Written: " + ", ".join(str(one) for one in film.save(path)))
        except OutputError as error:
            self._said.put(str(error))


def _resized(picture: NDArray[Any], size: tuple[int, int]) -> NDArray[np.uint8]:
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
