from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from golem.evaluation import base
from golem.evaluation.harness.ladder import LadderConfig


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., LadderConfig]:
    """Register the fake rungs and return a maker of configurations for it."""
    monkeypatch.setitem(base.RUNGS, "fake", "tests.evaluation.fake_rung:Fake")
    monkeypatch.setitem(base.RUNGS, "climb", "tests.evaluation.fake_rung:Climb")

    def make(*methods: str, n: int = 6, out: str = "run", rung: str = "fake", **options: Any) -> LadderConfig:
        return LadderConfig(rung=rung, method=methods, n=n, out=tmp_path / out, **options)

    return make
