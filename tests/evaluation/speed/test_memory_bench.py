"""The bench of the memory counts what a killed process lost, and refuses numbers without sense."""

from __future__ import annotations

from pathlib import Path

import pytest

from golem.capabilities.memory.memory_file import MemoryFile
from golem.errors import ConfigError
from golem.evaluation.speed import memory_bench
from golem.evaluation.speed.memory_bench import MemoryBenchConfig, run_memory_bench


def test_every_object_is_kept_and_nothing_lost(capsys: pytest.CaptureFixture[str]) -> None:
    figures = run_memory_bench(MemoryBenchConfig(observations=40, objects=120, kills=1))
    assert "40 looks, 120 objects" in figures[0].name
    assert figures[-1].median == 0 and "object_map" in capsys.readouterr().out


def test_looks_that_were_acknowledged_and_not_kept_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that is written by nobody, beside a process that acknowledges."""
    monkeypatch.setattr(memory_bench.ObjectMap, "last", property(lambda self: 0.0, lambda self, t: None), False)
    assert memory_bench._killed(tmp_path / "memory.sqlite", 1) > 0
    assert MemoryFile(tmp_path / "memory.sqlite").read()[1] > 0  # which the process itself has written


def test_a_number_without_sense_is_refused() -> None:
    with pytest.raises(ConfigError, match="--objects at least"):
        run_memory_bench(MemoryBenchConfig(objects=2))
