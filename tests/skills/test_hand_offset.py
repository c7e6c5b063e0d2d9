from __future__ import annotations

import numpy as np
import pytest

from golem.robots.worlds.ioniq5 import Ioniq5Layout
from golem.skills.hand_offset import hand_offset

EDGE = np.array(
    [
        (0.02, -0.57, 0.0), (0.02, -0.46, 0.0), (0.02, -0.34, 0.0), (0.02, -0.3, 0.0),
        (-0.02, -0.47, -0.065), (-0.02, -0.34, -0.065),
    ]
)  # fmt: skip


@pytest.mark.parametrize("off", [(0.0, 0.0, 0.0), (-0.05, 0.03, 0.02), (0.04, -0.045, -0.03)])
def test_what_several_agree_on_is_the_offset(off: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(0)
    seen = EDGE[[1, 3, 4]] + off + rng.normal(0.0, 0.003, (3, 3))
    found = hand_offset(seen, EDGE + rng.normal(0.0, 0.003, EDGE.shape))
    assert found is not None and np.allclose(found, off, atol=0.008)


def test_one_more_that_only_the_hand_sees_does_not_matter() -> None:
    seen = np.vstack([EDGE[[1, 3, 4]] + (0.03, 0.02, 0.0), [(0.2, 0.1, 0.0)]])
    found = hand_offset(seen, EDGE)
    assert found is not None and np.allclose(found, (0.03, 0.02, 0.0))


@pytest.mark.parametrize("seen", [EDGE[:0], EDGE[:1], EDGE[:3] + (0.3, 0.0, 0.0)])
def test_too_little_is_unclear(seen: np.ndarray) -> None:
    assert hand_offset(seen, EDGE) is None


def test_a_left_hand_before_the_ledge_of_a_real_pack() -> None:
    """Seen in a trial: by the nearest one alone the hand took its neighbour, three centimetres inwards and higher."""
    pack = Ioniq5Layout().fasteners()
    known = pack[[7, 8, 9, 10, 11, 75, 76]] + (0.947, 0.077, -0.082)
    seen = np.array([(0.913, 0.379, -0.107), (0.876, 0.444, -0.168), (0.92, 0.286, -0.111)])
    found = hand_offset(seen, known)
    assert found is not None and np.allclose(found, (-0.048, -0.022, -0.025), atol=1e-3)


def test_nothing_known_is_unclear() -> None:
    assert hand_offset(EDGE[:3], EDGE[:0]) is None


def test_a_regular_row_is_unclear() -> None:
    row = np.array([(0.0, 0.034 * k, 0.0) for k in range(8)])
    assert hand_offset(row[3:5] + (0.0, 0.017, 0.0), row) is None
