"""What a pick is asked, its distances, speeds and forces, and what it reports."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Literal

from golem.capabilities.planning.base import PlanRefused, Refusal
from golem.errors import ConfigError
from golem.skills.base import StageFailed
from golem.skills.detection_stream import SURE
from golem.skills.poses import floor_places
from golem.types import Side

RISEN = 0.003
"""How much higher a screw stands after a pull that did not take it, if it is loose and jammed [m] [own: three
standard deviations of the height that the palm camera measures]."""


class PickOutcome(StrEnum):
    """How a pick, or one of its attempts, ended."""

    PICKED = "picked"
    """It is in the container."""
    OUT_OF_REACH = "out_of_reach"
    """No hand gets there, or not along the line that the object has to be pulled along."""
    BLOCKED = "blocked"
    """Something is in the way."""
    NOTHING_THERE = "nothing_there"
    """No such object was seen, or the fingers closed on nothing."""
    TRAY_MISSING = "tray_missing"
    """The container was not seen."""
    TRAY_FULL = "tray_full"
    """What lies in the container reaches up to its rim."""
    TRAY_OUT_OF_REACH = "tray_out_of_reach"
    """No hand gets to any place in the container, or none that gets to such an object, too."""
    TIGHT = "tight"
    """It did not move."""
    JAMMED = "jammed"
    """It moved, and did not come out."""
    SLIPPED = "slipped"
    """It slipped out of the fingers, and nobody looked whether it had moved; or it was lost on the way."""
    FAILED = "failed"
    """Anything else."""


class Sight(StrEnum):
    """What a look said."""

    YES = "yes"
    NO = "no"
    UNKNOWN = "unknown"
    """Nobody looked, or the place was not in view."""


@dataclass
class Tried:
    """One object that was tried.

    Attributes:
        side: hand that tried it.
        x, y, z: where it was last seen, in odom [m].
        outcome: one of `PickOutcome`.
    """

    side: Side
    x: float
    y: float
    z: float
    outcome: str = PickOutcome.FAILED.value


@dataclass
class PickReport:
    """What a pick found out.

    Attributes:
        outcome: one of `PickOutcome`, of the whole.
        tried: every object that was approached, in order.
        in_tray: whether the head camera saw it in the container afterwards, one of `Sight`.
        bore_empty: whether it saw that the object's place is empty, one of `Sight`.
        off: by how much, along x and y, the hand's own camera was known to see things elsewhere [m]; () where unknown.
        let_go: x and y in odom, as the head camera shows it, where a hand let go that saw the container below it [m].
    """

    outcome: str = PickOutcome.FAILED.value
    tried: list[Tried] = field(default_factory=list[Tried])
    in_tray: str = Sight.UNKNOWN.value
    bore_empty: str = Sight.UNKNOWN.value
    off: tuple[float, ...] = ()
    let_go: tuple[float, ...] = ()

    @property
    def seen(self) -> str:
        """Say what the head camera saw, as the end of a sentence."""
        words = {Sight.YES.value: ", and is seen there", Sight.NO.value: ", but is not seen there"}
        bore = "; its place still looks taken" if self.bore_empty == Sight.NO else ""
        return words.get(self.in_tray, "") + bore


class PickFailed(StageFailed):
    """A stage of a pick failed, and what that says of the object or the work place is known."""

    def __init__(self, outcome: PickOutcome, stage: str, slot: str, reason: str) -> None:
        """Say what it says, which `stage` failed, whose module is responsible, and why."""
        super().__init__(stage, slot, reason)
        self.outcome = outcome


_REFUSED = {
    Refusal.UNREACHABLE: PickOutcome.OUT_OF_REACH,
    Refusal.OFF_LINE: PickOutcome.OUT_OF_REACH,
    Refusal.GOAL: PickOutcome.BLOCKED,
    Refusal.START: PickOutcome.BLOCKED,
    Refusal.NO_PATH: PickOutcome.BLOCKED,
}


def outcome_of(failure: StageFailed) -> PickOutcome:
    """Return what a failure says."""
    if isinstance(failure, PickFailed):
        return failure.outcome
    refusal = refusal_of(failure)
    return PickOutcome.FAILED if refusal is None else _REFUSED.get(refusal, PickOutcome.FAILED)


def refusal_of(failure: StageFailed) -> Refusal | None:
    """Return why the motion of a stage was refused; None where something else failed."""
    cause = failure.__cause__
    return cause.refusal if isinstance(cause, PlanRefused) else None


def slipped(heights: list[float]) -> PickOutcome:
    """Return what a screw that slipped is, by the heights [m] at which it was seen before each pull."""
    if len(heights) < 2:
        return PickOutcome.SLIPPED
    return PickOutcome.JAMMED if max(heights[1:]) - heights[0] > RISEN else PickOutcome.TIGHT


Hand = Literal["left", "right", "either"]


@dataclass(frozen=True)
class PickGoal:
    """What to pick.

    Attributes:
        label: class of the object.
        container: class of what it is dropped into.
        side: which hand; `either` takes the one that reaches the object and the container.
        avoid: x, y in odom of objects that are tried only where there is no other, one after the other [m].
        wanted: x, y in odom of the only objects that are tried, likewise; none: whatever is seen.
        level: height in odom of what is wanted, for the head camera [m]; what is on another is not it; none: any.
        container_at: x, y in odom of the only container that counts, likewise; none: whichever is seen best.
        off: x, y in odom by how much a palm camera sees things elsewhere than the head camera does [m]. Where it is
            known, what the palm camera shows elsewhere is not the object; none: it is not.
        landmarks: x, y, z in odom of what stands there by a list, for the head camera [m]: by them a hand learns what
            its camera is off by, where that is not known.
    """

    label: str = "screw"
    container: str = "tray"
    side: Hand = "right"
    avoid: tuple[float, ...] = ()
    wanted: tuple[float, ...] = ()
    level: tuple[float, ...] = ()
    container_at: tuple[float, ...] = ()
    off: tuple[float, ...] = ()
    landmarks: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not (self.label and self.container):
            raise ConfigError("A pick names the class of the object and that of its container.")
        for places in (self.avoid, self.wanted, self.container_at, self.off):
            floor_places("a pick", places)
        if len(self.landmarks) % 3 or not all(map(math.isfinite, self.landmarks)):
            raise ConfigError("The landmarks of a pick are x, y, z of each: finite numbers, three by three.")


@dataclass(frozen=True)
class PickConfig:
    """Distances, speeds and forces.

    Attributes:
        workspace: where `lines` looks for objects: x_min, x_max, y_min, y_max, z_min, z_max in base_link [m], for the
            right arm (y is mirrored for the left). The paper's box (x <= 0.60, |y| <= 0.45, -0.05 <= z <= 0.60) but
            for z, which reaches 0.10 m deeper. `planned` asks the map of reach instead.
        yaw: heading of the gripper's x axis when it points down, in base_link [rad], right arm; mirrored for the left.
        turns: turns from that heading that are tried in order, where the hand cannot come as before [rad].
        container_radius: objects nearer than this to the container's middle lie in it and are left there [m].
        sure: score from which on a container counts whose shape does not show.
        comfort: x, y in base_link around which the arm works best [m]; the nearest object is taken first.
        attempts: how often a method that looks again may try to grasp and pull one object.
        candidates: how many objects it may try.
        look_again: time within which it looks once more for what was lost, after all was tried [s]; 0: never.
        few: where fewer are seen that a hand can take, the torso turns for another look.
        slack: how far beside the reach of a hand the head camera may see what is tried all the same [m]; it is off by
            that much.
        proud: height above the ground around it [m] from which on an object comes before lower ones: as the head camera
            sees them, half of the tight screws are lower than 9 mm, and half of the loosened ones higher than 15 mm.
        turn: how far the torso turns to either side where object or container are not in view [rad]; 0: not at all.
        travel: `planned` goes around what the head camera shows, in postures from which the way down is straight;
            `lines` goes up, across and down, blind to what is in the way.
        clearance: height of the gripper above the object when it arrives and when it leaves [m].
        travel_height: minimum height of the gripper when it moves across, in odom [m]; clears the tray's walls.
        travel_speed: between places [m/s].
        descend_speed: straight down to an open-loop grasp [m/s].
        servo_speed: limit of the visual servo [m/s].
        press_force: force at which the servo's way down is given up [N]: fingers stand on something.
        force: force of each finger [N].
        close_timeout: time the fingers may take [s].
        pull: length of the straight extraction [m]; longer than any screw.
        pull_speed: how fast [m/s].
        guard_force: force at which the first millimetres of a pull are given up [N]: loosened screws resist with 2 to
            4 N, tight ones with 16 N until the fingers slip. Joints that rub turn back at 5 to 7 N at the hand.
        guard_length: how long these millimetres are, of the commanded pose [m]; 0 feels nothing.
        tolerance: distance from a commanded pose at which the arm counts as arrived [m].
        drop_margin: distance of the place where it lets go from the container's rim [m].
        drop_height: height of the fingertips above the container's floor when they open [m].
        release_gap: opening that lets go [m].
        looks_after: pictures of the head camera in which it looks for what was dropped; 0 does not look.
        look_timeout: time a camera may take to show the object [s].
        timeout: time after which the pick is given up [s]; the paper's grasps took 75 +- 16 s, and there may be two.
    """

    workspace: tuple[float, float, float, float, float, float] = (0.30, 0.60, -0.30, 0.10, -0.15, 0.60)
    yaw: float = -1.5707963267948966
    turns: tuple[float, ...] = (0.0, 0.4, -0.4)
    container_radius: float = 0.15
    sure: float = SURE
    comfort: tuple[float, float] = (0.45, -0.12)
    attempts: int = 2
    candidates: int = 8
    look_again: float = 45.0
    few: int = 3
    slack: float = 0.04
    proud: float = 0.0115
    turn: float = 0.35
    travel: Literal["lines", "planned"] = "planned"
    clearance: float = 0.15
    travel_height: float = 0.08
    travel_speed: float = 0.25
    descend_speed: float = 0.10
    servo_speed: float = 0.15
    press_force: float = 15.0
    force: float = 16.0
    close_timeout: float = 2.5
    pull: float = 0.06
    pull_speed: float = 0.05
    guard_force: float = 14.0
    guard_length: float = 0.015
    tolerance: float = 0.006
    drop_margin: float = 0.04
    drop_height: float = 0.10
    release_gap: float = 0.060
    looks_after: int = 5
    look_timeout: float = 1.0
    timeout: float = 240.0

    def heading(self, side: Side) -> float:
        """Return `yaw` for a hand, in base_link [rad]."""
        return self.yaw if side == "right" else -self.yaw
