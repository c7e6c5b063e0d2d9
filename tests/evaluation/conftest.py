from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from golem.evaluation import base
from golem.evaluation.harness.ladder import LadderConfig


def fakes(monkeypatch: pytest.MonkeyPatch, folder: Path) -> Callable[..., LadderConfig]:
    """Register the fake rungs and return a maker of configurations for them, with runs in `folder`."""
    monkeypatch.setitem(base.RUNGS, "fake", "tests.evaluation.fake_rung:Fake")
    monkeypatch.setitem(base.RUNGS, "climb", "tests.evaluation.fake_rung:Climb")

    def make(*methods: str, n: int = 6, out: str = "run", rung: str = "fake", **options: Any) -> LadderConfig:
        return LadderConfig(rung=rung, method=methods, n=n, out=folder / out, **options)

    return make


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., LadderConfig]:
    """A maker of configurations of the fake rungs, see `fakes`."""
    return fakes(monkeypatch, tmp_path)
