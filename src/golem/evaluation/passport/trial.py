"""A policy walks on the floor for a few seconds: whether it stays up, and whether it goes where it is told."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from golem.capabilities.legs.description import Description
from golem.capabilities.legs.locomotion import Locomotion, LocomotionConfig
from golem.capabilities.legs.network import Network
from golem.capabilities.legs.policy import BadAction, Policy
from golem.errors import ConfigError
from golem.evaluation.passport.floor import STEP, Floor
from golem.types import LEGS, Array, Twist

STAND, WALK = 1.0, 2.0
"""How long it stands first, and how long it walks along each axis [s]."""
TWISTS = (Twist(0.4), Twist(0.0, 0.25), Twist(0.0, 0.0, 0.4))
"""What it is told, in turn, as far as its envelope goes [m/s], [rad/s]."""
SETTLE = 0.8
"""Time after a new twist that does not count [s]."""
SOUND = 1.72
"""Score from which a policy is sound [own: sound policies reach 1.78 to 1.85]."""


@dataclass(frozen=True, slots=True)
class Trial:
    """What came of it.

    Attributes:
        lasted: share of the time until it fell; 1 if it did not.
        told: (n, 3) the twists it was told, standing first.
        went: (n, 3) mean velocity in the heading frame under each; NaN where it fell before.
        jerk: mean change of the leg targets from tick to tick [rad].
        tilt: root mean square of the tilt [rad].
        steps: share of the time at which the foot that the gait clock lifts is the higher one.
    """

    lasted: float
    told: Array
    went: Array
    jerk: float
    tilt: float
    steps: float

    @property
    def fell(self) -> float:
        """When it fell, or the end [s]."""
        return self.lasted * (STAND + WALK * (len(self.told) - 1))

    @property
    def worst(self) -> Twist | None:
        """The twist that it went furthest off; the first where it fell, None where it was told none."""
        if len(self.told) == 1:
            return None
        off = np.abs(self.went - self.told)[1:].max(axis=1)
        return Twist(*self.told[1 + (0 if self.lasted < 1.0 else int(off.argmax()))].tolist())

    @property
    def score(self) -> float:
        """How well it walks: up to 1 for not falling, up to 1 for going where it is told, less what shakes it."""
        if self.lasted < 1.0:
            return self.lasted
        off = np.abs(self.went - self.told) / np.array([0.4, 0.25, 0.4])
        shaken = min(self.jerk, 0.2) + min(self.tilt, 0.5) + 0.3 * (1.0 - self.steps)
        return 2.0 - float(np.minimum(off, 1.0).mean()) - shaken


def walk(floor: Floor, description: Description, network: Network, only: Twist | None = None) -> Trial:
    """Let the policy stand and walk.

    Args:
        floor: the robot; begins anew.
        description: what is said of the policy.
        network: its network; begins anew.
        only: walk at this twist only.
    """
    e = description.envelope
    asked = [e.clamp(twist) for twist in (TWISTS if only is None else (only,))]
    twists = [Twist(), *[t for t in asked if t != Twist()]]
    told = np.array([[t.vx, t.vy, t.wz] for t in twists])
    went: Array = np.full(told.shape, np.nan)
    ends = STAND + WALK * np.arange(len(twists))
    nothing = Trial(0.0, told, went, 0.0, 0.0, 0.0)
    try:
        legs = Policy.of(description, network)
    except ConfigError:
        return nothing
    if not 1.0 <= legs.rate <= 500.0:
        return nothing
    q0 = description.q0()
    floor.q[:] = q0
    floor.place()
    locomotion = Locomotion(legs, LocomotionConfig(trim=None))
    every = max(1, round(1.0 / legs.rate / STEP))
    locomotion.reset(floor.sense()[0])
    track: list[Array] = []
    tilts: list[float] = []
    jerk, right, seen = 0.0, 0, 0
    clocked = any(t.term.startswith("phase") for t in description.observation)
    last = q0[LEGS]
    count = round(ends[-1] / STEP)
    for k in range(count):
        if k % every == 0:
            track.append(floor.pace())
            tilts.append(floor.lean())
            if floor.fallen:
                return Trial(k / count, told, went, jerk / len(track), 1.0, _share(right, seen))
            segment = int(np.searchsorted(ends, k * STEP, side="right"))
            try:
                command = locomotion.step(*floor.sense(), twists[segment], every * STEP)
            except BadAction:
                return Trial(k / count, told, went, jerk, 1.0, 0.0)
            jerk += float(np.abs(command.q - last).mean())
            last = command.q
            if locomotion.gait.stepping:
                lifted = locomotion.motion.phase >= legs.gait.stance
                if clocked and lifted.any():
                    seen += 1
                    right += int(np.argmax(floor.soles()) == np.argmax(lifted))
        floor.advance(command)
    rows = np.array(track)
    for i, end in enumerate(ends):
        begin = 0.3 if i == 0 else ends[i - 1] + SETTLE
        went[i] = rows[round(begin / STEP / every) : round(end / STEP / every)].mean(axis=0)
    tilt = float(np.sqrt(np.mean(np.square(tilts))))
    return Trial(1.0, told, went, jerk / (count / every), tilt, _share(right, seen))


def _share(right: int, seen: int) -> float:
    """Return the share of steps that are right, of a policy that steps by the clock for a while."""
    return right / seen if seen > 50 else 1.0
