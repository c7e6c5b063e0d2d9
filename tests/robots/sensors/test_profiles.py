import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from golem.errors import ConfigError
from golem.robots.model import pinocchio_model
from golem.robots.model.table import JOINT_INDEX
from golem.robots.sensors.cameras import CAMERAS
from golem.robots.sensors.profiles import GEARS, PROFILES, EpisodeErrors, load_profile, sample_episode
from golem.robots.sensors.streams import stream
from golem.robots.worlds.conditions import Conditions
from golem.types import LEGS, UPPER


def episodes(name: str, n: int = 300) -> list[EpisodeErrors]:
    return [sample_episode(load_profile(name), stream(seed, "episode")) for seed in range(n)]


def displacement(T: np.ndarray, ahead: float) -> float:
    point = np.array([0, 0, ahead, 1.0])
    return float(np.linalg.norm((T @ point - point)[:3]))


def test_unknown_profile_names_the_valid_ones() -> None:
    with pytest.raises(ConfigError, match=r"'feld'; valid: bench, field, ideal\. Did you mean 'field'"):
        load_profile("feld")


def test_every_profile_knows_its_name() -> None:
    assert {name: p.name for name, p in PROFILES.items()} == {n: n for n in ("ideal", "bench", "field")}


def test_ideal_has_no_errors() -> None:
    episode = episodes("ideal", 1)[0]
    for T in episode.T_nominal_actual.values():
        np.testing.assert_array_equal(T, np.eye(4))
    assert not episode.joint_offset.any()
    np.testing.assert_array_equal(episode.imu.tilt, [1, 0, 0, 0])
    assert not episode.imu.gyro.any()
    assert not episode.imu.acc.any()
    assert not episode.hoist_sway.offset(1.0).any()


def test_a_camera_is_not_quite_what_it_says_of_itself() -> None:
    assert all(v.tolist() == [1.0, 0.0, 0.0] for v in episodes("ideal", 1)[0].intrinsics.values())
    profile = load_profile("field")
    drawn = np.array([v for e in episodes("field") for v in e.intrinsics.values()])
    sigma = [profile.focal, profile.principal, profile.principal]
    np.testing.assert_allclose((drawn - [1.0, 0.0, 0.0]).std(axis=0), sigma, rtol=0.1)
    lens = CAMERAS["head"].with_lens(1.01, 2.0, -1.0)
    assert (lens.fx, lens.cx, lens.cy) == (
        1.01 * CAMERAS["head"].fx,
        CAMERAS["head"].cx + 2.0,
        CAMERAS["head"].cy - 1.0,
    )


def test_joints_rub_each_with_its_own_friction() -> None:
    assert np.isnan(episodes("ideal", 1)[0].friction).all()
    profile, drawn = load_profile("field"), np.array([e.friction for e in episodes("field", 50)])
    for part, span in ((drawn[:, LEGS], profile.leg_friction), (drawn[:, UPPER], profile.arm_friction)):
        assert span is not None and span[0] <= part.min() < part.max() <= span[1]
        assert np.ptp(part, axis=1).min() > 0.3 * (span[1] - span[0])


def test_field_head_camera_is_off_by_what_the_paper_reports() -> None:
    errors = [displacement(e.T_nominal_actual["head"], 1.0) for e in episodes("field")]
    assert min(errors) >= 0.05
    assert 0.052 < np.median(errors) < 0.058
    assert max(errors) < 0.10


@pytest.mark.parametrize(("name", "limit"), [("bench", 0.0015), ("field", 0.004)])
def test_palm_cameras_are_off_by_millimetres_and_independently(name: str, limit: float) -> None:
    runs = episodes(name)
    left = [displacement(e.T_nominal_actual["left_hand"], 0.1) for e in runs]
    right = [displacement(e.T_nominal_actual["right_hand"], 0.1) for e in runs]
    assert max(left + right) < limit
    assert abs(np.corrcoef(left, right)[0, 1]) < 0.2


@pytest.mark.parametrize("name", PROFILES)
def test_extrinsic_errors_are_rigid_motions(name: str) -> None:
    for T in episodes(name, 5)[3].T_nominal_actual.values():
        np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-12)
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1)
        np.testing.assert_array_equal(T[3], [0, 0, 0, 1])


@pytest.mark.parametrize("name", ["bench", "field"])
def test_joint_offsets_spread_as_told(name: str) -> None:
    offsets = np.array([e.joint_offset for e in episodes(name)])
    assert offsets[:, UPPER].std() == pytest.approx(load_profile(name).arm_offset, rel=0.05)
    assert offsets[:, LEGS].std() == pytest.approx(load_profile(name).leg_offset, rel=0.05)


