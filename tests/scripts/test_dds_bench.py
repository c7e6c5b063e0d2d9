"""The bench of the transport: what it computes, and that its processes run."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("cyclonedds")

from scripts.dds_bench.bench import BenchFailed, DdsBenchConfig, _measures, run_dds_bench

from golem.errors import ConfigError


def test_losses_latency_and_jitter_are_those_of_what_came() -> None:
    ms = 1_000_000
    sent = {
        "began": [0, 2 * ms, 4 * ms, 6 * ms],
        "answered": [0, 1, 2],
        "cpu": 0.001,
        "wall": 0.008,
        "images": {"image": [0.001, 0.003], "cloud": [0.0]},
    }
    heard = {
        "controller": {
            "came": [(0, 0, 900.0), (1, ms, 50.0), (2, 3 * ms, 60.0), (2, 3 * ms, 60.0), (4, 9 * ms, 70.0)],
            "cpu": 0.002,
        },
        "viewer": {"came": {"a": 1, "b": 2}, "cpu": 0.004},
    }
    loop = _measures("x", sent, heard)
    assert (loop.rate, loop.states, loop.lost_states, loop.lost_commands) == (500.0, 4, 1, 2)
    assert loop.latency[0] == 1000.0 and loop.latency[1] == pytest.approx(2960.0)
    assert loop.transport[0] == 60.0
    assert loop.jitter[0] == 2000.0
    assert loop.cpu == pytest.approx({"robot": 12.5, "controller": 25.0, "viewer": 50.0})
    assert loop.image_ms is not None and loop.image_ms[0] == 2.0
    assert loop.images == 100.0


def test_bad_options_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="must be more than 0"):
        run_dds_bench(DdsBenchConfig(seconds=0.0))
    with pytest.raises(ConfigError, match="no checkout"):
        run_dds_bench(DdsBenchConfig(sdk=tmp_path))


@pytest.mark.slow
@pytest.mark.alone
def test_a_short_bench_loses_no_state_and_no_command(capsys: pytest.CaptureFixture[str], domain: int) -> None:
    loops = run_dds_bench(DdsBenchConfig(seconds=1.0, domain=domain))
    assert [(loop.states, loop.lost_states, loop.lost_commands) for loop in loops] == [(500, 0, 0)] * 2
    assert "lost states" in capsys.readouterr().out


@pytest.mark.slow
def test_a_process_that_fails_is_named(tmp_path: Path, domain: int) -> None:
    (tmp_path / "unitree_sdk2py").mkdir()
    with pytest.raises(BenchFailed, match="controller's process"):
        run_dds_bench(DdsBenchConfig(seconds=0.1, domain=domain, sdk=tmp_path))
