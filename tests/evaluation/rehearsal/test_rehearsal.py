"""The bring-up rehearsed with a real twin process: it passes, and finds what is built in."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from golem.evaluation.rehearsal.rehearse import FAULTS, FLIPPED, SWAPPED, reported
from golem.runtime.bringup.bringup_command import CHECKS
from golem.types import NUM_JOINTS


def test_every_fault_has_a_check_that_finds_it() -> None:
    names = {check.name for check in CHECKS}
    assert {check for check in FAULTS.values() if check} <= names


@pytest.mark.parametrize("fault", FAULTS)
def test_what_is_reported_can_be_undone(fault: str) -> None:
    true = np.arange(1.0, NUM_JOINTS + 1.0)
    assert (reported(fault, reported(fault, true)) == true).all()
    wrong = np.flatnonzero(reported(fault, true) != true)
    assert wrong.tolist() == {"swapped_joints": sorted(SWAPPED), "wrong_sign": [FLIPPED]}.get(fault, [])


def golem(domain: int, report: Path, fault: str, *more: str) -> subprocess.CompletedProcess[str]:
    """Rehearse the bring-up on a domain."""
    words = ["bringup", "--rehearse", "--fault", fault, "--report", str(report), "--domain", str(domain), *more]
    return subprocess.run(
        [sys.executable, "-m", "golem", *words],
        capture_output=True,
        text=True,
        timeout=800,
        check=False,
        stdin=subprocess.DEVNULL,
    )


@pytest.mark.slow
@pytest.mark.alone
@pytest.mark.timeout(2400)
def test_a_sound_robot_passes_and_faults_are_found_after_it(tmp_path: Path, domain: int) -> None:
    pytest.importorskip("cyclonedds")
    sound = golem(domain, tmp_path / "sound", "none")
    assert sound.returncode == 0, sound.stdout
    assert (tmp_path / "sound" / "report.md").read_text().count(": passed") == len(CHECKS)
    # They go on from the sound robot's report, which saves the joints and the first motion.
    for fault in ("missing_camera", "silent_estop"):
        shutil.copytree(tmp_path / "sound", tmp_path / fault)
        found = golem(domain, tmp_path / fault, fault, "--patience", "20")
        assert found.returncode == 0, found.stdout


@pytest.mark.slow
@pytest.mark.alone
@pytest.mark.timeout(1200)
@pytest.mark.parametrize(
    "fault",
    [
        "tilted_imu",
        pytest.param("swapped_joints", marks=pytest.mark.long),
        pytest.param("wrong_sign", marks=pytest.mark.long),
    ],
)
def test_a_fault_is_found(tmp_path: Path, domain: int, fault: str) -> None:
    pytest.importorskip("cyclonedds")
    found = golem(domain, tmp_path, fault)
    assert found.returncode == 0, found.stdout
