"""Goes straight to a pose, in all directions, and stands there: no map, no obstacles.

Walking robots do not follow small twists: below a dead band they stand. The last centimetres therefore go in bounded
pulses at a speed above it, each ended early by what the robot still moves while it stops. And a robot told to stand
takes another step or two, which move it again: the loop stays closed until it stands, and starts over if that
brought it too far off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from golem.capabilities.navigation.base import Course, PlanarPose, wrap
from golem.types import Array, Twist

ZERO = Twist()


@dataclass(frozen=True, slots=True)
class GoToConfig:
    """Options of `GoTo`.

    Attributes:
        speed: bounds of vx, vy [m/s] and wz [rad/s], backward as forward.
        gain: twist per error [1/s].
        face: distance beyond which the robot turns towards the goal instead of into its final heading [m].
        pulse: least size of a twist, as the norm of vx, vy and wz; above the dead band of the legs, 0.1.
        smoothing: time constant of the filter on the measured pose [s]: half a step, so that the sway of walking
            and the noise of odometry do not reach the twist.
        coast: time for which the robot goes on at its present velocity once it is told to stop [s].
        close, aligned: errors of the predicted stop at which it is told to [m], [rad].
        accept, straight: errors after the stop with which it stays [m], [rad].
        widen: factor on these two with every time it started over: a robot that stops no better is not chased for ever.
        rest: time without a step after which the robot stands [s].
    """

    speed: tuple[float, float, float] = (0.5, 0.25, 0.5)
    gain: float = 1.0
    face: float = 1.0
    pulse: float = 0.15
    smoothing: float = 0.3
    coast: float = 0.2
    close: float = 0.015
    aligned: float = 0.015
    accept: float = 0.03
    straight: float = 0.03
    widen: float = 1.2
    rest: float = 1.0


class GoTo:
    """Follows the straight line to the goal; see `Navigator`."""

    def __init__(self, config: GoToConfig | None = None) -> None:
        """Begin without a goal: the place of the first pose."""
        self.config = config or GoToConfig()
        self._goal: PlanarPose | None = None
        self._forget()

    def start(self, goal: PlanarPose) -> None:
        """Pursue `goal`; see `Navigator`."""
        self._goal = goal
        self._forget()

    def step(self, pose: PlanarPose, stepping: bool, dt: float) -> Course:
        """Return the twist of this tick; see `Navigator`."""
        if self._goal is None:
            self._goal = pose
        config = self.config
        self._filter(pose, dt)
        self._rested = 0.0 if stepping else self._rested + dt
        left, stop = self._at(0.0).to(self._goal), self._at(config.coast).to(self._goal)
        stood = not (self._moving or self._turning)
        # The filter takes a while to see that the robot has stopped.
        blind = stood and 0.0 < self._rested < 0.5 * config.rest
        if self._moving:
            past = stop.x * left.x + stop.y * left.y <= 0.0
            self._moving = not past and math.hypot(stop.x, stop.y) > config.close
        elif not blind:
            self._moving = math.hypot(left.x, left.y) > self._slack * config.accept
        if self._turning:
            self._turning = stop.yaw * left.yaw > 0.0 and abs(stop.yaw) > config.aligned
        elif not blind:
            self._turning = abs(left.yaw) > self._slack * config.straight
        if stood and self._rested > 0.0 and (self._moving or self._turning):
            self._slack *= config.widen
        if self._moving or self._turning:
            return Course(self._towards(left), False, left)
        return Course(ZERO, self._rested >= config.rest, left)

    def _forget(self) -> None:
        self._pose: Array | None = None
        self._velocity: Array = np.zeros(3)
        self._rested = 0.0
        self._slack = 1.0
        self._moving = self._turning = True

    def _filter(self, pose: PlanarPose, dt: float) -> None:
        """Track pose and velocity by the critically damped g-h filter with fading memory (Brookner, 1998)."""
        measured = np.array([pose.x, pose.y, pose.yaw])
        if self._pose is None:
            self._pose = measured
            return
        memory = math.exp(-dt / self.config.smoothing)
        predicted = self._pose + self._velocity * dt
        surprise = measured - predicted
        surprise[2] = wrap(surprise[2])
        self._pose = predicted + (1.0 - memory**2) * surprise
        self._velocity = self._velocity + (1.0 - memory) ** 2 / dt * surprise

    def _at(self, ahead: float) -> PlanarPose:
        """Return the smoothed pose, `ahead` [s] from now at the present velocity."""
        assert self._pose is not None
        return PlanarPose(*(self._pose + ahead * self._velocity).tolist())

    def _towards(self, left: PlanarPose) -> Twist:
        """Return the twist along the straight line to the goal that is `left`, within bounds."""
        config = self.config
        distance = math.hypot(left.x, left.y)
        turn = math.atan2(left.y, left.x) if distance > config.face else left.yaw
        line = config.gain * np.array([left.x, left.y]) * self._moving
        spin = config.gain * turn * (self._turning or distance > config.face)
        # One factor for both components keeps the robot on the line.
        excess = max(1.0, *(np.abs(line) / config.speed[:2]))
        line = line / excess
        spin = min(max(spin, -config.speed[2]), config.speed[2])
        size = math.hypot(*line, spin)
        boost = config.pulse / size if 0.0 < size < config.pulse else 1.0
        return Twist(float(line[0] * boost), float(line[1] * boost), float(spin * boost))
