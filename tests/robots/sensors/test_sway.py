import numpy as np
import pytest

from golem.robots.sensors.profiles import draw_sway
from golem.robots.sensors.streams import stream


@pytest.mark.parametrize("seed", range(5))
def test_radial_rms_is_what_was_asked(seed: int) -> None:
    sway = draw_sway(0.0046, stream(seed, "sway"))
    xy = np.array([sway.offset(t) for t in np.arange(0, 600, 0.1)])
    assert np.sqrt((xy**2).sum(axis=1).mean()) == pytest.approx(0.0046, rel=0.05)


def test_it_is_slow() -> None:
    sway = draw_sway(0.0046, stream(0, "sway"))
    xy = np.array([sway.offset(t) for t in np.arange(0, 60, 0.01)])
    speed = np.linalg.norm(np.diff(xy, axis=0), axis=1) / 0.01
    assert speed.max() < 2 * np.pi * 0.8 * 0.0046 * 3


def test_none_stays_put() -> None:
    np.testing.assert_array_equal(draw_sway(0.0, stream(0, "sway")).offset(12.3), [0, 0])
