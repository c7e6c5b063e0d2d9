"""`golem bench arms` times what it names, and refuses numbers that make no sense."""

from __future__ import annotations

import pytest

from golem.errors import ConfigError
from golem.evaluation.speed.arms_bench import ArmsBenchConfig, run_arms_bench


@pytest.mark.slow
def test_checks_and_plans_are_timed_and_misses_are_counted(capsys: pytest.CaptureFixture[str]) -> None:
    figures = {f.name: f for f in run_arms_bench(ArmsBenchConfig(postures=60, plans=8))}
    assert figures["collision, our kernel, single"].median < figures["collision, coal, meshes"].median
    assert all(0.0 < f.median <= f.p99 for f in figures.values())
    said = " ".join(capsys.readouterr().out.split())
    assert " 0 missed" in said and "8/8" in said and said.count("0 / 0 / 0") == 2
    assert figures["plan, rrt_connect"].unit == "ms"


def test_numbers_out_of_range_are_refused() -> None:
    with pytest.raises(ConfigError, match="--postures must be 9 or more"):
        run_arms_bench(ArmsBenchConfig(postures=3))
    with pytest.raises(ConfigError, match="--plans"):
        run_arms_bench(ArmsBenchConfig(plans=-1))
