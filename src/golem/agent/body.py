"""What the desk works with: a robot whose skills can be begun and cancelled, and looked at meanwhile."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.agent.answers import words
from golem.capabilities.arms.hand_force import HandForce
from golem.errors import GolemError
from golem.interfaces import topics
from golem.interfaces.payloads import Feedback
from golem.middleware.bus import Bus
from golem.skills.base import SkillResult
from golem.skills.job_file import JobFile
from golem.skills.spec import SkillSpec
from golem.types import SIDES, UPPER, Array, PlanarPose

MAP_CELLS = 120
"""Cells of a map's longer side that are told [own]: a model reads ten thousand characters, not a million."""


@dataclass(frozen=True, slots=True)
class BodyMotion:
    """How the robot moves now.

    Attributes:
        x, y: of base_link in odom [m].
        velocity: (2,) of base_link in odom [m/s].
        forces: (2, 3) of the left and the right hand on the world, in their grasp frames [N].
    """

    x: float
    y: float
    velocity: Array
    forces: Array


@dataclass(frozen=True, slots=True)
class Picture:
    """What a camera showed: a JPEG, and what was found in it, by label, score and x, y, z in odom [m]."""

    jpeg: bytes
    found: tuple[tuple[str, float, float, float, float], ...]


class Body(ABC):
    """A robot with its stack, in this process or on a domain, by what is on a bus. One thread calls all of it.

    Attributes:
        specs: its skills.
        paced: whether time passes by itself.
        t: robot time [s].
    """

    specs: Mapping[str, SkillSpec]
    paced: bool
    t: float
    busy: bool

    def __init__(self, bus: Bus, jobs: Path) -> None:
        """Read `bus`; the inventories of jobs are in the folder `jobs`."""
        self._bus, self._jobs, self._force = bus, jobs, HandForce()

    @abstractmethod
    def begin(self, skill: str, fields: Mapping[str, Any]) -> None:
        """Begin a skill; raises `GolemError` where it cannot."""

    @abstractmethod
    def said(self) -> Feedback | None:
        """Return what the skill has said since the last time, if anything."""

    @abstractmethod
    def result(self) -> SkillResult | None:
        """Return how the skill that was begun last has ended; None while it runs. Its value is a dataclass or JSON."""

    @abstractmethod
    def cancel(self) -> None:
        """Cancel the skill that runs."""

    @abstractmethod
    def stop_motors(self) -> None:
        """Ask the safety gate for a stop; raises `GolemError` where there is none."""

    @abstractmethod
    def picture(self, camera: str) -> Picture | None:
        """Return what a camera shows, as of its newest frame; None where none came."""

    @abstractmethod
    def step(self) -> None:
        """Let a little time pass."""

    def moment(self) -> BodyMotion | None:
        """Return how the robot moves now; None before it reports."""
        base, state = self._bus.latest(topics.BASE), self._bus.latest(topics.LOW_STATE)
        if base is None or state is None:
            return None
        forces = np.array([self._force.wrench(side, state.q[UPPER], state.tau[UPPER])[:3] for side in SIDES])
        x, y = base.T_odom_base[:2, 3].tolist()
        return BodyMotion(x, y, base.velocity[:2], forces)

    def in_odom(self, frame: str, x: float, y: float) -> tuple[float, float] | None:
        """Return a place given in a frame, in odom [m]; None where that is not known."""
        base, there = self._bus.latest(topics.BASE), self._bus.latest(topics.MAP_POSE)
        mapped = frame == "map" or (frame in ("memory", "seen") and self._bus.latest(topics.MAP) is not None)
        if frame == "base_link" or mapped:
            if there is None if mapped else base is None:
                return None
            origin = there.T_odom_map if mapped and there else PlanarPose.of(base.T_odom_base if base else np.eye(4))
            x, y = (origin @ PlanarPose(x, y, 0.0)).matrix()[:2, 3].tolist()
        return x, y

    def read(self, resource: str) -> dict[str, Any]:
        """Return one of the resources of `tools.yaml`; words from the world in it are marked."""
        return {"t": self.t, **getattr(self, f"_{resource}")()}

    def _state(self) -> dict[str, Any]:
        bus, moment = self._bus, self.moment()
        state, base = bus.latest(topics.LOW_STATE), bus.latest(topics.BASE)
        if moment is None or state is None or base is None:
            return {}
        pose = asdict(PlanarPose.of(base.T_odom_base))
        hands = {side: {"force": moment.forces[k].round(1).tolist()} for k, side in enumerate(SIDES)}
        for side in SIDES:
            hand = bus.latest(topics.hand_status(side))
            hands[side] |= {} if hand is None else {"state": hand.state.value, "gap": hand.gap}
        base_link = {"frame": "odom", **pose, "velocity": moment.velocity.round(3).tolist()}
        return {"base": base_link, "joints": state.q.round(4).tolist(), "hands": hands, "busy": self.busy}

    def _safety(self) -> dict[str, Any]:
        status = self._bus.latest(topics.SAFETY)
        return {} if status is None else {"state": status.state.value, "why": words(status.why, False)}

    def _map(self) -> dict[str, Any]:
        grid = self._bus.latest(topics.MAP)
        if grid is None:
            return {"map": None}
        origin, cells = asdict(grid.in_map.origin), grid.cells
        step = math.ceil(max(cells.shape) / MAP_CELLS)
        h, w = (step * (n // step) for n in cells.shape)
        most = cells[:h, :w].reshape(h // step, step, w // step, step).max(axis=(1, 3))
        rows = np.where(most < 0, "?", np.where(most > 50, "#", "."))[::-1]
        text = "\n".join("".join(row) for row in rows)
        return {"frame": "map", "origin": origin, "cell": step * grid.resolution, "map": text}

    def _memory(self) -> dict[str, Any]:
        return {"places": None, "note": "Ask with the tool recall."}

    def _inventory(self) -> dict[str, Any]:
        jobs: dict[str, Any] = {}
        for path in sorted(self._jobs.glob("*.sqlite")):
            with suppress(GolemError):
                book = JobFile(path)
                told = [(one, one.fate.value, one.place.round(3).tolist()) for one in book.fasteners]
                book.close()
                texts = [{"name": o.listed.name, "kind": o.listed.kind, "reason": o.reason} for o, _, _ in told]
                jobs[path.stem] = [
                    {"fate": fate, "place": place, **{key: words(text) for key, text in each.items()}}
                    for each, (_, fate, place) in zip(texts, told, strict=True)
                ]
        return {"jobs": jobs}


def drawn(rgb: NDArray[np.uint8], boxes: Sequence[tuple[str, Sequence[float]]] = ()) -> bytes:
    """Return a JPEG of a picture (h, w, 3) with boxes around what was found, each x_min, y_min, x_max, y_max [px]."""
    picture = np.ascontiguousarray(rgb[:, :, ::-1])
    for label, (x0, y0, x1, y1) in boxes:
        cv2.rectangle(picture, (round(x0), round(y0)), (round(x1), round(y1)), (0, 196, 255), 2)
        cv2.putText(picture, label[:20], (round(x0), round(y0) - 4), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 196, 255), 1)
    return cv2.imencode(".jpg", picture)[1].tobytes()
