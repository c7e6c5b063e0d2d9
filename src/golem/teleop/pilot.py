"""Who drives, and what they want: several windows may ask, one has control, and nothing moves without a held switch."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from golem.errors import GolemError
from golem.options import require
from golem.types import SIDES, Array, Side

SILENCE = 0.25
"""Age of the newest message from which on a held switch counts as let go [s] [own: five messages of a page]."""


class BadMessage(GolemError):
    """A window said something that makes no sense; it counts as having let go."""


@dataclass(frozen=True)
class PilotConfig:
    """How strong hands and sticks are.

    Attributes:
        speed, turn: of a palm at full deflection [m/s], [rad/s].
        walk, side, spin: of the base at full deflection [m/s], [m/s], [rad/s].
        lift, waist: of its height [m/s] and of the torso [rad/s].
        scale: movement of the hand per movement of a tracked device, while the clutch is held.
    """

    speed: float = 0.15
    turn: float = 0.8
    walk: float = 0.3
    side: float = 0.2
    spin: float = 0.4
    lift: float = 0.05
    waist: float = 0.3
    scale: float = 1.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            require("pilot's ", (name, value, 0.0 < value <= 3.0, "more than 0 and at most 3"))


@dataclass(slots=True)
class Wish:
    """What whoever has control wants at one moment.

    Attributes:
        moves: whether anything may move at all: one window holds its switch, and was heard a moment ago.
        rates: (6,) velocity of each palm in base_link [m/s], [rad/s].
        devices: (4, 4) pose of a tracked device in base_link's axes while its clutch is held, and a number that changes
            with each grip of the clutch.
        goals: (4, 4) pose in odom that a gizmo was dragged to.
        grips: opening [m] that a hand was told; 0 closes.
        twist: (3,) of the base [m/s], [rad/s].
        lift, waist: rates of height [m/s] and torso [rad/s].
    """

    moves: bool = False
    rates: dict[Side, Array] = field(default_factory=dict[Side, Array])
    devices: dict[Side, tuple[int, Array]] = field(default_factory=dict[Side, tuple[int, Array]])
    goals: dict[Side, Array] = field(default_factory=dict[Side, Array])
    grips: dict[Side, float] = field(default_factory=dict[Side, float])
    twist: Array = field(default_factory=lambda: np.zeros(3))
    lift: float = 0.0
    waist: float = 0.0


@dataclass(slots=True)
class _Window:
    heard: float
    hold: bool = False
    said: Mapping[str, Any] = field(default_factory=dict[str, Any])
    clutch: int = 0
    dragged: dict[Side, Array] = field(default_factory=dict[Side, Array])


class HandPilot:
    """Takes what windows say, in their threads, and says what is wanted, in the robot's.

    A window that holds its switch while no other does has control until it lets go. Where two hold theirs nobody has
    control, until all have let go.

    Attributes:
        state: who has control: a window's name, empty for nobody, or `two` where two want it.
    """

    def __init__(self, config: PilotConfig | None = None) -> None:
        self.config, self.state = config or PilotConfig(), ""
        self._windows: dict[str, _Window] = {}
        self._lock, self._orders = threading.Lock(), list[str]()

    def hear(self, who: str, message: object, now: float) -> None:
        """Take a message of window `who` at `now` [s], which never jumps. Raises BadMessage: it makes no sense."""
        with self._lock:
            window = self._windows.setdefault(who, _Window(now))
            window.heard, window.hold, window.said = now, False, {}
            said = window.said = checked(message)
            window.hold = bool(said.get("hold"))
            window.clutch += not window.hold
            if isinstance(said.get("order"), str) and len(self._orders) < 8:
                self._orders.append(said["order"])

    def drag(self, who: str, side: Side, T_odom: Array | None, now: float) -> None:
        """Take where a gizmo is dragged to, (4, 4) in odom; None lets it go. It is held as long as it is dragged."""
        with self._lock:
            window = self._windows.setdefault(who, _Window(now))
            window.dragged.pop(side, None)
            if T_odom is not None:
                window.dragged[side] = T_odom
            # A drag sends nothing while it rests: it ends when it is let go or its window is gone.
            window.heard, window.hold = (math.inf if window.dragged else now), bool(window.dragged)

    def leave(self, who: str) -> None:
        """Forget the window `who`: it is closed, or its connection cut."""
        with self._lock:
            self._windows.pop(who, None)

    def take_order(self) -> str:
        """Return the oldest order, a word, that has not been taken; empty where there is none."""
        with self._lock:
            return self._orders.pop(0) if self._orders else ""

    def wish(self, now: float) -> Wish:
        """Return what is wanted at `now` [s]."""
        with self._lock:
            holding = [who for who, w in self._windows.items() if w.hold and now - w.heard < SILENCE]
            fight = len(holding) > 1 or (self.state == "two" and bool(holding))
            self.state = "two" if fight else holding[0] if holding else ""
            return Wish() if fight or not holding else self._read(self._windows[self.state])

    def _read(self, window: _Window) -> Wish:
        c, said, wish = self.config, window.said, Wish(True, goals=dict(window.dragged))
        for side in SIDES:
            part = said.get(side, {})
            if "v" in part:
                wish.rates[side] = np.array(part["v"], float) * np.repeat((c.speed, c.turn), 3)
            if "device" in part:
                T = np.eye(4)
                T[:3, 3] = part["device"][:3]
                T[:3, :3] = Rotation.from_quat(part["device"][3:], scalar_first=True).as_matrix()
                wish.devices[side] = window.clutch, T
            if "grip" in part:
                wish.grips[side] = float(part["grip"])
        wish.twist = np.array(said.get("twist", (0.0, 0.0, 0.0)), float) * (c.walk, c.side, c.spin)
        wish.lift, wish.waist = c.lift * said.get("lift", 0.0), c.waist * said.get("waist", 0.0)
        return wish


_HAND = {"v": (6, 1.0), "device": (7, 10.0), "grip": (0, 0.2)}
_WHOLE = {"twist": (3, 1.0), "lift": (0, 1.0), "waist": (0, 1.0)}
"""Key -> how many numbers, 0 for one that stands alone, and their greatest size."""


def checked(message: object) -> Mapping[str, Any]:
    """Return a message of as many numbers as it takes, finite and in range. Raises BadMessage: it makes no sense."""
    if not isinstance(message, dict) or not all(isinstance(message.get(side, {}), dict) for side in SIDES):
        raise BadMessage("A message is a map, and each hand's part is one.")
    for part, sizes in ((message, _WHOLE), *((message.get(side, {}), _HAND) for side in SIDES)):
        for name, (size, most) in sizes.items():
            if name not in part:
                continue
            value = part[name] if size else [part[name]]
            fine = isinstance(value, list) and len(value) == max(size, 1)
            if not fine or not all(type(x) in (int, float) and abs(x) <= most for x in value):
                raise BadMessage(f"'{name}' is {size or 'one'} number{'s' * bool(size)} from {-most:g} to {most:g}.")
            if name == "device" and not 0.5 < np.linalg.norm(value[3:]) < 2.0:
                raise BadMessage("The quaternion of a device has length 1.")
    return message
