from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from golem.evaluation import base
from golem.evaluation.harness.ladder import LadderConfig


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., LadderConfig]:
    """Register the fake rung and return a maker of configurations for it; workers inherit sys.path."""
    monkeypatch.syspath_prepend(Path(__file__).parent)
    monkeypatch.setitem(base.RUNGS, "fake", "fake_rung:Fake")

    def make(*methods: str, n: int = 6, out: str = "run", **options: Any) -> LadderConfig:
        return LadderConfig(rung="fake", method=methods, n=n, out=tmp_path / out, **options)

    return make
