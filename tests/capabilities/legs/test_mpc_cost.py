"""The residuals of the sampling MPC: each is zero in the reference stance, and is 1 where its documentation says."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from golem.capabilities.legs.mpc.controller import CostConfig, cost
from golem.capabilities.legs.mpc.planning_model import Stance, Trajectories
from golem.robots.model.spatial import rotation_rpy
from golem.types import Array

BOUND = np.full(12, 100.0)
STANCE = Stance(np.zeros(12), com_height=0.9, feet=np.array([0.0, 0.2]), tau=np.zeros(12))
NOTHING = CostConfig(**{field.name: 0.0 for field in fields(CostConfig)})


def standing(**changes: Array) -> Trajectories:
    """One rollout of two steps in which the robot stands over the middle of its feet."""
    one = np.ones((1, 2, 1))
    still = Trajectories(
        com=one * [0.0, 0.0, 0.9],
        com_velocity=one * np.zeros(3),
        R=np.tile(np.eye(3), (1, 2, 1, 1)),
        rate=one * np.zeros(3),
        soles=np.tile([[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]], (1, 2, 1, 1)),
        torque=one * np.zeros(12),
        q=one * np.zeros(12),
    )
    return replace(still, **{name: getattr(still, name) + change for name, change in changes.items()})


def of(runs: Trajectories, **weights: float) -> float:
    return float(cost(replace(NOTHING, **weights), runs, STANCE, BOUND)[0])


def test_the_reference_stance_costs_nothing() -> None:
    assert cost(CostConfig(), standing(), STANCE, BOUND) == pytest.approx(0.0)


UNITS: dict[str, dict[str, Any]] = {
    "height": {"com": np.array([0.0, 0.0, -0.05])},
    "velocity": {"com_velocity": np.array([0.0, 0.2, 3.0])},  # vertical velocity is free
    "orientation": {"R": rotation_rpy(0.0, np.arcsin(0.1), 0.0) - np.eye(3)},
    "capture": {"com": np.array([0.03, 0.04, 0.0])},
    "feet": {"soles": np.array([[0.05, 0.0, 0.0], [0.0, 0.0, 0.0]])},
    "effort": {"torque": BOUND},
    "posture": {"q": np.full(12, -0.1)},
}


@pytest.mark.parametrize("name", UNITS)
def test_a_residual_of_one_costs_its_weight(name: str) -> None:
    runs = standing(**UNITS[name])
    assert of(runs, **{name: 2.0}) == pytest.approx(2.0)
    for other in {"height", "effort", "posture", "velocity"} - {name}:
        assert of(runs, **{other: 1.0}) == pytest.approx(0.0)


def test_turning_counts_half() -> None:
    assert of(standing(rate=np.array([0.0, 1.0, 0.0])), orientation=1.0) == pytest.approx(0.5)


def test_velocity_moves_the_capture_point() -> None:
    towards = standing(com=np.array([0.05, 0.0, 0.0]), com_velocity=np.array([-0.15, 0.0, 0.0]))
    away = standing(com=np.array([0.05, 0.0, 0.0]), com_velocity=np.array([0.15, 0.0, 0.0]))
    assert of(towards, capture=1.0) < 0.05 < 1.0 < of(away, capture=1.0)


def test_the_horizon_counts_evenly() -> None:
    late = np.zeros((1, 2, 3))
    late[0, 1, 2] = 0.05
    assert of(standing(com=late), height=1.0) == pytest.approx(0.5)
