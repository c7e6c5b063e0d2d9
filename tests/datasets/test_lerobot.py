"""Our data sets in the package lerobot, its checkpoints behind our client, and independent checkers of data sets.

`GOLEM_LEROBOT_PYTHON` names an interpreter with lerobot (0.4.4 and 0.6.1 were tried), msgpack and websockets.
"""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.datasets.conftest import SMALL, frames

from golem.datasets.store import DatasetFolder

HERE = Path(__file__).resolve().parent
SCRIPT = HERE.parents[1] / "scripts" / "serve_policy.py"


@pytest.fixture(scope="module")
def python() -> str:
    path = os.environ.get("GOLEM_LEROBOT_PYTHON", "")
    if not path:
        pytest.skip("needs an interpreter with lerobot: GOLEM_LEROBOT_PYTHON")
    return path


ENVIRONMENT = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | {"HF_HUB_OFFLINE": "1"}


def peer(python: str, *words: str) -> dict[str, Any]:
    done = subprocess.run(
        [python, str(HERE / "lerobot_peer.py"), *words], capture_output=True, text=True, timeout=300, env=ENVIRONMENT
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.slow
def test_lerobot_reads_what_was_written(dataset: Path, python: str, tmp_path: Path) -> None:
    said = peer(python, "read", str(dataset), str(tmp_path / "rows.npz"))
    assert said == {"episodes": 3, "frames": 95, "task": "Take a screw.", "fps": 15}
    rows = np.load(tmp_path / "rows.npz")
    written = [frame for k, length in enumerate((20, 70, 5)) for frame in frames(length, k)]
    for name in ("observation.state", "observation.effort", "action", "command.joints"):
        np.testing.assert_allclose(rows[name], [frame[name] for frame in written], atol=1e-6)
    assert np.array_equal(rows["index"], np.arange(95))
    depth, mask = "observation.depth.right_hand", "observation.masks.right_hand"
    for name in (depth, mask):
        assert np.array_equal(rows[name].reshape(95, 48, 64), [frame[name] for frame in written])
    level = rows["observation.images.right_hand"].mean((1, 2, 3)) * 255.0
    wanted = np.array([frame["observation.images.right_hand"].mean() for frame in written])
    assert np.abs(level - wanted).max() < 3.0  # a frame is three levels lighter than the one before


@pytest.mark.slow
def test_a_checkpoint_of_lerobots_answers(dataset: Path, python: str, tmp_path: Path) -> None:
    from golem.capabilities.policies.openpi import PolicyLinkConfig, PolicyServer
    from golem.capabilities.policies.vectors import check_actions

    assert peer(python, "act", str(dataset), str(tmp_path / "act"))["parameters"] < 2e7
    words = [python, str(SCRIPT), "lerobot", str(tmp_path / "act"), "--port", "0"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT) as process:
        try:
            assert process.stdout is not None
            said = next(line for line in process.stdout if line.startswith("Serving"))
            port = int(said.rsplit(":", 1)[1].strip(" .\n"))
            server = PolicyServer(PolicyLinkConfig(port=port, timeout=60.0))
            frame = frames(1)[0]
            names = ("observation.state", "observation.images.right_hand")
            seen = {
                name: np.asarray(frame[name], SMALL.features()[name].dtype if "state" in name else np.uint8)
                for name in names
            }
            assert check_actions(server.infer(seen | {"prompt": "x"})).shape == (8, 25)
            server.close()
        finally:
            process.kill()


@pytest.mark.slow
def test_an_independent_checker_finds_no_fault_of_format(dataset: Path, python: str) -> None:
    doctor = Path(python).with_name("lerobot-doctor")
    if not doctor.exists():
        pytest.skip("needs lerobot-doctor beside lerobot")
    done = subprocess.run([doctor, str(dataset)], capture_output=True, text=True, timeout=300, env=ENVIRONMENT)
    assert "Summary" in done.stdout and "FAIL" not in done.stdout, done.stdout[-3000:]
    assert len(DatasetFolder(dataset).episodes) == 3
