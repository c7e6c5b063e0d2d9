"""Drive the twin from Python, without a stack: a PD law turns the torso by half a radian in a second."""

from __future__ import annotations

import numpy as np

from golem.robots.model.table import JOINT_NAMES
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.lockstep import start_posture
from golem.types import NUM_JOINTS, TICK, LowCommand

TORSO = JOINT_NAMES.index("torso_joint")


def main() -> None:
    q, zero = start_posture(), np.zeros(NUM_JOINTS)
    robot = MujocoRobot("ideal", seed=0, posture=q)
    kp, kd = np.full(NUM_JOINTS, 1000.0), np.full(NUM_JOINTS, 20.0)
    for i in range(round(1.0 / TICK)):
        wanted = q.copy()
        wanted[TORSO] += 0.25 * (1.0 - np.cos(np.pi * i * TICK))  # half a radian in a second [rad]
        robot.advance(LowCommand(i * TICK, wanted, zero, zero, kp, kd), {}, TICK)
    measured, _, tau = robot.joints()
    rgb, depth = robot.capture("head")
    robot.close()
    print(f"torso at {measured[TORSO] - q[TORSO]:.2f} rad from its start, {tau[TORSO]:.1f} N m")
    print(f"the head camera sees {rgb.shape[1]} x {rgb.shape[0]} pixels, nearest {depth[depth > 0.0].min():.2f} m")


if __name__ == "__main__":
    main()
