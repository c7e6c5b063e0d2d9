"""The README's headline still holds: the screws are picked in the hoist and standing, with the errors of `field`."""

from __future__ import annotations

from pathlib import Path

import pytest

from golem.evaluation.harness.ladder import LadderConfig, run_ladder

TRIALS = 8
SEED = 1
"""Not the seed of the published figures, so that what was tuned to their scenes shows."""


@pytest.mark.slow
@pytest.mark.alone  # uses both processors itself
@pytest.mark.timeout(900)
@pytest.mark.parametrize("rung", ["tether", "stand"])
def test_the_screws_are_picked_as_the_readme_says(rung: str, tmp_path: Path) -> None:
    config = LadderConfig(
        rung=rung, method=("visual_servo",), n=TRIALS, profile="field", seed=SEED, out=tmp_path, j=2
    )
    records = run_ladder(config).records
    assert len(records) == TRIALS
    lost = [
        f"{record.index}: {record.stage}, {record.module}: {record.detail}"
        for record in records
        if not record.success
    ]
    # Claimed are 99 and 98 %: with these, two losses of eight come in one run of a hundred.
    assert len(lost) <= 1, lost
