"""What a robot meets on a tour: waypoints, punches, restless arms, and the operator who steers it.

The task is that of the public league rhoyn/teleop-walking-benchmark (README.md and main.cpp), which is for the G1; its
figures are quoted below. What differs for this robot is marked `own`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from golem.capabilities.arms.base import ARM_COLUMNS
from golem.capabilities.arms.postures import POSTURES, mirror
from golem.capabilities.arms.trajectory import gate_limits
from golem.interfaces import topics
from golem.interfaces.payloads import JointTrajectory
from golem.robots.model.kinematics import Kinematics
from golem.robots.model.table import JOINTS
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.types import NUM_JOINTS, UPPER, Array, PlanarPose, Twist

SEGMENT = 5.0
"""Time for one waypoint [s]."""
CENTRE, RADIUS = 0.3, 0.75
"""The waypoints' disc: its centre ahead of where the tour begins, and its radius [m]."""
GAIN = 1.5
"""Speed per distance, and yaw rate per heading error [1/s]."""
ARRIVED, LEFT = (0.10, 0.05), (0.20, 0.12)
"""Distance [m] and heading error [rad] from which the operator lets the robot rest, and steers it again."""
G1_MASS = 35.1
"""Mass of the league's robot [kg]: the sum over its model, assets/g1_29dof.xml."""
PUNCH = 500.0
"""Largest force on a robot of that mass [N]; each punch draws from half of its ceiling to all of it."""
FIRST, RAMP = 1.0 / 3.0, 60.0
"""Share of the largest force that is the ceiling at the start, and time until it is all of it [s]."""
DELAY, LASTS = 0.1, 0.08
"""When in its segment a punch begins, and how long it lasts [s]."""
ARM_PERIOD, ARM_STEP, ARM_STEPS = 0.5, 0.06, 25
"""Time between two places of the arms [s], and the random steps of up to so many rad that lead to the next."""
ARM_DRAWS = 8
"""How often the next place is drawn before the arms rest for a period."""
ARM_ROOM = 0.5
"""How far each joint goes from the posture `home` [rad] [own: the league's arms have their whole range, but neither a
gate nor, in PhysX, each other to run into]."""
HAND_BOX = ((0.10, 0.15, -0.2), (0.80, 0.80, 0.60))
"""Where the left hand stays in base_link [m]: ahead, on its side, below the head [own: the league has the first and the
last, by its robot's hands]."""


@dataclass(frozen=True, slots=True)
class Punch:
    """A force of `LASTS` seconds at a joint.

    Attributes:
        link: the joint's child; the force acts at its origin, which is on the joint.
        force: (3,) in the world [N].
    """

    link: str
    force: Array


def draw_waypoints(rng: np.random.Generator, count: int) -> list[PlanarPose]:
    """Return waypoints in the frame in which the tour begins: evenly over the disc, with any heading."""
    polar = [(RADIUS * math.sqrt(rng.uniform()), *rng.uniform(-math.pi, math.pi, 2)) for _ in range(count)]
    return [PlanarPose(CENTRE + r * math.cos(bearing), r * math.sin(bearing), yaw) for r, bearing, yaw in polar]


def draw_punches(rng: np.random.Generator, count: int, mass: float) -> list[Punch]:
    """Return a punch per segment for a robot of `mass` [kg]: any joint, any direction, ever harder."""
    punches: list[Punch] = []
    for k in range(count):
        joint, direction = JOINTS[rng.integers(len(JOINTS))], rng.normal(size=3)
        ceiling = PUNCH * mass / G1_MASS * (FIRST + (1.0 - FIRST) * min(k * SEGMENT / RAMP, 1.0))
        punches.append(Punch(joint.child, ceiling * rng.uniform(0.5, 1.0) * direction / np.linalg.norm(direction)))
    return punches


def draw_arms(rng: np.random.Generator, seconds: float) -> tuple[Array, Array]:
    """Return times (n,) [s] and joints (n, 15) [rad] of arms that move at random; the right one mirrors the left."""
    home, kinematics, q = POSTURES["home"], Kinematics(), np.zeros(NUM_JOINTS)
    low, high = (np.clip(home + way * ARM_ROOM, *gate_limits()[:2])[ARM_COLUMNS["left"]] for way in (-1.0, 1.0))
    arm = home[ARM_COLUMNS["left"]]
    times, places = ARM_PERIOD * np.arange(1, 1 + math.ceil(seconds / ARM_PERIOD)), list[Array]()
    for _ in times:
        for _ in range(ARM_DRAWS):
            drawn, upper = arm, home.copy()
            for step in rng.uniform(-ARM_STEP, ARM_STEP, (ARM_STEPS, len(arm))):
                drawn = np.clip(drawn + step, low, high)
            upper[ARM_COLUMNS["left"]] = drawn
            upper[ARM_COLUMNS["right"]] = mirror(upper)[ARM_COLUMNS["right"]]
            q[UPPER] = upper
            kinematics.update(q)
            hand = kinematics.pose("left_gripper")[:3, 3]
            if np.all(hand >= HAND_BOX[0]) and np.all(hand <= HAND_BOX[1]):
                arm = drawn
                break
        place = home.copy()
        place[ARM_COLUMNS["left"]] = arm
        place[ARM_COLUMNS["right"]] = mirror(place)[ARM_COLUMNS["right"]]
        places.append(place)
    return times, np.array(places)


class Operator:
    """Steers a robot to a waypoint from where it really is, as the league's harness does: no module sees that place.

    It asks for a velocity in proportion to distance and heading error; the lower body's envelope cuts it. Within
    `ARRIVED` it asks for nothing until the robot is off by more than `LEFT`; place and heading each by itself.
    """

    def __init__(self, goal: PlanarPose) -> None:
        """Steer to `goal`."""
        self._goal, self._rests = goal, [False, False]
        self.errors = (math.inf, math.inf)

    def steer(self, place: PlanarPose) -> Twist:
        """Return what to ask of a robot at `place`, which is given in the frame of the goal."""
        left = place.to(self._goal)
        self.errors = math.hypot(left.x, left.y), abs(left.yaw)
        for i, error in enumerate(self.errors):
            self._rests[i] = error <= LEFT[i] if self._rests[i] else error < ARRIVED[i]
        go, turn = (0.0 if rests else GAIN for rests in self._rests)
        return Twist(go * left.x, go * left.y, turn * left.yaw)


class TourMotion:
    """A routine that sends the arms along `draw_arms` and asks for `twist` until it is cancelled."""

    def __init__(self, arms: tuple[Array, Array]) -> None:
        """Move the arms so."""
        self._arms, self.twist = arms, Twist()

    async def run(self, context: Context, goal: None) -> SkillResult:
        """Move until cancelled."""
        context.publish(topics.ARM_TRAJECTORY, JointTrajectory(context.t, *self._arms))
        while True:
            context.publish(topics.TWIST, self.twist)
            await context.tick()
