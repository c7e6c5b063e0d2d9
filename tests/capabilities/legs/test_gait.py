"""The gait clock, of many robots at once: when it stops. When it starts is tested with the base layer around it."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from golem.capabilities.legs.gait import Gait, GaitConfig
from golem.types import Array

DT = 0.01


def periods(config: GaitConfig, capture: Array, misplaced: Array) -> Array:
    """Return how many periods (n,) the clocks run on for after a step was begun; at most 5."""
    gait = Gait(config, misplaced.shape)
    rest = np.zeros(misplaced.shape, dtype=bool)
    gait.step(rest, capture + [0.15, 0.0], misplaced, DT)
    assert gait.stepping.all()
    ticks = np.zeros(misplaced.shape)
    for _ in range(round(5.0 * config.period / DT)):
        gait.step(rest, capture, misplaced, DT)
        ticks += gait.stepping
    return ticks * DT / config.period


def test_feet_that_are_a_little_off_and_are_not_put_right_do_not_keep_it_stepping() -> None:
    """A step ends at a double support; feet that are off by more than `feet_stop` put that off by `patience`."""
    still, config = np.zeros((3, 2)), GaitConfig()
    right, little, off = periods(config, still, np.array([0.04, 0.08, 0.13]))
    assert right < 0.5
    assert config.patience < little < config.patience + 0.5
    assert off > 4.9
    patient = periods(GaitConfig(patience=3.0), still[:1], np.array([0.08]))
    assert 3.0 < patient < 3.5


def test_a_body_that_is_not_above_its_feet_keeps_it_stepping() -> None:
    capture = np.array([[0.06, 0.0], [0.0, 0.08]])
    inside, outside = periods(GaitConfig(), capture, np.zeros(2))
    assert inside < 0.5
    assert outside > 4.9


@pytest.mark.parametrize("start", ["command", "recovery"])
def test_whoever_is_commanded_does_not_use_up_its_patience(start: Literal["command", "recovery"]) -> None:
    gait = Gait(GaitConfig(start=start), (1,))
    walk, stop = np.array([True]), np.array([False])
    still, little = np.zeros((1, 2)), np.array([0.08])
    for _ in range(round(4.0 * gait.config.period / DT)):
        gait.step(walk, still, little, DT)
    after = 0
    while gait.stepping[0]:
        gait.step(stop, still, little, DT)
        after += 1
    waited = after * DT / gait.config.period
    assert waited > gait.config.patience if start == "recovery" else waited < 0.6
