"""A module that looks through the interpreter for the simulation is stopped; libraries are not."""

from __future__ import annotations

import gc
import importlib.util
import logging
import sys
from pathlib import Path
from types import ModuleType

import pytest

from golem.evaluation.conformance.examine import candidate, examine
from golem.evaluation.no_search import Searched, searching_forbidden

MODULE = """
import collections
import gc
import inspect
import sys

def objects(): return gc.get_objects()
def referrers(): return gc.get_referrers(gc)
def frame(): return sys._getframe(1)
def stack(): return inspect.stack()
def current(): return inspect.currentframe()
def point(): return collections.namedtuple("Point", "x y")(1, 2)
"""
SEARCHER = """
import gc
from golem.capabilities.properties.property_table import PropertyTable

class Searcher(PropertyTable):
    def properties(self, name):
        gc.get_objects()
        return super().properties(name)
"""


@pytest.fixture
def module(tmp_path: Path) -> ModuleType:
    """A user's file."""
    (tmp_path / "nosy.py").write_text(MODULE)
    spec = importlib.util.spec_from_file_location("nosy", tmp_path / "nosy.py")
    assert spec is not None and spec.loader is not None
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


@pytest.mark.parametrize("name", ["objects", "referrers", "frame", "stack", "current"])
def test_who_looks_for_what_it_is_not_given_is_stopped(module: ModuleType, name: str) -> None:
    getattr(module, name)()
    with searching_forbidden(), pytest.raises(Searched, match="goes by what it is given"):
        getattr(module, name)()
    getattr(module, name)()


def test_what_libraries_do_for_a_module_is_no_search(module: ModuleType, caplog: pytest.LogCaptureFixture) -> None:
    with searching_forbidden():
        assert module.point().x == 1
        logging.getLogger("golem.test").warning("said")
        gc.collect()
    assert "said" in caplog.text and sys._getframe() is not None


def test_the_check_of_a_module_names_the_line(tmp_path: Path) -> None:
    (tmp_path / "searcher.py").write_text(SEARCHER)
    report = examine(candidate("properties", f"{tmp_path}/searcher.py:Searcher"))
    assert not report.passed
    assert any(
        "gc.get_objects looks through the interpreter" in f.reason and "searcher.py:7" in f.reason
        for f in report.findings
    )
