"""What the stack says of itself, read from the bus for people: skill, safety gate, targets, camera pictures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.capabilities.perception.lift import scene_of
from golem.dashboard.map_picture import FAINT, INK, ROBOT, SCAN, WAY, MapPicture
from golem.errors import MissingExtra
from golem.figures import blank_figure, pixels
from golem.interfaces import topics
from golem.interfaces.memory_payloads import RememberedPlace
from golem.interfaces.payloads import GateState, LegStatus
from golem.middleware.bus import Bus
from golem.package_data import load_data
from golem.robots.mujoco.balance import BalanceTrace
from golem.robots.mujoco.spectator import SpectatorView
from golem.runtime.lockstep import LockstepRunner
from golem.types import Array, BaseEstimate, PlanarPose

GATE_STATES: dict[str, dict[str, Any]] = load_data(__package__, "gate_states.yaml")
"""What is shown of each state of the safety gate."""
SPAN = 10.0
"""Time the chart goes back [s]."""
REACH = 0.15
"""Margin at the upper edge, and at the lower edge below zero [m]: a still stand has 0.11."""
PANEL, LINE, MUTED = "#10141b", "#f0f2f5", "#96a0ad"
GOOD, BAD, PUSHED = "#68c896", "#e84e3c", "#784230"


def balance_chart(trace: BalanceTrace, size: tuple[int, int]) -> NDArray[np.uint8] | None:
    """Return (height, width, 3) RGB of the CoM margin over the last `SPAN` s, pushes marked; None without matplotlib.

    Args:
        trace: samples, at least one.
        size: width and height [px].
    """
    width, height = size
    try:
        figure = blank_figure(width, height, facecolor=PANEL, layout=None)
    except MissingExtra:
        return None
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set(xlim=(-SPAN, 0.0), ylim=(-REACH, REACH))
    shown = trace.window(float(trace.t[-1]) - SPAN)
    t, margin = shown.t - float(trace.t[-1]), np.clip(shown.margin, -REACH, REACH)
    pushed = np.abs(shown.force).any(axis=1)
    axes.fill_between(t, -REACH, REACH, where=pushed, step="mid", color=PUSHED, lw=0)
    axes.axhline(0.0, color=MUTED, lw=0.75)
    for colour, chosen in ((GOOD, margin >= 0.0), (BAD, margin < 0.0)):
        axes.plot(t, np.where(chosen, margin, np.nan), color=colour, lw=1.5)
    word, points = f"{1e3 * float(trace.margin[-1]):+.0f} mm", 0.105 * height
    axes.text(0.02, 0.06, "CoM margin (simulator's truth)", color=MUTED, size=points, transform=axes.transAxes)
    colour = LINE if trace.margin[-1] >= 0.0 else BAD
    axes.text(0.98, 0.06, word, color=colour, size=points, ha="right", transform=axes.transAxes)
    return pixels(figure)


def map_view(bus: Bus) -> NDArray[np.uint8] | None:
    """Return (height, width, 3) RGB; None in a stack without a map."""
    grid, place, odometry = (bus.latest(topics.MAP), bus.latest(topics.MAP_POSE), bus.latest(topics.ODOMETRY))
    if grid is None or place is None or odometry is None:
        return None
    T_map_odom = place.T_odom_map.to(PlanarPose(0.0, 0.0, 0.0))
    picture = MapPicture(grid.in_map, 2)
    scan, way = bus.latest(topics.SCAN), bus.latest(topics.NAV_PATH)
    if scan is not None:
        seen = scan.seen_from(T_map_odom)
        height = seen.heights
        picture.dots(seen.points[(height > 0.12) & (height < 1.9), :2][::4], SCAN)
    if way is not None and way.frame == "map":
        picture.line(way.points, WAY)
    known = bus.latest(topics.MEMORY_PLACES)
    if known is not None and known.frame == "map":
        for one in reversed(known.places):  # what was seen last is drawn over the rest
            at = np.array([one.x, one.y])
            picture.mark(at, place_words(one), INK if one.there else FAINT)
    picture.pose(T_map_odom @ PlanarPose.of(odometry.T_odom_base), ROBOT)
    return picture.rgb()


def place_words(place: RememberedPlace) -> str:
    """Return what is written beside a place: what is there, and how long ago it was seen, or that it is gone."""
    age = place.age
    ago = f"{age:.0f} s" if age < 120.0 else f"{age / 60.0:.0f} min" if age < 7200.0 else f"{age / 3600.0:.0f} h"
    return f"{place.label} {ago}" if place.there else f"{place.label}, gone"


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
    """The stages of a skill, name and start [s], and `target` (3,), what it aimed at last in odom [m], or None."""

    def __init__(self) -> None:
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
