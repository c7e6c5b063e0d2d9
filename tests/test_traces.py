"""What goes wrong in a user's file is told with the line it went wrong in."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from golem import registry
from golem.capabilities.arms.base import check_pose
from golem.errors import ConfigError, ModuleFault
from golem.runtime.contract_check import ContractCheck
from golem.traces import DEEPEST, describe

MINE = """
import numpy as np
from golem.capabilities.arms.base import check_pose

def invert(A):
    return np.linalg.inv(A)

class Mine:
    def step(self, A):
        return invert(A)
    def pose(self):
        return check_pose("the pose", np.zeros((3, 3)))
    def deep(self, n=500):
        return self.deep(n - 1) if n else 1 / 0
    def leave(self):
        raise SystemExit(3)
"""


@pytest.fixture
def mine(tmp_path: Path) -> Any:
    """A user's module, whose file is called mine.py."""
    path = tmp_path / "mine.py"
    path.write_text(MINE)
    yield registry.create("hand", f"{path}:Mine", {})
    for name in [name for name in sys.modules if name.startswith("golem_user_mine")]:
        del sys.modules[name]


def fault(function: Any, *arguments: object) -> ModuleFault:
    with pytest.raises(ModuleFault) as caught:
        ContractCheck("hand", "mine.py:Mine").call(function, *arguments)
    return caught.value


def test_the_sentence_names_the_innermost_line_of_the_users_file(mine: Any) -> None:
    assert fault(mine.step, np.zeros((2, 2))).reason == "LinAlgError: Singular matrix (mine.py:6)"


def test_the_trace_has_the_users_lines_alone_with_their_paths(mine: Any, tmp_path: Path) -> None:
    assert (fault(mine.step, np.zeros((2, 2))).trace or "").splitlines() == [
        "Traceback (most recent call last):",
        f'  File "{tmp_path / "mine.py"}", line 10, in step',
        "    return invert(A)",
        f'  File "{tmp_path / "mine.py"}", line 6, in invert',
        "    return np.linalg.inv(A)",
        "numpy.linalg.LinAlgError: Singular matrix",
    ]


def test_a_line_of_the_package_below_the_users_is_left_out(mine: Any) -> None:
    assert fault(mine.pose).reason.endswith("(mine.py:12)")


def test_where_no_users_file_is_involved_the_packages_own_line_is_named() -> None:
    assert fault(check_pose, "the pose", np.zeros((3, 3))).reason.split("(")[-1].startswith("base.py:")


def test_a_recursion_without_end_is_cut(mine: Any) -> None:
    found = fault(mine.deep)
    assert f"[Previous line repeated {DEEPEST - 3} more times]" in (found.trace or "") and found.reason.endswith(
        "(mine.py:14)"
    )


def test_a_module_that_ends_the_process_ends_only_itself(mine: Any) -> None:
    assert fault(mine.leave).reason == "SystemExit: 3 (mine.py:16)"


def test_a_config_error_is_a_sentence_of_its_own() -> None:
    def wrong() -> None:
        raise ConfigError("Unknown label 'x'.")

    found = fault(wrong)
    assert (found.reason, found.trace) == ("ConfigError: Unknown label 'x'.", None)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("1 / 0", "importing it raised ZeroDivisionError: division by zero (bad.py:1)"),
        ("raise SystemExit(2)", "importing it raised SystemExit: 2 (bad.py:1)"),
        ("x = 1\ndef f(self:\n", "importing it raised SyntaxError: '(' was never closed (bad.py, line 2)"),
        (
            "class Bad:\n    def __init__(self):\n        self.x = self.y\n",
            "its constructor raised AttributeError: 'Bad' object has no attribute 'y' (bad.py:3)",
        ),
    ],
)
def test_a_file_that_cannot_be_built_is_named_by_its_line(text: str, reason: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.py"
    path.write_text(text)
    with pytest.raises(ModuleFault) as caught:
        registry.create("hand", f"{path}:Bad", {})
    assert caught.value.reason == reason
    assert caught.value.trace is not None and str(path) in caught.value.trace
    assert "src/golem" not in caught.value.trace


@pytest.mark.parametrize(
    ("error", "line"),
    [(ValueError("a\n  b"), "ValueError: a b"), (AssertionError(), "AssertionError"), (KeyError("k"), "KeyError: 'k'")],
)
def test_what_was_raised_is_one_line(error: Exception, line: str) -> None:
    assert describe(error) == line
