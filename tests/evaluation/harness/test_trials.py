"""What a worker does with a batch: a module's fault is shown where it is, and what is not as meant is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from golem.evaluation.base import RUNGS, TrialSpec
from golem.evaluation.harness.run_folder import Finished
from golem.evaluation.harness.trials import Batch, Refused, facts, run_batch, rung_of
from golem.provenance import code_files, digest, versions

METHODS = """
from golem.capabilities.legs.hold import JointHold


class Raises(JointHold):
    def __init__(self):
        self.deeper()

    def deeper(self):
        raise ValueError("my bug")
"""


@pytest.fixture
def batch(tmp_path: Path) -> Batch:
    """A trial of a user's lower body that raises when it is made."""
    (tmp_path / "my_legs.py").write_text(METHODS)
    spec = TrialSpec("push", f"{tmp_path / 'my_legs.py'}:Raises", "ideal", 0, 0)
    made = Batch(RUNGS["push"], (spec,), 60.0, {}, digest(code_files()), versions())
    config = digest(facts(rung_of(made), spec.method, spec.profile, {}, {}))
    return replace(made, configs={spec.method: config})


def test_a_module_that_raises_is_shown_with_file_line_and_frames(batch: Batch) -> None:
    (finished,) = _finished(run_batch(batch))
    outcome = finished.outcome
    assert (outcome.stage, outcome.module) == ("fault", f"lower_body: {batch.specs[0].method}")
    assert outcome.detail.endswith("ValueError: my bug (my_legs.py:10)")
    assert outcome.trace is not None and outcome.trace.rstrip().endswith("ValueError: my bug")
    assert 'my_legs.py", line 10, in deeper' in outcome.trace and "lockstep.py" not in outcome.trace


def _finished(ending: object) -> tuple[Finished, ...]:
    assert isinstance(ending, tuple), ending
    return ending


def test_a_file_that_changes_while_a_run_goes_on_is_noticed(batch: Batch, tmp_path: Path) -> None:
    (tmp_path / "my_legs.py").write_text(METHODS + "# better\n")
    ending = run_batch(batch)
    assert isinstance(ending, Refused) and "my_legs.py:Raises changed while this ran" in ending.message


def test_other_packages_and_other_code_are_refused(batch: Batch) -> None:
    other = run_batch(replace(batch, versions={**batch.versions, "numpy": "1.0"}))
    assert isinstance(other, Refused) and "numpy was 1.0 and is " in other.message
    other = run_batch(replace(batch, code="another"))
    assert isinstance(other, Refused) and "runs other code of golem" in other.message
