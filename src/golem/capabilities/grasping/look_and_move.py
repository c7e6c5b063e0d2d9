"""The paper's visual servo as its code has it: look, move, stop, look again; every look waits for the hand to rest.

The filter is that of `visual_servo`. Numbers marked [authors] are those of the authors' code. It is there to be
compared with `visual_servo`, which looks while it moves.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from golem.capabilities.grasping.base import Grasp, ServoLaw, ServoStep
from golem.capabilities.grasping.visual_servo import ServoLawConfig, VisualServo, VisualServoConfig
from golem.options import require
from golem.types import Array, LocalizedObject

BACK = 0.01
"""How much higher than the hand a goal is that is a retreat [m]."""


def authors_law() -> ServoLawConfig:
    """Return the numbers of a loop that sees one frame per move, and is lost or stalled as the authors' is."""
    return ServoLawConfig(
        confirm=1,
        dwell=1,
        looks=3,
        tolerance=0.002,
        height_tolerance=0.001,
        blind_after=1.0,
        lost_after=5.0,
        stall_after=21.5,
        progress=0.001,
        patience=90.0,
    )


@dataclass(frozen=True)
class LookAndMoveConfig(VisualServoConfig):
    """Options of `LookAndMove`; those of `visual_servo`, and the cycle's.

    Attributes:
        servo: noise, gates and patience of the loop. Height within 1 mm, lost after 5 s, stalled after five moves
            without 1 mm, given up after 90 s [authors]. Theirs asks for 0.25 mm along the closing axis, which their arm
            cannot do, and 5 mm across; here it is 2 mm [own].
        move: time that one correction takes [s] [authors].
        rest: time at rest before the frame that counts [s] [authors].
        gain: share of the error that one correction takes away [authors].
        step: greatest correction [m] [authors].
    """

    servo: ServoLawConfig = field(default_factory=authors_law)
    move: float = 4.0
    rest: float = 0.25
    gain: float = 0.6
    step: float = 0.05

    def __post_init__(self) -> None:
        require(
            "look_and_move ",
            ("move", self.move, 0.0 <= self.move <= 30.0, "from 0 to 30 s"),
            ("rest", self.rest, 0.0 <= self.rest <= 10.0, "from 0 to 10 s"),
            ("gain", self.gain, 0.0 < self.gain <= 1.0, "from 0 to 1"),
            ("step", self.step, 0.0 < self.step <= 1.0, "from 0 to 1 m"),
        )


class StopAndGo:
    """A servo law that asks another one once per cycle, and sends the hand a part of the way; see `ServoLaw`."""

    def __init__(self, config: LookAndMoveConfig, law: ServoLaw, t: float) -> None:
        """Begin with a look at time `t` [s]."""
        self.label, self.patience = law.label, law.patience
        self._config, self._law = config, law
        self._looks_from = t + config.rest
        self._last: ServoStep | None = None

    def step(self, t: float, sightings: list[LocalizedObject] | None, T_odom_gripper: Array) -> ServoStep:
        """Advance; see `ServoLaw`. While the hand moves, and until a frame comes, the answer stays as it is."""
        c, last = self._config, self._last
        looks = t >= self._looks_from
        if last is not None and not (looks and sightings is not None):
            return last
        step = self._law.step(t, sightings if looks else None, T_odom_gripper)
        T = step.T_odom_gripper.copy()
        # Without a sighting it moves only to back off.
        seen = looks and any(one.label == self.label for one in sightings or ())
        moves = seen or T[2, 3] > T_odom_gripper[2, 3] + BACK
        if moves:
            self._looks_from = t + c.move + c.rest
        else:
            T = T_odom_gripper.copy()
        way = c.gain * (T[:3, 3] - T_odom_gripper[:3, 3])
        T[:3, 3] = T_odom_gripper[:3, 3] + way * min(1.0, c.step / max(float(np.linalg.norm(way)), 1e-9))
        self._last = ServoStep(T, step.target, step.sigma, step.status)
        return self._last


class LookAndMove(VisualServo):
    """Centroid grasp, corrected by the palm camera between moves; see `GraspMethod`."""

    config: LookAndMoveConfig

    def __init__(self, config: LookAndMoveConfig | None = None) -> None:
        super().__init__(config or LookAndMoveConfig())

    def servo(self, target: LocalizedObject, grasp: Grasp, t: float) -> ServoLaw:
        return StopAndGo(self.config, super().servo(target, grasp, t), t)
