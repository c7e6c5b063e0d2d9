"""The tether rung: real trials judged on the truth, the culprit named, the same record whatever ran before."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.evaluation.base import TrialSpec
from golem.evaluation.episodes.episode import Loss, episode_seed
from golem.evaluation.episodes.oracle import GraspTruth, Oracle
from golem.evaluation.rungs import pick_screw as pick
from golem.evaluation.rungs.pick_screw import PAD_REACH, STRAIGHT, PickOptions, StandRung, TetherRung, blame
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.lockstep import build
from golem.stack import load_stack

LIMP = f"{Path(__file__).parents[1] / 'leg_methods.py'}:Limp"
BAD_MODULES = """
import numpy as np
from golem.interfaces.payloads import ArmCommand
from golem.capabilities.arms.diff_ik import DiffIK

class Raises(DiffIK):
    def step(self, *a):
        raise ValueError("my bug")

class Nan(DiffIK):
    def step(self, *a):
        command = super().step(*a)
        command.q[3] = np.nan
        return command

class Short(DiffIK):
    def step(self, *a):
        c = super().step(*a)
        return ArmCommand(c.q[:7], c.error_position, c.error_rotation, c.limited)
"""


def spec(method: str = "visual_servo", profile: str = "ideal", index: int = 0, **overrides: str) -> TrialSpec:
    return TrialSpec("tether", method, profile, 0, index, overrides)


@pytest.fixture(scope="module")
def rung() -> TetherRung:
    return TetherRung()


@pytest.mark.slow
@pytest.mark.parametrize("method", ["centroid", "visual_servo"])
def test_a_perfect_robot_puts_the_screw_in_the_tray(method: str, rung: TetherRung) -> None:
    outcome = rung.run(spec(method), None)
    assert outcome.success, outcome.detail
    assert 1.0 < outcome.timings["detect_to_grasp"] < 15.0
    assert outcome.series["grasp_miss"] < PAD_REACH
    assert outcome.picture is not None and outcome.picture.startswith(b"\x89PNG")


@pytest.mark.slow
def test_a_screw_of_the_real_pack_is_picked_at_its_real_height() -> None:
    outcome = TetherRung(PickOptions(world="ioniq5")).run(spec(), None)
    assert outcome.success, outcome.detail


def test_a_robot_whose_legs_carry_nothing_does_not_pick_in_its_band() -> None:
    outcome = StandRung().run(TrialSpec("stand", "visual_servo", "ideal", 0, 0, {"lower_body": LIMP}), None)
    assert (outcome.success, outcome.stage, outcome.module) == (False, "settle", f"lower_body: {LIMP}")


@pytest.mark.slow
def test_a_trial_depends_on_its_spec_alone(rung: TetherRung) -> None:
    first = rung.run(spec(profile="field"), None)
    rung.run(spec(profile="field", index=1), None)
    again = TetherRung().run(spec(profile="field"), None)
    assert first == again


@pytest.mark.parametrize(
    "name, reason", [("Raises", "my bug"), ("Nan", "NaN"), ("Short", "shape (7,)")], ids=["raises", "nan", "shape"]
)
def test_a_module_that_breaks_its_contract_is_named(name: str, reason: str, tmp_path: Path, rung: TetherRung) -> None:
    from golem.errors import ModuleFault

    file = tmp_path / "mine.py"
    file.write_text(BAD_MODULES)
    with pytest.raises(ModuleFault) as fault:
        rung.run(spec(upper_body=f"{file}:{name}"), None)
    assert fault.value.slot == "upper_body" and fault.value.use.endswith(name)
    assert reason in fault.value.reason


def test_the_configuration_changes_with_a_users_file(tmp_path: Path, rung: TetherRung) -> None:
    file = tmp_path / "mine.py"
    file.write_text(BAD_MODULES)
    before = rung.config("centroid", "field", {"upper_body": f"{file}:Nan"})
    file.write_text(BAD_MODULES + "\n# changed\n")
    after = rung.config("centroid", "field", {"upper_body": f"{file}:Nan"})
    assert before["user_files"] != after["user_files"]
    assert before["stack"] == after["stack"]


def test_an_unknown_slot_is_refused(rung: TetherRung) -> None:
    with pytest.raises(ConfigError, match="upper_body"):
        rung.config("centroid", "field", {"upperbody": "diff_ik"})


def truth(
    aim: float = 0.0,
    reach: float = 0.0,
    miss: float = 0.0,
    tilt: float = 0.0,
    calibration: float = 0.0,
    seen: float = 0.0,
    told: float | None = None,
    left: float | None = None,
) -> GraspTruth:
    """What happened; of an open loop, where a servo law says nothing else."""
    told, left = aim if told is None else told, reach if left is None else left
    return GraspTruth(aim, reach, miss, 0.004, tilt, told, left, calibration, seen)


@pytest.mark.parametrize(
    "stage, slot, seen, culprit",
    [
        ("detect", "localizer", None, "localizer"),
        ("servo", "upper_body", truth(aim=0.05), "upper_body"),
        ("grasp", "grasp_method", truth(aim=0.05, reach=0.01, miss=0.05), "localizer"),
        ("grasp", "grasp_method", truth(aim=0.05, miss=0.05, calibration=0.04, seen=0.01), "calibration"),
        ("grasp", "grasp_method", truth(aim=0.05, miss=0.05, calibration=0.01, seen=0.04), "localizer"),
        ("grasp", "grasp_method", truth(aim=0.01, reach=0.05, miss=0.05, calibration=0.05), "upper_body"),
        ("extract", "grasp_method", truth(tilt=2 * STRAIGHT), "upper_body"),
        ("extract", "grasp_method", truth(), "grasp_method"),
        ("place", "grasp_method", truth(), "grasp_method"),
        # A servo law's command is as far from hand and screw as the arm errs, which says nothing of the miss.
        ("grasp", "grasp_method", truth(aim=0.026, reach=0.025, miss=0.02, told=0.02, left=0.001), "localizer"),
        ("grasp", "grasp_method", truth(aim=0.026, reach=0.025, miss=0.02, told=0.001, left=0.02), "upper_body"),
        ("extract", "grasp_method", replace(truth(aim=0.5, miss=0.5), strayed=0.2), "grasp_method"),
    ],
)
def test_the_larger_error_takes_the_blame(stage: str, slot: str, seen: GraspTruth | None, culprit: str) -> None:
    assert blame(stage, slot, seen) == culprit


def test_a_screw_lost_on_the_way_to_the_tray_is_the_grips_and_one_let_go_beside_it_is_not() -> None:
    assert blame("place", "grasp_method", truth(), drop_inside=0.03) == "grasp_method"
    assert blame("place", "grasp_method", truth(), drop_inside=-0.01) == "localizer"


def test_the_calibration_of_the_head_camera_is_told_from_what_was_seen() -> None:
    for profile, least, most in (("field", 0.03, 0.2), ("ideal", 0.0, 1e-9)):
        _, robot = build(load_stack("tether", profile=profile), 3)
        oracle = Oracle(robot)
        screw = oracle.screw_heads()[0]
        shift = oracle.camera_shift("head", screw)
        assert least <= np.linalg.norm(shift) <= most
        # An open loop sends the hand to where the calibration has the screw: nothing else is wrong.
        T = oracle.gripper("right")
        T[:3, 3] = screw + shift
        found = oracle.grasp("right", T, "head")
        assert found.seen < 1e-9 and found.calibration == pytest.approx(found.aim, abs=1e-9)
        robot.close()


def test_a_robot_without_a_truth_to_judge_on_is_refused(rung: TetherRung, tmp_path: Path) -> None:
    mine = tmp_path / "mine.py"
    mine.write_text("class Robot:\n    pass\n")
    with pytest.raises(ConfigError, match=r"mine\.py:Robot is not the twin, 'mujoco'"):
        rung.config("centroid", "ideal", {"robot": f"{mine}:Robot"})


def test_a_file_in_the_home_folder_may_be_named_by_the_tilde(
    rung: TetherRung, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    text = "class Arms:\n    rate = latency = 0.0\n    def reset(self, q): ...\n"
    text += "    def step(self, left, right, q, dt): ...\n"
    (tmp_path / "mine.py").write_text(text)
    assert rung.config("centroid", "ideal", {"upper_body": "~/mine.py:Arms"})["user_files"].keys() == {"upper_body/use"}


@pytest.mark.parametrize("slot, use", [("grasp_method", "centroid"), ("robot", "mujoco")])
def test_what_the_rung_brings_is_not_replaced(slot: str, use: str) -> None:
    with pytest.raises(ConfigError, match=f"--use {slot}"):
        StandRung().config("visual_servo", "field", {slot: use})


@pytest.mark.slow
def test_a_robot_that_falls_after_its_errand_has_lost_it(monkeypatch: pytest.MonkeyPatch) -> None:
    loss = Loss("fall", "The robot fell at 9.0 s.")
    monkeypatch.setattr(pick, "lost", lambda running, recorder: loss)
    outcome = StandRung().run(TrialSpec("stand", "visual_servo", "ideal", 0, 0, {"localizer": "onnx"}), None)
    assert (outcome.success, outcome.stage, outcome.module) == (False, "fall", "lower_body: almi")
    assert "fell" in outcome.detail and "in the tray" in outcome.detail


def test_aim_reach_and_miss_are_measured_alike() -> None:
    running, robot = build(load_stack("tether", profile="ideal"), 0)
    oracle = Oracle(robot)
    try:
        T = oracle.gripper("right")
        high = T.copy()
        high[:3, 3] -= 0.05 * T[:3, 2]
        aside = T.copy()
        aside[:3, 3] += 0.05 * T[:3, 1]
        exact, above, beside = (oracle.grasp("right", sent, "head") for sent in (T, high, aside))
    finally:
        oracle.close()
        robot.close()
    assert exact.reach == pytest.approx(0.0, abs=1e-9) and exact.aim == pytest.approx(exact.miss)
    assert above.reach == pytest.approx(0.0, abs=1e-9) and above.aim == pytest.approx(above.miss)
    assert beside.reach == pytest.approx(0.05) and abs(beside.aim - beside.miss) <= 0.05 + 1e-9


def test_both_rungs_meet_the_same_screws_and_errors() -> None:
    found = []
    for name in ("tether", "stand"):
        robot = build(load_stack(name, profile="field"), episode_seed(0, 3))[1]
        assert isinstance(robot, MujocoRobot)
        heads = [robot.data.body(screw).xpos.copy() for screw in robot.scene.names.screws]
        model = robot.scene.model
        screws = [model.body(screw).id for screw in robot.scene.names.screws]
        friction = model.geom_friction[np.isin(model.geom_bodyid, screws)]
        tables = [robot.calibration[camera] for camera in sorted(robot.calibration)]
        # A robot on its feet is lower than one in its hoist, and so is its table.
        found.append((heads - np.array([0.0, 0.0, heads[0][2]]), np.array(tables), friction))
        robot.close()
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)
