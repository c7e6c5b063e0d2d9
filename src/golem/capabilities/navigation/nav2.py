"""The navigator `nav2`: Nav2 finds the way and follows it; the last step to the goal is `goto`'s.

Nav2's goal checker is content within centimetres at best, and a robot that walks is moved on by every stop. What is
left then is measured and corrected with small steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from golem.capabilities.navigation.base import NavInputs
from golem.capabilities.navigation.goto import GoTo, GoToConfig
from golem.errors import ConfigError
from golem.finite import check_finite
from golem.interfaces.nav_payloads import Nav2Reply, NavStep
from golem.options import require
from golem.types import PlanarPose, Twist

ZERO = Twist()
FAILED = {
    "rejected": "Nav2 refused the goal.",
    "aborted": "Nav2 gave the goal up; its log says why.",
    "canceled": "Somebody cancelled the goal at Nav2.",
}
"""What is said of a goal that Nav2 ends otherwise than at its place."""


class Nav2Link(Protocol):
    """Gives goals to Nav2's action NavigateToPose, and hears its controller."""

    def send(self, pose: PlanarPose) -> None:
        """Propose a goal, in the frame of the goal that the navigator pursues; it replaces the one before."""

    def reply(self) -> Nav2Reply | None:
        """Return how the newest goal stands; None while nobody has said anything."""
        ...

    def twist(self) -> Twist | None:
        """Return a new twist of Nav2's controller; None if none has come since the last call."""
        ...


@dataclass(frozen=True, slots=True)
class Nav2Config:
    """Options of `Nav2`.

    Attributes:
        patience: time that Nav2 gets to take a goal on [s].
        timeout: age of the newest twist from which on the robot stands [s].
        near: distance from the goal up to which `goto` goes the rest when Nav2 has succeeded [m]; 0 leaves it.
        speed: bounds of vx, vy [m/s] and wz [rad/s] of what is taken from Nav2.
        stop: options of `goto` for the rest.
    """

    patience: float = 5.0
    timeout: float = 0.5
    near: float = 0.8
    speed: tuple[float, float, float] = (0.6, 0.3, 0.6)
    stop: GoToConfig = field(default_factory=lambda: GoToConfig(speed=(0.3, 0.2, 0.4)))

    def __post_init__(self) -> None:
        require(
            "nav2 option ",
            ("patience", self.patience, 0.0 < self.patience < math.inf, "a positive time in seconds"),
            ("timeout", self.timeout, 0.0 < self.timeout < math.inf, "a positive time in seconds"),
            ("near", self.near, 0.0 <= self.near < math.inf, "a distance, not negative"),
            ("speed", min(self.speed), 0.0 < min(self.speed) <= max(self.speed) < math.inf, "positive numbers"),
        )


class Nav2:
    """Leaves the way to Nav2, and corrects where the robot stands at its end; see `Navigator`."""

    requires = ("scan",)
    rate = 50.0
    latency = 0.0  # Nav2 takes what it takes

    def __init__(self, config: Nav2Config | None = None, nav2: Nav2Link | None = None) -> None:
        """Speak through `nav2`, which the stack supplies. Raises ConfigError: nobody supplied it."""
        if nav2 is None:
            raise ConfigError("The navigator nav2 is made by a stack, which connects it with Nav2.")
        self.config, self._nav2 = config or Nav2Config(), nav2
        self._rest = GoTo(self.config.stop)
        self._goal = PlanarPose(0.0, 0.0, 0.0)
        self._begin()

    def start(self, goal: PlanarPose) -> None:
        self._goal = goal
        self._begin()
        self._nav2.send(goal)

    def step(self, inputs: NavInputs, dt: float) -> NavStep:
        pose = inputs.pose
        check_finite("the pose", np.array([pose.x, pose.y, pose.yaw]))
        left = pose.to(self._goal)
        if self._arrived:
            return self._rest.step(inputs, dt) if self.config.near > 0.0 else NavStep(ZERO, not inputs.moving, left)
        reply = self._nav2.reply()
        state = "absent" if reply is None else reply.state
        if state in FAILED:
            return NavStep.failed(FAILED[state], left)
        if state == "absent":
            self._waited += dt
            if self._waited > self.config.patience:
                return NavStep.failed(
                    "Nobody offers Nav2's action /navigate_to_pose on this domain: start Nav2, and run the stack live, "
                    "with golem launch or golem up.",
                    left,
                )
            return NavStep(ZERO, False, left, None, None, "wait for nav2")
        if state == "succeeded":
            distance = math.hypot(left.x, left.y)
            if distance > self.config.near > 0.0:
                return NavStep.failed(f"Nav2 says that it has arrived, {distance:.2f} m from the goal.", left)
            self._arrived = True
            self._rest.start(self._goal)
            return NavStep(ZERO, False, left, None, None, "approach")
        twist = self._nav2.twist()
        self._age = 0.0 if twist is not None else self._age + dt
        self._twist = self._bounded(twist) if twist is not None else self._twist
        moving = self._age <= self.config.timeout
        return NavStep(self._twist if moving else ZERO, False, left, None, None, "nav2")

    def _begin(self) -> None:
        self._waited = self._age = 0.0
        self._twist = ZERO
        self._arrived = False

    def _bounded(self, twist: Twist) -> Twist:
        """Return a twist within the bounds; of one that is not finite nothing is left."""
        values = (twist.vx, twist.vy, twist.wz)
        if not all(map(math.isfinite, values)):
            return ZERO
        return Twist(*(min(max(v, -b), b) for v, b in zip(values, self.config.speed, strict=True)))
