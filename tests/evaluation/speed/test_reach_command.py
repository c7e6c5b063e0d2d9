"""`golem reach` on a coarse grid: a table, a map and a picture."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from golem.capabilities.arms.reach_map import load_map
from golem.errors import ConfigError
from golem.evaluation.speed.reach_command import ReachConfig, declared, run_reach
from golem.types import SIDES


@pytest.mark.slow
def test_half_of_the_workspace_is_served(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    files = tmp_path / "reach.json", tmp_path / "reach.png"
    found = run_reach(ReachConfig(0.2, *files))
    for side in SIDES:
        inside = declared(found[side])
        assert (found[side].served() & inside).sum() > 0.4 * inside.sum()
    assert load_map(files[0]).margin.shape == found["right"].margin.shape
    assert Image.open(files[1]).size == (1300, 240)


@pytest.mark.parametrize("spacing", [0.0, 0.001, 1.0, float("nan")])
def test_a_spacing_without_sense_is_refused(spacing: float) -> None:
    with pytest.raises(ConfigError, match="--spacing"):
        run_reach(ReachConfig(spacing))
