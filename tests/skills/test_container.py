"""What a hand's error at one object says of the container."""

from __future__ import annotations

import numpy as np
import pytest

from golem.skills.container import shift_of

ROW = np.array([[0.43, y, -0.03] for y in (-0.2, -0.1, 0.0)])


@pytest.mark.parametrize(
    ("off", "shift"),
    [
        ((0.03, 0.02, 0.01), (0.03, 0.02, 0.01)),
        ((0.03, -0.04, 0.01), (0.03, 0.0, 0.01)),
        ((-0.02, 0.045, 0.0), (-0.02, 0.0, 0.0)),
    ],
)
def test_only_what_cannot_be_a_neighbour_counts(off: tuple[float, ...], shift: tuple[float, ...]) -> None:
    np.testing.assert_allclose(shift_of(ROW[1] + off, ROW[1], ROW), shift, atol=1e-12)


def test_a_single_object_has_no_neighbour() -> None:
    np.testing.assert_allclose(shift_of(ROW[0] + 0.05, ROW[0], ROW[:1]), [0.05] * 3)
