"""The mean of networks. What is shipped is one."""
# ruff: noqa: E402 (nothing of the trainer can be imported where torch is absent)

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs the extra 'train'")
onnx = pytest.importorskip("onnx", reason="export needs the extra 'train'")

from onnx import numpy_helper

from golem.errors import ConfigError
from golem.training.legs.export_policy import average

ROOT = Path(__file__).parents[3]
SHIPPED = ROOT / "src/golem/capabilities/legs/policies"
PARTS = [ROOT / "artefacts/legs" / f"stand_{name}.onnx" for name in ("seventh", "gate", "back")]
ROUGH = [ROOT / "artefacts/legs" / f"walk_rough_{name}.onnx" for name in ("first", "ground", "steps")]


def weights(path: Path) -> dict[str, np.ndarray]:
    return {w.name: numpy_helper.to_array(w) for w in onnx.load(str(path)).graph.initializer}


@pytest.mark.parametrize(
    ("name", "parts", "shares"), [("almi_stand", PARTS, (2.0, 1.0, 1.0)), ("almi_walk_rough", ROUGH, (1.0, 1.0, 1.0))]
)
def test_a_shipped_network_is_the_mean_that_the_docs_say(
    name: str, parts: list[Path], shares: tuple[float, ...], tmp_path: Path
) -> None:
    out = tmp_path / "mean.onnx"
    average(parts, shares, out)
    assert out.read_bytes() == (SHIPPED / f"{name}.onnx").read_bytes()


def test_the_mean_is_weighted_and_says_of_what(tmp_path: Path) -> None:
    out = tmp_path / "new" / "mean.onnx"
    average(PARTS[:2], (1.0, 3.0), out)
    first, second, mean = map(weights, (*PARTS[:2], out))
    assert mean.keys() == first.keys()
    for name in ("weight0", "bias0", "weight3", "bias3"):
        np.testing.assert_allclose(mean[name], 0.25 * first[name] + 0.75 * second[name], atol=1e-6)
        assert not np.allclose(mean[name], first[name], atol=1e-4)
    (said,) = onnx.load(str(out)).metadata_props
    assert "3 x stand_gate.onnx: golem train legs run --task stand" in said.value


@pytest.mark.parametrize(
    ("parts", "shares", "words"),
    [
        (PARTS[:1], (1.0,), "two networks or more"),
        (PARTS, (1.0, 1.0), "a number for each"),
        (PARTS[:2], (0.0, 0.0), "not all of them 0"),
        (PARTS[:2], (1.0, -1.0), "0 or more"),
        (PARTS[:2], (1.0, float("nan")), "0 or more"),
        ([PARTS[0], Path("run/checkpoint.pt")], (1.0, 1.0), "end in .onnx"),
        ([PARTS[0], Path("nope.onnx")], (1.0, 1.0), "cannot be read"),
    ],
)
def test_what_is_no_mean_is_refused(parts: list[Path], shares: tuple[float, ...], words: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=words):
        average(parts, shares, tmp_path / "mean.onnx")
    assert not (tmp_path / "mean.onnx").exists()
