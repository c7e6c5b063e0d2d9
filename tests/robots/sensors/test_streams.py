import numpy as np
import pytest

from golem.robots.sensors.streams import stream


def test_same_seed_and_name_repeat_and_any_other_differs() -> None:
    draws = [stream(s, n).random(4) for s, n in [(3, "a"), (3, "a"), (4, "a"), (3, "b"), (31, "a")]]
    np.testing.assert_array_equal(draws[0], draws[1])
    assert len({d.tobytes() for d in draws}) == 4


def test_draws_are_the_same_on_every_machine() -> None:
    np.testing.assert_array_equal(stream(7, "camera/head").integers(0, 1000, 4), [963, 794, 3, 388])


def test_drawing_from_one_stream_leaves_another_alone() -> None:
    untouched = stream(0, "imu").random()
    a, b = stream(0, "depth"), stream(0, "imu")
    a.random(1000)
    assert b.random() == untouched


def test_negative_seed_is_refused() -> None:
    with pytest.raises(ValueError, match="0 or more"):
        stream(-1, "a")
