"""A writer that is killed with SIGKILL: what was finished stays, and nothing is there by half."""

from __future__ import annotations

import os
import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

from golem.datasets.commands import findings as check
from golem.datasets.store import DatasetFolder

KILLS = int(os.environ.get("GOLEM_DATASET_KILLS", "6"))
"""How often a writer is killed; `scripts/kill_dataset_writer.sh` asks for 100."""
REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["plain", "pictures"])
def test_no_finished_episode_is_lost_and_none_is_there_by_half(tmp_path: Path, kind: str) -> None:
    root, rng, finished = tmp_path / "set", random.Random(0), 0
    env = os.environ | {"PYTHONPATH": os.pathsep.join([str(REPOSITORY), str(REPOSITORY / "src"), *sys.path])}
    for _ in range(KILLS):
        words = [sys.executable, "-m", "tests.datasets.killed_writer", str(root), kind]
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=env, cwd=REPOSITORY) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "open\n"
            if rng.random() < 0.7:
                finished = int(process.stdout.readline()) + 1
            time.sleep(rng.uniform(0.0, 0.15))
            process.kill()
            said = process.stdout.read().split()
        finished = max([finished, *(int(word) + 1 for word in said if word.isdigit())])
        if not root.exists():
            assert finished == 0
            continue
        data = DatasetFolder(root)
        # One more may be whole whose writer did not come to say so.
        assert finished <= len(data.episodes) <= finished + 1
        assert [*check(data)] == []
        finished = len(data.episodes)
    assert finished > 0
