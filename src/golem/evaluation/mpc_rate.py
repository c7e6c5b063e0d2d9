"""How much a plan of the sampling MPC costs: the paper plans a second ahead 67 times a second, on 12 threads."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from golem.capabilities.legs.hold import STANCES
from golem.capabilities.legs.mpc.controller import MPC, MPCConfig
from golem.runtime.assembly import start_posture
from golem.types import LEGS, NUM_JOINTS, BaseEstimate, Imu, LowState

PAPER_RATE = 67.0
"""Plans per second of the paper's MJPC [Hz], horizon 1 s."""


def plan_seconds(samples: int, plans: int = 10) -> list[float]:
    """Return the CPU time of each of `plans` plans with `samples` rollouts of the default horizon on one thread [s].

    The robot crouches, both feet on the floor: what an MPC that stands well spends its time on.
    """
    config = MPCConfig()
    legs = MPC(replace(config, planner=replace(config.planner, samples=samples), threads=0))
    q = start_posture()
    q[LEGS] = np.tile(STANCES[config.stance], 2)
    still = np.zeros(NUM_JOINTS)
    imu = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))
    state, base = LowState(0.0, q, still, still, imu), BaseEstimate(0.0, np.eye(4))
    legs.reset(state)
    legs.plan(state, base)  # the first one also allocates
    spent: list[float] = []
    for _ in range(plans):
        start = time.process_time()
        legs.plan(state, base)
        spent.append(time.process_time() - start)
    return spent
