"""What a simulated robot is like is found from its motion; a motion that does not tell is refused by name."""

from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.identification.sweep import MIDDLE, swing
from golem.evaluation.identification import regressor as r
from golem.evaluation.identification.fit import find_delay, identify
from golem.evaluation.identification.identify_command import simulate
from golem.evaluation.identification.recording import IdentificationError, RecordedMotion
from golem.hardware.servo.gains import default_gains
from golem.robots.model.imu_mount import TORSO
from golem.robots.model.table import load_limits
from golem.types import TICK, Array


def commanded(seconds: float) -> RecordedMotion:
    """Return the commands of a sweep, and the readings of a pelvis at rest."""
    n, gains = int(seconds / TICK), default_gains()
    rows = np.zeros((n, 5, 27))
    rows[:, 0] = [swing(k * TICK, MIDDLE) for k in range(n)]
    rows[:, 3], rows[:, 4] = gains.kp, gains.kd
    still = np.zeros((n, 3))
    return RecordedMotion(rows[:, 0], 0.0 * rows[:, 0], 0.0 * rows[:, 0], still, still + [0.0, 0.0, 9.81], rows)


def on_the_torso(motion: RecordedMotion) -> RecordedMotion:
    """Return `motion` with what the torso's IMU reads while the pelvis rests."""
    gyro, acc = np.zeros((2, len(motion.q), 3))
    gyro[:, 2] = motion.dq[:, TORSO]
    turn = np.gradient(gyro, TICK, axis=0)
    acc = [0.0, 0.0, 9.81] + np.cross(turn, r.IMU_AT) + np.cross(gyro, np.cross(gyro, r.IMU_AT))
    return motion._replace(gyro=gyro, acc=acc)


def hidden() -> Array:
    rng = np.random.default_rng(5)
    x = r.NOMINAL.copy()
    x[r.PAYLOAD] = 0.4, 1.3
    x[r.FRICTION] = rng.uniform(0.2, 0.9, 27)
    x[r.ZERO] = rng.uniform(-0.03, 0.03, 27)
    return x


def test_the_sweep_stays_inside_the_joints_ranges_and_below_3_rad_per_second() -> None:
    limits, start = load_limits(), np.zeros(27)
    q = np.array([swing(0.01 * k, start) for k in range(6000)])
    np.testing.assert_array_equal(q[0], start)
    middle, half = 0.5 * (limits.upper + limits.lower), 0.45 * (limits.upper - limits.lower)
    assert (np.abs(q - middle) < half).all()
    assert np.abs(np.diff(q, axis=0)).max() / 0.01 < 3.0


@pytest.mark.slow
def test_payload_friction_zeros_and_delay_are_found() -> None:
    x = hidden()
    motion = on_the_torso(simulate(x, 0.006, commanded(30.0)))
    found = identify(motion)
    assert found.delay == pytest.approx(0.006, abs=5e-4)
    np.testing.assert_allclose(found.x[r.PAYLOAD], x[r.PAYLOAD], atol=0.05)
    np.testing.assert_allclose(found.x[r.FRICTION], x[r.FRICTION], rtol=0.15)
    vertical = [0, 6, 12]  # hip yaws and waist: their zeros do nothing to a robot whose pelvis rests
    np.testing.assert_allclose(np.delete(found.x[r.ZERO] - x[r.ZERO], vertical), 0.0, atol=5e-3)
    assert {r.NAMES[r.ZERO][i] for i in vertical} <= found.unknown.keys()
    assert "armature of torso_joint" in found.unknown["mass of torso_link"]
    with pytest.raises(IdentificationError, match=r"left_hip_pitch_joint, .* not those of a robot that hangs free"):
        identify(motion._replace(acc=-motion.acc))


def test_a_joint_that_rests_is_refused_by_its_name() -> None:
    motion = commanded(30.0)
    still = motion._replace(q=motion.q.copy())
    still.q[:, 3] = 0.2
    with pytest.raises(IdentificationError, match=r"does not excite left_knee_joint: .*--motion"):
        identify(still)
    with pytest.raises(IdentificationError, match="does not excite all 27 joints"):
        identify(motion._replace(q=0.0 * motion.q))


def test_drives_that_report_no_torque_are_named() -> None:
    motion = commanded(2.0)
    told = motion._replace(tau=motion.q.copy())
    told.tau[:, 2] = 0.0
    with pytest.raises(IdentificationError, match="no torque of left_hip_roll_joint: "):
        find_delay(told)