def test_one_kind_of_error_does_not_shift_the_draws_of_another() -> None:
    field, bench = episodes("field", 1)[0], episodes("bench", 1)[0]
    ratio = load_profile("field").arm_offset / load_profile("bench").arm_offset
    np.testing.assert_allclose(field.joint_offset[UPPER], ratio * bench.joint_offset[UPPER])
    np.testing.assert_array_equal(field.hoist_sway.omega, bench.hoist_sway.omega)


def test_field_is_nowhere_better_than_bench() -> None:
    bench, field = load_profile("bench"), load_profile("field")
    for name in ("arm_offset", "leg_offset", "actuator_delay", "hoist_sway"):
        assert getattr(field, name) >= getattr(bench, name) > 0


@pytest.mark.parametrize(("name", "reach_error"), [("bench", 0.010), ("field", 0.034)])
def test_joint_offsets_put_the_hand_off_by_the_reported_reach_error(name: str, reach_error: float) -> None:
    model = pinocchio_model.build()
    data, hand, rng = model.createData(), model.getFrameId("left_gripper"), stream(0, "postures")
    sigma, errors = load_profile(name).arm_offset, []
    arm = slice(12, 20)
    while len(errors) < 1000:
        q = pin.neutral(model)
        q[arm] = rng.uniform(model.lowerPositionLimit[arm], model.upperPositionLimit[arm])
        q[12] = rng.uniform(-0.6, 0.6)
        pin.framesForwardKinematics(model, data, q)
        palm = data.oMf[hand].translation.copy()
        if not (np.array([0.25, -0.2, -0.3]) < palm).all() or not (palm < [0.75, 0.6, 0.3]).all():
            continue
        q[arm] += sigma * rng.standard_normal(8)
        pin.framesForwardKinematics(model, data, q)
        errors.append(np.linalg.norm(data.oMf[hand].translation - palm))
    assert np.mean(errors) == pytest.approx(reach_error, rel=0.06)


def test_a_file_says_what_one_robot_is_like(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(
        "base: field\nactuator_delay: 0.006\narm_offset: 0\nleg_offset: 0\narm_friction: null\n"
        "leg_friction: null\nzeros: {left_elbow_joint: 0.02}\n",
        encoding="utf-8",
    )
    profile = load_profile(str(file))
    assert (profile.name, profile.actuator_delay, profile.imu) == ("field", 0.006, load_profile("field").imu)
    for seed in (0, 1):
        episode = sample_episode(profile, stream(seed, "episode"))
        assert episode.joint_offset[JOINT_INDEX["left_elbow_joint"]] == 0.02
        assert np.count_nonzero(episode.joint_offset) == 1
        assert np.isnan(episode.friction).all()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("actuator_delay: 0.0", "has a key 'base', one of ideal, bench, field"),
        ("base: [1]\nactuator_delay: 0.0", "has a key 'base'"),
        ("base: field\nactuator_delay: .nan", "actuator_delay"),
        ("base: field\nactuator_delay: soon", "actuator_delay"),
        ("base: field\nzeros: {elbow: 0.1}", "'elbow'; valid: "),
        ("base: field\nzeros: {left_elbow_joint: 2.0}", "left_elbow_joint is a number from -0.5"),
        ("base: field\nzeros: {left_elbow_joint: [1]}", "left_elbow_joint is a number from -0.5"),
        ("base: field\nmotors: {torque_gains: {elbow: 0.1}}", "'elbow'; valid: "),
        ("base: field\nzeros: 3", "mappings by joint, not 3"),
        ("base: field\nbacklash: -0.01", "backlash is 0 or more, not -0.01"),
        ("base: field\narm_friction: [-1.0, 2.0]", "arm_friction's lower end is 0 or more, not -1"),
        ("base: field\nleg_friction: [3.0, 2.0]", "leg_friction's width is 0 or more, not -1"),
        ("base: field\nhead: {min_error: 5}", "'head'; valid: "),
    ],
)
def test_a_file_that_is_no_profile_is_refused(text: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=re.escape(words)):
        load_profile(str(file))
    with pytest.raises(ConfigError, match="cannot be read"):
        load_profile(str(tmp_path / "none.yaml"))


def test_conditions_scale_the_palm_the_arms_friction_and_the_backlash_of_a_profile() -> None:
    field = load_profile("field")
    assert field.under(Conditions()) == field
    other = field.under(Conditions(palm=2.0, arm_friction=0.5, backlash=2.0))
    assert other.palm.rotation == 2.0 * field.palm.rotation
    assert other.palm.translation == (0.002, 0.006)
    assert other.arm_friction == (0.05, 0.4)
    assert (field.backlash, other.backlash) == (0.0, 2.0 * GEARS)
    assert other.leg_friction == field.leg_friction
    ideal = load_profile("ideal")
    assert ideal.under(Conditions(palm=3.0, arm_friction=3.0)) == ideal
    assert ideal.backlash == 0.0
