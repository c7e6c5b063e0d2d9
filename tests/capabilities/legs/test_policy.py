from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.capabilities.legs.floor_plant import STEP, FloorPlant
from tests.capabilities.legs.test_network import write_onnx

from golem.capabilities.legs.almi import NETWORKS, STAND, WALK, Almi, AlmiConfig, Ground
from golem.capabilities.legs.base import STANDING, LocomotionCommand, LowerBody
from golem.capabilities.legs.description import SHIPPED
from golem.capabilities.legs.gait import swing_offset
from golem.capabilities.legs.locomotion import Locomotion
from golem.capabilities.legs.policy import BadAction, Policy, PolicyConfig
from golem.errors import ConfigError
from golem.registry import configure
from golem.types import NUM_JOINTS, UPPER, BaseEstimate, Imu, LowState, Twist

PEERS = Path(__file__).resolve().parents[4] / "shared" / "h12" / "peers"
BASE = BaseEstimate(0.0, np.eye(4))
TEXT = """
network: net.onnx
posture: [0, -0.4, 0, 0.8, -0.4, 0]
kp: 100
kd: 2
latency: 0.004
action: {scale: [1, 1, 1, 2, 1, 1], clip: 0.5, swing: 0.3}
gait: {period: 0.7, stance: 0.6}
envelope: {vx: [-0.3, 0.6]}
observation:
  - {term: last_action}
  - {term: twist, scale: 100}
"""


def state(q: float = 0.0) -> LowState:
    zero = np.zeros(NUM_JOINTS)
    imu = Imu(np.array([1.0, 0, 0, 0]), np.zeros(3), np.array([0, 0, 9.81]))
    return LowState(0.0, np.full(NUM_JOINTS, q), zero, zero, imu)


def policy(folder: Path) -> Policy:
    (folder / "policy.yaml").write_text(TEXT, encoding="utf-8")
    write_onnx(folder / "net.onnx", 15, 12)
    return Policy(PolicyConfig(str(folder / "policy.yaml")))


def walking(vx: float, phase: tuple[float, float] = (0.3, 0.8)) -> LocomotionCommand:
    return LocomotionCommand(Twist(vx), np.array(phase), True, True)


def test_targets_are_posture_and_scaled_action_and_swing(tmp_path: Path) -> None:
    legs = policy(tmp_path)
    assert isinstance(legs, LowerBody)
    assert (legs.rate, legs.latency, legs.envelope.vx, legs.gait.period) == (50.0, 0.004, (-0.3, 0.6), 0.7)
    legs.reset(state())
    command = legs.step(state(), BASE, walking(0.1), 0.02)
    # The network returns 0.01 times the sum of what it sees: at first the scaled twist, 10.
    action = np.full(12, 0.1)
    scale = np.tile([1, 1, 1, 2, 1, 1], 2)
    q0 = np.tile([0, -0.4, 0, 0.8, -0.4, 0], 2)
    swing = swing_offset(np.array([0.3, 0.8]), 0.7, 0.6, 0.3, np.full(12, 0.02))
    np.testing.assert_allclose(command.q, q0 + scale * action + swing, rtol=1e-6)
    np.testing.assert_array_equal(command.tau, np.zeros(12))
    np.testing.assert_array_equal(command.kp, 100.0)
    np.testing.assert_array_equal(command.kd, 2.0)
    # Then its last action as well: 0.01 (10 + 12 * 0.1).
    again = legs.step(state(), BASE, walking(0.1), 0.02)
    np.testing.assert_allclose(again.q - command.q, scale * 0.012, rtol=1e-5)
    legs.reset(state())
    np.testing.assert_array_equal(legs.step(state(), BASE, walking(0.1), 0.02).q, command.q)


def test_actions_are_clipped_and_seen_clipped(tmp_path: Path) -> None:
    legs = policy(tmp_path)
    q0 = legs.step(state(), BASE, STANDING, 0.02).q
    command = legs.step(state(), BASE, walking(5.0, (0.0, 0.5)), 0.02)
    np.testing.assert_allclose(command.q - q0, 0.5 * np.tile([1, 1, 1, 2, 1, 1], 2))
    after = legs.step(state(), BASE, STANDING, 0.02)
    np.testing.assert_allclose(after.q - q0, 0.06 * np.tile([1, 1, 1, 2, 1, 1], 2), rtol=1e-5)


