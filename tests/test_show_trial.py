"""One trial of a ladder in the live view is the trial of the record, looked at."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from golem import run
from golem.errors import ConfigError
from golem.evaluation.base import TrialSpec
from golem.evaluation.harness.ladder import LadderConfig
from golem.evaluation.harness.records import trial_name
from golem.evaluation.rungs.push import PushRung
from golem.run import show_trial
from golem.runtime.lockstep import LockstepRunner

STIFF = f"{Path(__file__).parent / 'evaluation' / 'leg_methods.py'}:Stiff"


class View:
    """Counts the ticks it is shown."""

    period = 0.002
    made: list[View] = []

    def __init__(self, running: LockstepRunner, robot: Any, *, passive: bool) -> None:
        assert passive and running.executor.t == 0.0
        self.ticks, self.closed, self.force = 0, False, 0.0
        self._robot = robot
        self.made.append(self)
        running.executor.add(self)

    def step(self, t: float) -> None:
        self.ticks += 1
        pushed = self._robot.pushed
        self.force = max(self.force, 0.0 if pushed is None else float(abs(pushed[1]).max()))

    def close(self) -> None:
        self.closed = True


def config(out: Path, show: str) -> LadderConfig:
    return LadderConfig(rung="push", method=(STIFF,), n=2, profile="ideal", out=out, show=show)


def test_a_trial_that_is_shown_ends_as_on_the_ladder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "LiveView", View)
    outcome = show_trial(config(tmp_path, "1"))
    (view,) = View.made
    assert view.ticks > 1000 and view.closed and view.force > 5.0
    assert outcome == PushRung().run(TrialSpec("push", STIFF, "ideal", 0, 1), None)
    assert list(tmp_path.iterdir()) == [], "nothing is written"


def test_trials_are_named_by_index_method_or_as_in_the_report(tmp_path: Path) -> None:
    whole = config(tmp_path, "1").whole()
    request, _ = run.prepare(whole)
    by_index, _ = run.find_trial(whole, request)
    assert (by_index.method, by_index.index) == (STIFF, 1)
    for name in (f"{STIFF}:1", trial_name(by_index)):
        assert run.find_trial(config(tmp_path, name).whole(), request)[0] == by_index
    assert run.find_trial(config(tmp_path, "77").whole(), request)[0].index == 77
    with pytest.raises(ConfigError, match="Unknown trial 'almi:x'; valid: "):
        run.find_trial(config(tmp_path, "almi:x").whole(), request)
