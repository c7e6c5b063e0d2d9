from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.capabilities.legs.floor_plant import STEP, FloorPlant

from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.legs.hold import STANCES, HoldConfig
from golem.capabilities.legs.mpc.planning_model import PlanningModel, Trajectories
from golem.interfaces.payloads import LegCommand
from golem.types import LEGS, UPPER, BaseEstimate, LowState

POSTURE = np.tile(STANCES["crouch"], 2)
KP, KD = np.tile(HoldConfig().kp, 2), np.tile(HoldConfig().kd, 2)


def model(timestep: float = 0.02) -> PlanningModel:
    return PlanningModel(POSTURE, KP, KD, timestep, threads=0)


def still(planning: PlanningModel, state: LowState, base: BaseEstimate, steps: int = 1) -> Trajectories:
    planning.measure(state, base)
    return planning.rollout(np.tile(POSTURE, (1, steps, 1)))


@pytest.mark.parametrize("arms", POSTURES)
def test_mass_sits_where_the_whole_robot_has_it(arms: str) -> None:
    plant = FloorPlant(velocity_noise=0.0)
    plant.q[UPPER] = POSTURES[arms]
    plant.q[UPPER.start] = 0.4  # the waist turned
    plant.place()
    planning = model()
    com = still(planning, *plant.sense()).com[0, 0]
    np.testing.assert_allclose(com, plant.com, atol=2e-3)  # the plant's fingers are open by another angle
    assert planning.stance.com_height == pytest.approx(plant.com[2], abs=2e-3)


def test_stance_torques_carry_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    # With them the crouch leans on the motors' springs only for what sways: it sinks by millimetres at first.
    plant = FloorPlant(velocity_noise=0.0)

    def sunk() -> float:
        height = still(model(0.005), *plant.sense(), steps=40).com[0, :, 2]
        return float(height[0] - height[-1])

    assert abs(sunk()) < 0.003
    balance = PlanningModel._balance  # pyright: ignore[reportPrivateUsage]
    monkeypatch.setattr(PlanningModel, "_balance", lambda model: replace(balance(model), tau=np.zeros(12)))
    assert sunk() > 0.006


def test_predicts_the_plant_over_a_fifth_of_a_second() -> None:
    plant = FloorPlant(velocity_noise=0.0)
    planning = model()
    targets = POSTURE + np.tile([0.0, 0.15, 0.05, -0.1, 0.1, 0.0], 2)
    planning.measure(*plant.sense())
    runs = planning.rollout(np.tile(targets, (2, 11, 1)))
    np.testing.assert_array_equal(runs.com[0], runs.com[1])
    before = plant.com
    for _ in range(round(0.2 / STEP)):
        plant.advance(LegCommand(targets, KP, KD, planning.stance.tau))
    moved = plant.com - before
    assert np.linalg.norm(moved) > 0.015
    assert np.linalg.norm(runs.com[0, 10] - runs.com[0, 0] - moved) < 0.35 * np.linalg.norm(moved)


def test_heading_does_not_matter() -> None:
    plant = FloorPlant(velocity_noise=0.0)
    state, base = plant.sense()
    planning = model()
    c, s = np.cos(2.0), np.sin(2.0)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    ahead = np.array([0.3, 0.1, 0.0])
    straight = still(planning, state, BaseEstimate(0.0, np.eye(4), ahead), 10)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turn, (4.0, -2.0, 0.7)
    turned = still(planning, state, BaseEstimate(0.0, T, turn @ ahead), 10)
    np.testing.assert_allclose(turned.com, straight.com, atol=1e-9)
    assert straight.com_velocity[0, 0, 0] == pytest.approx(0.3, abs=0.01)


def test_torques_stay_within_the_gates_bound() -> None:
    plant = FloorPlant()
    planning = model()
    planning.measure(*plant.sense())
    runs = planning.rollout(np.tile(planning.upper, (1, 20, 1)))
    assert (np.abs(runs.torque) <= planning.torque + 1e-9).all()
    assert np.isclose(np.abs(runs.torque), planning.torque).any()
    assert plant.q[LEGS].shape == planning.lower.shape
