"""Goes straight to a pose, in all directions, and stands there: no map, no obstacles.

A robot that walks follows twists as small as they come, so it approaches the goal ever more slowly and marks time there
until it is sure to be right. Told to stand it takes another step or two, and other legs may take over, which moves it
again: it aims off by as much as the last stops moved it, and starts over if it ends too far off none the less.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from golem.capabilities.navigation.base import NavInputs
from golem.finite import check_finite
from golem.interfaces.nav_payloads import NavStep
from golem.options import require
from golem.types import Array, PlanarPose, Twist, wrap

ZERO = Twist()

MAX_COAST = (0.3, 0.3, 0.5)
"""Furthest that a stop may be expected to move the robot ahead, to its left [m] and round [rad] [own]."""


@dataclass(frozen=True, slots=True)
class GoToConfig:
    """Options of `GoTo`.

    Attributes:
        speed: bounds of vx, vy [m/s] and wz [rad/s], backward as forward.
        gain: twist per error [1/s].
        face: distance beyond which the robot turns towards the goal instead of into its final heading [m].
        pulse: smallest twist that sets a standing robot in motion, as the norm of vx, vy and wz; above the dead
            band of the legs, 0.1.
        creep: smallest size of a twist on the way; above what counts as zero for walking legs, 0.02.
        smoothing: time constant of the filter on the measured pose [s]: half a step, so that the sway of walking
            and the noise of odometry do not reach the twist.
        close, aligned: errors within which the robot has to stay to be told to stand [m], [rad].
        dwell: for so long [s]: half a period of the gait and more.
        accept, straight: errors after the stop with which it stays [m], [rad].
        widen: factor on these two with every time it started over: a robot that stops no better is not chased for ever.
        rest: time without a step over which the pose is averaged, and after which the robot is judged to stand or
            starts over [s].
        settle: time without a step before that, in which other legs take over, the body comes to rest and old poses
            arrive [s]: judged 0.3 s after the last step, the robot moved 30 mm more.
        march: time in motion before the robot may be told to stand [s]: told after half a second, with its weight still
            going from one controller to the other, it moved 3 cm more than after some steps.
        coast: how far the first stop is expected to move the robot ahead, to its left [m] and round [rad].
        learn: share of the way that every stop brings this expectation to what it measured: stops scatter by 1 cm and 2
            degrees, of which nothing but the turn is the same at the next one.
    """

    speed: tuple[float, float, float] = (0.6, 0.3, 0.6)
    gain: float = 1.2
    face: float = 1.0
    pulse: float = 0.12
    creep: float = 0.025
    smoothing: float = 0.3
    close: float = 0.015
    aligned: float = 0.015
    dwell: float = 0.4
    accept: float = 0.025
    straight: float = 0.03
    widen: float = 1.2
    rest: float = 1.0
    settle: float = 1.5
    march: float = 1.5
    coast: tuple[float, float, float] = (0.0, 0.0, 0.0)
    learn: float = 0.5

    def __post_init__(self) -> None:
        positive = ("gain", "face", "pulse", "creep", "smoothing", "close", "aligned", "accept", "straight")
        values = {name: getattr(self, name) for name in positive} | {"speed": min(self.speed)}
        times = {name: getattr(self, name) for name in ("dwell", "rest", "settle", "march")}
        require(
            "goto option ",
            *((n, v, 0.0 < v < math.inf, "a positive number") for n, v in values.items()),
            *((n, v, 0.0 <= v < math.inf, "a time in seconds, not negative") for n, v in times.items()),
            ("widen", self.widen, 1.0 <= self.widen < math.inf, "a factor of at least 1"),
            ("learn", self.learn, 0.0 <= self.learn <= 1.0, "a share from 0 to 1"),
        )


class GoTo:
    """Follows the straight line to the goal, and looks at neither map nor scan; see `Navigator`."""

    rate = 100.0
    latency = 0.0  # a step takes some 50 microseconds

    def __init__(self, config: GoToConfig | None = None) -> None:
        self.config = config or GoToConfig()
        self._goal: PlanarPose | None = None
        self._coast = PlanarPose(*self.config.coast)
        self._forget()

    def start(self, goal: PlanarPose) -> None:
        self._goal = goal
        self._forget()

    def step(self, inputs: NavInputs, dt: float) -> NavStep:
        pose, moving = inputs.pose, inputs.moving
        if self._goal is None:
            self._goal = pose
        config = self.config
        self._filter(pose, dt)
        self._rested, self._moved = (0.0, self._moved + dt) if moving else (self._rested + dt, 0.0)
        here = self._stood(pose, dt) or self._at()
        # A robot that moves is where it would stand if it were told to now.
        left = (here @ self._coast if moving else here).to(self._goal)
        distance, turn = math.hypot(left.x, left.y), abs(left.yaw)
        if self._walking:
            steady = not moving or self._moved >= config.march
            near = steady and distance < self._slack * config.close and turn < self._slack * config.aligned
            self._near = self._near + dt if near else 0.0
            self._walking = self._near < config.dwell
            self._sent_from = here if moving else None
        elif self._rested >= config.settle + config.rest:
            if self._sent_from is not None:
                # A robot that was pushed meanwhile shall not teach the next stop.
                measured, self._sent_from = _within(self._sent_from.to(here), MAX_COAST), None
                self._coast = self._coast.toward(measured, config.learn)
            off = distance > self._slack * config.accept or turn > self._slack * config.straight
            if off:
                self._walking, self._near = True, 0.0
                self._slack *= config.widen
        if self._walking:
            return NavStep(self._towards(left, config.creep if moving else config.pulse), False, left)
        return NavStep(ZERO, self._rested >= config.settle + config.rest, left)

    def _forget(self) -> None:
        self._pose: Array | None = None
        self._velocity: Array = np.zeros(3)
        self._rested = self._moved = self._near = 0.0
        self._sum: Array = np.zeros(3)
        self._sent_from: PlanarPose | None = None
        self._slack = 1.0
        self._walking = True

    def _filter(self, pose: PlanarPose, dt: float) -> None:
        """Track pose and velocity by the critically damped g-h filter with fading memory (Brookner, 1998)."""
        measured = np.array([pose.x, pose.y, pose.yaw])
        check_finite("the pose", measured)
        if self._pose is None:
            self._pose = measured
            return
        memory = math.exp(-dt / self.config.smoothing)
        predicted = self._pose + self._velocity * dt
        surprise = measured - predicted
        surprise[2] = wrap(surprise[2])
        self._pose = predicted + (1.0 - memory**2) * surprise
        self._velocity = self._velocity + (1.0 - memory) ** 2 / dt * surprise

    def _stood(self, pose: PlanarPose, dt: float) -> PlanarPose | None:
        """Return the mean pose since the robot came to rest, or None while it has not: noise is all that changes it."""
        rested = self._rested - self.config.settle
        if rested <= 0.0 or self._goal is None:
            self._sum = np.zeros(3)
            return None
        # Relative to the goal, where the heading does not wrap.
        off = self._goal.to(pose)
        self._sum = self._sum + np.array([off.x, off.y, off.yaw]) * min(dt, rested)
        return self._goal @ PlanarPose(*(self._sum / rested).tolist())

    def _at(self) -> PlanarPose:
        assert self._pose is not None
        return PlanarPose(*self._pose.tolist())

    def _towards(self, left: PlanarPose, minimum: float) -> Twist:
        """Return the twist along the straight line to the goal that is `left`, within bounds, and of size `least`."""
        config = self.config
        turn = math.atan2(left.y, left.x) if math.hypot(left.x, left.y) > config.face else left.yaw
        line = config.gain * np.array([left.x, left.y])
        # One factor for both components keeps the robot on the line.
        line = line / max(1.0, *(np.abs(line) / config.speed[:2]))
        spin = min(max(config.gain * turn, -config.speed[2]), config.speed[2])
        size = math.hypot(*line, spin)
        boost = minimum / size if 0.0 < size < minimum else 1.0
        return Twist(float(line[0] * boost), float(line[1] * boost), float(spin * boost))


def _within(pose: PlanarPose, bounds: tuple[float, float, float]) -> PlanarPose:
    """Return `pose` with x, y and yaw limited to +- `bounds`."""
    x, y, yaw = (min(max(v, -b), b) for v, b in zip((pose.x, pose.y, pose.yaw), bounds, strict=True))
    return PlanarPose(x, y, yaw)
