"""The live subset of the faults, on a real domain."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from golem.evaluation.faults.live_faults import FAULTS


def test_every_fault_has_a_name_and_a_reason() -> None:
    assert len({fault.name for fault in FAULTS}) == len(FAULTS)
    assert all(fault.reasons for fault in FAULTS)


@pytest.mark.slow
@pytest.mark.alone
@pytest.mark.timeout(900)
def test_each_is_answered_rightly(tmp_path: Path, domain: int) -> None:
    pytest.importorskip("cyclonedds")
    command = [sys.executable, "-m", "golem", "faults", "--live", "--domain", str(domain)]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=800, check=False, cwd=tmp_path, stdin=subprocess.DEVNULL
    )
    assert done.returncode == 0, done.stdout
