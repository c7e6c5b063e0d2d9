"""What a robot meets on a tour: waypoints, punches, restless arms, and the operator who steers it.

The task is that of the public league rhoyn/teleop-walking-benchmark, which is for the G1; see docs/reference/tour.md.
"""

from __future__ import annotations

import math

import numpy as np

from golem.capabilities.arms.base import ARM_COLUMNS
from golem.capabilities.arms.postures import POSTURES, mirror
from golem.capabilities.arms.trajectory import gate_limits
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.model.table import JOINTS
from golem.types import NUM_JOINTS, UPPER, Array, PlanarPose, Twist

CENTRE, RADIUS = 0.3, 0.75
"""The waypoints' disc: its centre ahead of where the tour begins, and its radius [m]."""
GAIN = 1.5
"""Speed per distance, and yaw rate per heading error [1/s]."""
ARRIVED, LEFT = (0.10, 0.05), (0.20, 0.12)
"""Distance [m] and heading error [rad] from which the operator lets the robot rest, and steers it again."""
PUNCH, FIRST, RAMP = 500.0 / 35.1, 1.0 / 3.0, 12
"""Largest force by the mass of the robot [N/kg], the league's and the sum over its assets/g1_29dof.xml; the share of it
that is the ceiling at the start, and after how many punches, a minute's, it is all."""
DELAY, LASTS = 0.1, 0.08
"""When after its waypoint is named a punch begins, and how long it lasts [s]."""
ARM_PERIOD, ARM_STEP, ARM_STEPS, ARM_DRAWS = 0.5, 0.06, 25, 8
"""Time between two places of the arms [s]; steps [rad] to the next, how many; how often it is drawn at most."""
ARM_ROOM = 0.5
"""How far each joint goes from the posture `home` [rad] [own: the league's have their range, but no gate]."""
HAND_BOX = ((0.10, 0.15, -0.2), (0.80, 0.80, 0.60))
"""Where the left hand stays in base_link [m]: ahead and below the head, as in the league, and on its side [own]."""


def draw_waypoints(rng: np.random.Generator, count: int) -> list[PlanarPose]:
    """Return waypoints in the frame in which the tour begins: evenly over the disc, with any heading."""
    polar = [(RADIUS * math.sqrt(rng.uniform()), *rng.uniform(-math.pi, math.pi, 2)) for _ in range(count)]
    return [PlanarPose(CENTRE + r * math.cos(bearing), r * math.sin(bearing), yaw) for r, bearing, yaw in polar]


def draw_punches(rng: np.random.Generator, count: int, mass: float) -> list[tuple[str, Array]]:
    """Return a punch per waypoint for a robot of `mass` [kg]: any joint, any direction, ever harder.

    Each is a link, at whose origin it acts: the child of a joint, which is there; and the (3,) force in the world [N].
    """
    punches: list[tuple[str, Array]] = []
    for k in range(count):
        joint, direction = JOINTS[rng.integers(len(JOINTS))], rng.normal(size=3)
        ceiling = PUNCH * mass * (FIRST + (1.0 - FIRST) * min(k / RAMP, 1.0))
        punches.append((joint.child, ceiling * rng.uniform(0.5, 1.0) * direction / np.linalg.norm(direction)))
    return punches


def draw_arms(rng: np.random.Generator, seconds: float) -> tuple[Array, Array]:
    """Return times (n,) [s] and joints (n, 15) [rad] of arms that move at random; the right one mirrors the left."""
    home, kinematics, q = POSTURES["home"], Kinematics(), np.zeros(NUM_JOINTS)
    left, right = ARM_COLUMNS["left"], ARM_COLUMNS["right"]
    low, high = (np.clip(home + way * ARM_ROOM, *gate_limits()[:2])[left] for way in (-1.0, 1.0))
    places, place, count = list[Array](), home, math.ceil(seconds / ARM_PERIOD)
    for _ in range(count):
        for _ in range(ARM_DRAWS):
            drawn = place.copy()
            for step in rng.uniform(-ARM_STEP, ARM_STEP, (ARM_STEPS, len(low))):
                drawn[left] = np.clip(drawn[left] + step, low, high)
            drawn[right] = mirror(drawn)[right]
            q[UPPER] = drawn
            kinematics.update(q)
            hand = kinematics.pose("left_gripper")[:3, 3]
            if np.all(hand >= HAND_BOX[0]) and np.all(hand <= HAND_BOX[1]):
                place = drawn
                break
        places.append(place)
    return np.linspace(ARM_PERIOD, count * ARM_PERIOD, count), np.array(places)


class Operator:
    """Steers a robot to a waypoint from where it really is, as the league's harness does: no module sees that place.

    It asks for a velocity in proportion to distance and heading error; the lower body's envelope cuts it. Within
    `ARRIVED` it asks for nothing until the robot is off by more than `LEFT`; place and heading each by itself.
    """

    def __init__(self, goal: PlanarPose) -> None:
        self._goal, self._rests = goal, [False, False]

    def steer(self, place: PlanarPose) -> Twist:
        """Return what to ask of a robot at `place`, given in the frame of the goal."""
        left = place.to(self._goal)
        for i, error in enumerate(errors(left)):
            self._rests[i] = error <= LEFT[i] if self._rests[i] else error < ARRIVED[i]
        go, turn = (0.0 if rests else GAIN for rests in self._rests)
        return Twist(go * left.x, go * left.y, turn * left.yaw)


def errors(left: PlanarPose) -> tuple[float, float]:
    """Return distance [m] and heading error [rad] of a robot that has `left` to go."""
    return math.hypot(left.x, left.y), abs(left.yaw)
