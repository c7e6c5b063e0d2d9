"""The bench of the memory finds every object again, and refuses numbers without sense."""

from __future__ import annotations

import pytest

from golem.errors import ConfigError
from golem.evaluation.speed.memory_bench import MemoryBenchConfig, run_memory_bench


def test_every_object_is_kept(capsys: pytest.CaptureFixture[str]) -> None:
    figures = run_memory_bench(MemoryBenchConfig(observations=40, objects=120))
    assert "40 looks, 120 objects" in figures[0].name
    assert "object_map" in capsys.readouterr().out


def test_a_number_without_sense_is_refused() -> None:
    with pytest.raises(ConfigError, match="--objects at least"):
        run_memory_bench(MemoryBenchConfig(objects=2))
