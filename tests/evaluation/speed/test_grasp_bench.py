"""`golem bench grasp`: what it prints, and what it leaves out."""

from __future__ import annotations

import json

import pytest

from golem.errors import ConfigError
from golem.evaluation.speed.grasp_bench import GraspBenchConfig, run_grasp_bench


def test_every_method_has_its_rows(capsys: pytest.CaptureFixture[str]) -> None:
    figures = run_grasp_bench(GraspBenchConfig(methods=("centroid", "antipodal"), points=400, n=1, json=True))
    assert [figure.name for figure in figures][:2] == ["centroid, mug", "centroid, bowl"]
    assert len(figures) == 10
    said = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert said[5]["reference"].startswith("60 ms")


def test_numbers_out_of_range_are_refused() -> None:
    with pytest.raises(ConfigError, match="--points must be 50"):
        run_grasp_bench(GraspBenchConfig(points=1))
