import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from golem.robots.sensors.imu import ImuErrors, ImuModel
from golem.robots.sensors.streams import stream
from golem.types import Imu

ERRORS = ImuErrors(gyro_noise=0.004, acc_noise=0.03, gyro_bias=0.002, acc_bias=0.05, tilt=0.005, attitude_noise=0.0005)
QUAT = Rotation.from_euler("zyx", [1.0, 0.3, -0.2]).as_quat(scalar_first=True)
GYRO, ACC = np.array([0.1, -0.2, 0.3]), np.array([0.5, 0.2, 9.7])


def samples(errors: ImuErrors, n: int, seed: int = 0) -> list[Imu]:
    model = ImuModel(errors, errors.draw_bias(stream(seed, "bias")), stream(seed, "noise"))
    return [model.measure(QUAT, GYRO, ACC) for _ in range(n)]


def test_no_errors_report_the_truth() -> None:
    (sample,) = samples(ImuErrors(), 1)
    np.testing.assert_allclose(sample.quat, QUAT, atol=1e-15)
    np.testing.assert_array_equal(sample.gyro, GYRO)
    np.testing.assert_array_equal(sample.acc, ACC)


def test_noise_has_the_magnitude_and_the_bias_stays() -> None:
    run = samples(ERRORS, 4000)
    gyro, acc = np.array([s.gyro for s in run]), np.array([s.acc for s in run])
    np.testing.assert_allclose(gyro.std(axis=0), ERRORS.gyro_noise, rtol=0.05)
    np.testing.assert_allclose(acc.std(axis=0), ERRORS.acc_noise, rtol=0.05)
    bias = ERRORS.draw_bias(stream(0, "bias"))
    np.testing.assert_allclose(gyro.mean(axis=0) - GYRO, bias.gyro, atol=4 * ERRORS.gyro_noise / 60)
    np.testing.assert_allclose(acc.mean(axis=0) - ACC, bias.acc, atol=4 * ERRORS.acc_noise / 60)


def test_biases_of_many_episodes_spread_as_told() -> None:
    biases = [ERRORS.draw_bias(stream(seed, "bias")) for seed in range(500)]
    assert np.std([b.gyro for b in biases]) == pytest.approx(ERRORS.gyro_bias, rel=0.1)
    assert np.std([b.acc for b in biases]) == pytest.approx(ERRORS.acc_bias, rel=0.1)


def test_attitude_is_wrong_by_a_tilt_and_not_in_heading() -> None:
    run = samples(ERRORS, 400)
    reported = Rotation.from_quat([s.quat for s in run], scalar_first=True)
    error = (reported * Rotation.from_quat(QUAT, scalar_first=True).inv()).mean().as_rotvec()
    bias = 2 * ERRORS.draw_bias(stream(0, "bias")).tilt[1:]
    np.testing.assert_allclose(error, bias, atol=4 * ERRORS.attitude_noise / 20)
    assert bias[2] == 0


def test_orientation_stays_a_unit_quaternion() -> None:
    norms = [np.linalg.norm(s.quat) for s in samples(ERRORS, 100)]
    np.testing.assert_allclose(norms, 1, atol=1e-12)
