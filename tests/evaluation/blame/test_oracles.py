from __future__ import annotations

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.evaluation.blame.altered_twin import AlteredConfig, AlteredTwin, TrueBase, TrueOdometry
from golem.evaluation.blame.oracles import ORACLES, NotHere, with_modules
from golem.interfaces.lidar import LegOdometry
from golem.provenance import stack_facts
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.sensors.profiles import load_profile
from golem.runtime.lockstep import start_posture
from golem.slots import KEYS
from golem.stack import load_stack
from golem.types import LEGS


def test_every_oracle_makes_a_valid_stack_or_says_why_not() -> None:
    here: dict[str, set[str]] = {}
    for name in ("tether", "stand", "hall"):
        for oracle, one in ORACLES.items():
            assert set(one.choices) <= set(KEYS)
            stack = load_stack(name, profile="field").with_choice("grasp_method", "centroid")
            try:
                stack_facts(with_modules(stack, {"oracle": oracle}))
                here.setdefault(oracle, set()).add(name)
            except NotHere as why:
                assert oracle in str(why)
    assert here["legs"] == {"stand", "hall"} and here["sway"] == {"tether"} and here["odometry"] == {"hall"}
    assert all(
        here[name] == {"tether", "stand", "hall"} for name in ORACLES if name not in ("legs", "sway", "odometry")
    )


def test_what_is_there_already_is_not_exchanged() -> None:
    with pytest.raises(NotHere, match="head"):
        with_modules(load_stack("tether", profile="ideal"), {"oracle": "head"})
    with pytest.raises(NotHere, match="grasp"):
        with_modules(load_stack("tether"), {"oracle": "grasp"})  # it is visual_servo
    with pytest.raises(NotHere, match="arms"):
        with_modules(load_stack("tether", profile="field"), {"oracle": "arms+arms"})


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"oracle": "arm"}, "Did you mean 'arms'"),
        ({"oracle": "arms+"}, "oracle ''"),
        ({"robot": "replay", "oracle": "arms"}, "Only robot: mujoco"),
    ],
)
def test_what_is_no_oracle_is_refused(overrides: dict[str, str], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        with_modules(load_stack("tether", profile="field"), overrides)


def test_the_localizers_truth_is_an_oracle() -> None:
    stack = load_stack("tether")
    assert with_modules(stack, {"localizer": "truth"}) == with_modules(stack, {"oracle": "detections"})


def test_a_part_of_a_profile_becomes_ideal_and_the_others_stay() -> None:
    whole, part = load_profile("field"), load_profile("field:head+hoist_sway")
    assert part.head == load_profile("ideal").head and part.hoist_sway == 0.0
    assert (part.palm, part.arm_offset, part.name) == (whole.palm, whole.arm_offset, "field")
    for wrong in ("field:heads", "field:", "fields:head", "field:name"):
        with pytest.raises(ConfigError):
            load_profile(wrong)


def test_the_other_errors_of_an_episode_are_the_same_draws() -> None:
    whole, part = (MujocoRobot(name, 3, start_posture()) for name in ("field", "field:head"))
    np.testing.assert_array_equal(whole.true_joint_offset, part.true_joint_offset)
    np.testing.assert_array_equal(whole.calibration["left_hand"], part.calibration["left_hand"])
    np.testing.assert_allclose(part.calibration["head"], np.eye(4), atol=1e-12)
    assert np.abs(whole.calibration["head"] - np.eye(4)).max() > 0.01


def test_an_altered_twin_without_alterations_is_the_twin() -> None:
    plain, same = MujocoRobot("field", 0, start_posture()), AlteredTwin("field", 0, start_posture())
    assert plain.native(None) is not None and same.native(None) is not None
    np.testing.assert_array_equal(plain.joints()[0], same.joints()[0])
    np.testing.assert_array_equal(plain._model.geom_friction, same._model.geom_friction)
    weak = AlteredTwin("field", 0, start_posture(), AlteredConfig(leg_torque=0.5, grip=2.0))
    limit, half = (twin._memory["motors"]["limit"][0] for twin in (plain, weak))
    np.testing.assert_allclose(half[LEGS], 0.5 * limit[LEGS])
    np.testing.assert_array_equal(half[LEGS.stop :], limit[LEGS.stop :])
    with pytest.raises(ConfigError, match="factors"):
        AlteredConfig(grip=0.0)
    with pytest.raises(ConfigError, match="factors"):
        AlteredConfig(leg_torque=-1.0)


def test_a_held_pelvis_says_that_it_was_let_go_and_hangs_on() -> None:
    robot = AlteredTwin("ideal", 0, start_posture(True), AlteredConfig(support="ground", held=True))
    assert robot.on_gantry
    robot.release()
    assert not robot.on_gantry and not robot._hoist.released
    robot.release()
    assert robot._memory["hoist"]["weight"][0][2] > 100.0


def test_modules_of_truth_look_into_the_newest_twin() -> None:
    robot = AlteredTwin("field", 0, start_posture())
    odometry = TrueOdometry()
    legs = LegOdometry(0.1, np.full((4, 4), 9.0), np.zeros(3), 0.2, True, np.zeros(3))
    odometry.add_legs(legs)
    estimate = odometry.estimate()
    assert estimate is not None and np.allclose(estimate.T_odom_base, np.eye(4), atol=1e-9)
    base = TrueBase()
    assert np.allclose(base._truth.estimate(0.0).T_odom_base, np.eye(4), atol=1e-9)
    del robot, odometry, base, estimate
    AlteredTwin._newest = None
    with pytest.raises(ConfigError, match="--use oracle"):
        TrueBase()
