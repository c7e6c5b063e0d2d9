"""What the stack says of itself, read from the bus for people: skill, safety gate, targets, camera pictures."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.capabilities.perception.lift import scene_of
from golem.interfaces import topics
from golem.interfaces.payloads import GateState, LegStatus
from golem.middleware.bus import Bus
from golem.robots.mujoco.spectator import SpectatorView
from golem.runtime.lockstep import LockstepRunner
from golem.types import Array, BaseEstimate

FRESH = 0.2
"""Age up to which a frame on the bus is shown [s]: three frame periods."""
CLASS_COLOURS = {
    "screw": (255, 196, 0),
    "screw_hole": (190, 120, 255),
    "nut": (90, 200, 255),
    "bus_bar": (255, 120, 40),
    "tray": (0, 220, 190),
}
"""RGB of the boxes around what the detector found."""


@dataclass(frozen=True, slots=True)
class Status:
    """One moment.

    Attributes:
        t: robot time [s].
        stage, text: what the skill says; empty before the first.
        safety: state of the safety gate.
        reason: why the gate does not let commands through; empty when it does.
        legs: what the base layer of the legs did; None before the first tick.
        base: what the robot takes for its own motion; None before the first tick.
    """

    t: float
    stage: str
    text: str
    safety: GateState
    reason: str
    legs: LegStatus | None
    base: BaseEstimate | None


def read_status(running: LockstepRunner) -> Status:
    """Return the present status of a stack."""
    feedback = running.bus.latest(topics.FEEDBACK)
    gate = running.safety
    return Status(
        running.executor.t,
        "" if feedback is None else feedback.stage,
        "" if feedback is None else feedback.text,
        GateState.INIT if gate is None else gate.state,
        "" if gate is None else gate.why,
        running.bus.latest(topics.LEG_STATUS),
        running.bus.latest(topics.BASE),
    )


class Timeline:
    """The stages a skill went through.

    Attributes:
        stages: name and start [s] of each, in order.
        target: (3,) what the skill aimed at last, in odom [m], or None.
    """

    def __init__(self) -> None:
        """Start empty."""
        self.stages: list[tuple[str, float]] = []
        self.target: Array | None = None
        self._seen = 0

    @classmethod
    def of(cls, running: LockstepRunner) -> Timeline:
        """Return a timeline that begins now: what was said before does not count."""
        timeline = cls()
        timeline._seen = running.bus.count(topics.FEEDBACK)
        return timeline

    def update(self, running: LockstepRunner) -> None:
        """Take in the newest feedback; call it often enough to miss no stage."""
        count = running.bus.count(topics.FEEDBACK)
        feedback = running.bus.latest(topics.FEEDBACK)
        if feedback is None or count == self._seen:
            return
        self._seen = count
        if "target" in feedback.data:
            self.target = np.asarray(feedback.data["target"], dtype=float)
        if not self.stages or self.stages[-1][0] != feedback.stage:
            self.stages.append((feedback.stage, feedback.t))

    def durations(self, end: float) -> list[tuple[str, float]]:
        """Return each stage with how long it took [s]; the last lasts until time `end` [s]."""
        ends = [start for _, start in self.stages] + [end]
        return [(stage, max(0.0, stop - start)) for (stage, start), stop in zip(self.stages, ends[1:], strict=True)]


def camera_picture(running: LockstepRunner, view: SpectatorView, camera: str) -> NDArray[np.uint8]:
    """Return what a camera of the robot shows: the frame the robot itself works on, with what it found, or a look now.

    Returns:
        (height, width, 3) RGB, half the camera's resolution.
    """
    frame = running.bus.latest(topics.rgbd_images(camera))
    if frame is None or running.executor.t - frame.t > FRESH:
        return view.picture(camera)
    picture = np.ascontiguousarray(frame.rgb[::2, ::2])
    sightings = running.bus.latest(topics.detections(camera))
    if sightings is not None and frame.t - sightings.t <= FRESH:
        for found in sightings.objects:
            x0, y0, x1, y1 = (round(float(v) / 2) for v in found.detection.box)
            cv2.rectangle(picture, (x0, y0), (x1, y1), CLASS_COLOURS.get(found.label, (255, 255, 255)), 1)
    return picture


def clouds(bus: Bus) -> list[Array]:
    """Return (n, 3) points in odom that the head camera and the LiDAR show now [m]."""
    frame, scan = bus.latest(topics.rgbd_images("head")), bus.latest(topics.SCAN)
    return ([] if frame is None else [scene_of(frame)]) + ([] if scan is None else [scan.points])
