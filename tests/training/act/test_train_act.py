from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")
pytest.importorskip("pyarrow")
pytest.importorskip("av")
from tests.datasets.conftest import PLAIN, frames, write  # noqa: E402

from golem.capabilities.policies.onnx_policy import MEASURED, POSITIONS, OnnxPolicy  # noqa: E402
from golem.capabilities.policies.vectors import STATE, check_actions  # noqa: E402
from golem.datasets.schema import DatasetError  # noqa: E402
from golem.errors import ConfigError  # noqa: E402
from golem.training.act.train_act import train_act  # noqa: E402


@pytest.mark.slow
def test_a_data_set_becomes_a_file_that_acts(tmp_path: Path) -> None:
    root = write(tmp_path / "set", (12, 20, 9))
    train_act(root, tmp_path / "act.onnx", width=48, chunk=4, steps=2, batch=4)
    policy, frame = OnnxPolicy(tmp_path / "act.onnx"), frames(1)[0]
    seen = {name: np.asarray(frame[name]) for name in ("observation.state", "observation.images.right_hand")}
    actions = check_actions(policy.infer(seen))
    assert actions.shape == (4, 25) and (policy.camera, policy.fps) == ("right_hand", 15)
    # Seen from the hand: the same picture elsewhere asks for the same way.
    moved = seen | {"observation.state": seen["observation.state"].copy()}
    x = list(STATE).index("right_palm.x")
    moved["observation.state"][x] += 0.1
    shift = check_actions(policy.infer(moved)) - actions
    assert shift[:, POSITIONS[MEASURED.index(x)]] == pytest.approx(0.1, abs=1e-6)


def test_what_cannot_be_trained_on_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="1 of them are held out"):
        train_act(write(tmp_path / "one", (5,)), tmp_path / "x.onnx")
    with pytest.raises(DatasetError, match=r"no observation\.images\.right_hand"):
        train_act(write(tmp_path / "plain", (5, 5), PLAIN), tmp_path / "x.onnx")
    with pytest.raises(ConfigError, match="1 or more"):
        train_act(tmp_path, tmp_path / "x.onnx", steps=0)