def test_an_action_that_is_no_number_is_refused_and_says_what_was_shown(tmp_path: Path) -> None:
    legs = policy(tmp_path)
    legs.step(state(), BASE, walking(0.1), 0.02)
    with pytest.raises(BadAction, match=r"not finite; .*twist.*vx"):
        legs.step(state(), BASE, walking(float("nan")), 0.02)


def test_wrong_files_are_named(tmp_path: Path) -> None:
    policy(tmp_path)
    write_onnx(tmp_path / "net.onnx", 14, 12)
    with pytest.raises(ConfigError, match="the 15 values of the described observation: 14"):
        Policy(PolicyConfig(str(tmp_path / "policy.yaml")))
    with pytest.raises(ConfigError, match=r"no network .*other\.onnx"):
        Policy(PolicyConfig(str(tmp_path / "policy.yaml"), str(tmp_path / "other.onnx")))
    with pytest.raises(ConfigError, match="almi_open"):
        Policy(PolicyConfig(str(tmp_path / "none.yaml")))


def test_almi_without_weights_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("golem.capabilities.legs.almi.SHIPPED", tmp_path)
    with pytest.raises(ConfigError, match="no trained legs"):
        Almi()


@pytest.mark.parametrize("ground", NETWORKS)
def test_almi_stands_with_one_shipped_policy_and_walks_with_another(ground: Ground) -> None:
    legs = Almi(AlmiConfig(ground))
    assert isinstance(legs, LowerBody)
    legs.reset(state())
    walker = str(SHIPPED / NETWORKS[ground])
    for motion, name, network in ((STANDING, STAND, None), (walking(0.3), WALK, walker)):
        for _ in range(60):  # the other one takes over after a while
            q = legs.step(state(), BASE, motion, 0.02).q
        alone = Policy(PolicyConfig(name, network))
        alone.reset(state())
        for _ in range(60):
            expected = alone.step(state(), BASE, motion, 0.02).q
        np.testing.assert_allclose(q, expected, atol=1e-3)


def test_networks_that_are_absent_are_named() -> None:
    with pytest.raises(ConfigError, match="no network"):
        Almi(AlmiConfig(stand="absent.onnx"))
    with pytest.raises(ConfigError, match="'icy'; valid: even, rough"):
        configure("lower_body", "almi", {"ground": "icy"})


def peer(name: str, network: str) -> Policy:
    path = PEERS / network
    if not path.is_file():
        pytest.skip(f"the checkpoint {network} is absent")
    pytest.importorskip("torch")
    return Policy(PolicyConfig(name, str(path)))


@pytest.mark.parametrize(
    ("name", "network", "stance", "still"),
    [
        ("almi_open", "almi_open/policy_lstm_12800.pt", "crouch", True),
        ("unitree_rl_gym", "unitree_rl_gym/motion.pt", "stand", False),
    ],
)
def test_the_public_checkpoints_stand(name: str, network: str, stance: str, still: bool) -> None:
    legs = peer(name, network)
    plant = FloorPlant(stance=stance, velocity_noise=0.0)
    plant.q[UPPER] = legs.description.q0()[UPPER]
    plant.place()
    locomotion = Locomotion(legs)
    locomotion.reset(plant.sense()[0])
    track, stepping = [], set()
    for k in range(round(4.0 / STEP)):
        if k % 10 == 0:
            command = locomotion.step(*plant.sense(), None, 10 * STEP)
            stepping.add(bool(locomotion.gait.stepping))
        plant.advance(command)
        track.append(plant.data.qpos[:2].copy())
    assert not plant.fallen
    # ALMI's stands still; Unitree's never stops stepping, and wanders.
    assert stepping == {not still}
    wandered = np.ptp(np.array(track)[500:], axis=0).max()
    assert wandered < 0.03 if still else 0.03 < wandered < 0.5
