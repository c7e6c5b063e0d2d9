"""What taking a thing is asked for, how it is set, and what it reports."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from golem.errors import ConfigError


@dataclass(frozen=True, slots=True)
class TakeGoal:
    """What to take.

    Attributes:
        label: class of the thing.
        side: which hand; `either` begins with the one on whose side it stands.
        approach: `top` comes down on it, `forward` from the robot; `either` tries both.
        near: x, y in odom where it is expected [m], one after the other; of several the nearest is taken.
    """

    label: str
    side: Literal["left", "right", "either"] = "either"
    approach: Literal["top", "forward", "either"] = "either"
    near: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not self.label:
            raise ConfigError("Taking needs the class of the thing.")
        if len(self.near) not in (0, 2) or not all(map(math.isfinite, self.near)):
            raise ConfigError("Where a thing is expected are two finite numbers, x and y.")


@dataclass(frozen=True)
class TakeThingConfig:
    """Distances, speeds and forces.

    Attributes:
        before: distance from the grasp, along the approach, from which the hand goes straight to it [m].
        watch: distance of the fingertips from the thing when the palm camera looks at it [m].
        lean: how far a forward approach leans down [rad]: level with a low counter the forearm does not reach.
        look_again: whether the palm camera corrects what the head camera saw; without, all is open loop.
        looks: how often the hand is brought above the thing at most, each time by what its camera saw before.
        centred: distance from where it was expected below which one look was enough [m].
        glances: how often it is looked at just before the grasp: in a hoist and on its feet the robot sways.
        trust: how far from where the head camera has it the palm camera may see it [m].
        attempts: how many proposed grasps of one approach are tried to be reached.
        travel_speed: between places [m/s].
        reach_speed: straight to the thing, and up with it [m/s].
        touch: force of each finger until both touch [N]; less than what moves the thing or tips it.
        force: of each finger [N].
        tuned: whether that force is what friction needs to hold the thing, by the stack's `properties`, and `force` is
            only the most; with `hand: {use: deligrasp}` as DeliGrasp has it.
        safety: by how much more than its weight a tuned force holds; a thing held beside its middle turns.
        squeeze: how far a tuned force may press the thing together [m].
        close_timeout: time the fingers may take [s].
        lift: how high it is lifted [m].
        turn: how far the torso turns to either side where it is not in view [rad]; 0: not at all.
        tolerance: distance from a commanded pose at which the arm counts as arrived [m].
        look_timeout: time a camera may take to show it [s].
        timeout: time after which it is given up [s].
    """

    before: float = 0.12
    watch: float = 0.12
    lean: float = 0.5
    look_again: bool = True
    looks: int = 3
    centred: float = 0.015
    glances: int = 6
    trust: float = 0.15
    attempts: int = 12
    travel_speed: float = 0.25
    reach_speed: float = 0.08
    touch: float = 1.0
    force: float = 16.0
    tuned: bool = False
    safety: float = 2.0
    squeeze: float = 0.004
    close_timeout: float = 2.5
    lift: float = 0.12
    turn: float = 0.45
    tolerance: float = 0.006
    look_timeout: float = 1.5
    timeout: float = 90.0


@dataclass
class TakeReport:
    """What was taken, and how.

    Attributes:
        side: hand that has it; empty where none does.
        approach: `top` or `forward`.
        x, y, z: where it stood, in odom [m].
        below: height of the fingertips above what it stood on [m].
        above: height of its top above the fingertips [m].
        width: how far the fingers are open around it [m].
        force: what each finger was told to press with [N].
        radius: half of its width as seen, across where it is widest [m].
        aside_x, aside_y: where its middle is beside the fingertips, along the hand's x and y axes [m].
        off_x, off_y: how far from where the head camera had it the hand found it, outwards from the robot and to its
            left, as a share of its distance: a camera that looks aside has all things turned about the robot.
    """

    side: str = ""
    approach: str = ""
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    below: float = 0.0
    above: float = 0.0
    width: float = 0.0
    force: float = 0.0
    radius: float = 0.0
    aside_x: float = 0.0
    aside_y: float = 0.0
    off_x: float = 0.0
    off_y: float = 0.0
