"""Networks from files: right ones run, wrong ones are answered in one sentence."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import golem
from golem.capabilities.legs.network import load_network
from golem.errors import ConfigError, MissingExtra


def write_onnx(
    path: Path,
    inputs: int,
    outputs: int,
    batch: tuple[int | str, ...] = (1,),
    twice: bool = False,
    double: bool = False,
) -> Path:
    """Write a network y = x W with W = 0.01 everywhere."""
    onnx = pytest.importorskip("onnx")
    helper = onnx.helper
    kind = onnx.TensorProto.DOUBLE if double else onnx.TensorProto.FLOAT
    W = helper.make_tensor("W", kind, [inputs, outputs], np.full(inputs * outputs, 0.01))
    nodes = [helper.make_node("MatMul", ["x", "W"], ["y"])]
    x = helper.make_tensor_value_info("x", kind, [*batch, inputs])
    y = [helper.make_tensor_value_info("y", kind, [*batch, outputs])]
    if twice:
        nodes.append(helper.make_node("MatMul", ["x", "W"], ["z"]))
        y.append(helper.make_tensor_value_info("z", kind, [*batch, outputs]))
    model = helper.make_model(
        helper.make_graph(nodes, "net", [x], y, [W]), opset_imports=[helper.make_opsetid("", 17)], ir_version=9
    )
    onnx.save(model, str(path))
    return path


@pytest.mark.parametrize("batch", [(1,), (), ("n",)])
def test_an_onnx_network_runs(tmp_path: Path, batch: tuple[int | str, ...]) -> None:
    network = load_network(write_onnx(tmp_path / "net.onnx", 5, 12, batch), 5)
    x = np.arange(5, dtype=np.float32)
    np.testing.assert_allclose(network(x), np.full(12, 0.1), rtol=1e-6)
    assert network(x).shape == (12,)
    network.reset()


def test_a_network_tells_nobody_outside_that_it_runs(tmp_path: Path) -> None:
    # onnxruntime is silent in CI and under its own tests, too.
    kept = {name: value for name, value in os.environ.items() if name in ("PATH", "LD_LIBRARY_PATH", "NUMBA_CACHE_DIR")}
    code = "import sys, golem, onnxruntime as o; o.InferenceSession(sys.argv[1], providers=['CPUExecutionProvider'])"
    network = next(Path(golem.__file__).parent.rglob("*.onnx"))
    subprocess.run([sys.executable, "-c", code, str(network)], env=kept | {"HOME": str(tmp_path)}, check=True)
    assert not [file for file in tmp_path.rglob("*") if "onnxruntime" in file.name]


def test_a_network_that_does_not_fit_is_answered_with_both_sizes(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="does not take the 6 values of the described observation: 5"):
        load_network(write_onnx(tmp_path / "a.onnx", 5, 12), 6)
    with pytest.raises(ConfigError, match=r"returns \(10,\) .* leg policy returns \(12,\)"):
        load_network(write_onnx(tmp_path / "b.onnx", 5, 10), 5)
    with pytest.raises(ConfigError, match="1 inputs and 2 outputs"):
        load_network(write_onnx(tmp_path / "c.onnx", 5, 12, twice=True), 5)
    with pytest.raises(ConfigError, match=r"takes tensor\(double\) and returns tensor\(double\); a policy's"):
        load_network(write_onnx(tmp_path / "e.onnx", 5, 12, double=True), 5)
    with pytest.raises(ConfigError, match="does not take the 5 values"):
        load_network(write_onnx(tmp_path / "d.onnx", 5, 12, (3,)), 5)


def test_files_that_are_no_networks_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"ends in '.h5'; valid: .onnx, .pt"):
        load_network(tmp_path / "net.h5", 5)
    with pytest.raises(ConfigError, match="no network .*net.onnx; .*beside its description"):
        load_network(tmp_path / "net.onnx", 5)
    (tmp_path / "junk.onnx").write_bytes(b"junk")
    with pytest.raises(ConfigError, match="not an ONNX network"):
        load_network(tmp_path / "junk.onnx", 5)


def test_a_torchscript_module_that_returns_more_than_an_action_is_refused(tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")

    class Pair(torch.nn.Module):
        def forward(self, x):  # noqa: ANN001, ANN202  (TorchScript reads the annotations)
            return x, x

    torch.jit.script(Pair()).save(str(tmp_path / "pair.pt"))
    with pytest.raises(ConfigError, match="does not return one tensor"):
        load_network(tmp_path / "pair.pt", 12)


@pytest.mark.parametrize("own_reset", [True, False])
def test_a_torchscript_module_runs_and_forgets(tmp_path: Path, own_reset: bool) -> None:
    torch = pytest.importorskip("torch")

    class Summing(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.register_buffer("seen", torch.zeros(1, 12))

        def forward(self, x):  # noqa: ANN001, ANN202  (TorchScript reads the annotations)
            self.seen = self.seen + x.sum()
            return self.seen

    class Clearing(Summing):
        @torch.jit.export
        def reset_memory(self):  # noqa: ANN202
            self.seen.zero_()  # pyright: ignore[reportAttributeAccessIssue]

    path = tmp_path / "net.pt"
    torch.jit.script(Clearing() if own_reset else Summing()).save(str(path))
    network = load_network(path, 4)
    x = np.ones(4, dtype=np.float32)
    assert [network(x)[0], network(x)[0]] == [4.0, 8.0]
    network.reset()
    assert network(x)[0] == 4.0


def test_a_torchscript_module_that_does_not_fit_is_answered(tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    path = tmp_path / "net.pt"
    torch.jit.script(torch.nn.Linear(5, 12)).save(str(path))
    assert load_network(path, 5)(np.zeros(5, dtype=np.float32)).shape == (12,)
    with pytest.raises(ConfigError, match="does not take the 6 values") as caught:
        load_network(path, 6)
    assert "\n" not in str(caught.value)
    torch.jit.script(torch.nn.Linear(5, 3)).save(str(path))
    with pytest.raises(ConfigError, match=r"returns \(3,\)"):
        load_network(path, 5)
    path.write_bytes(b"junk")
    with pytest.raises(ConfigError, match="not a TorchScript module"):
        load_network(path, 5)


def test_torch_is_named_where_it_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "net.pt"
    path.write_bytes(b"")
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(MissingExtra, match=r"'torch' is not installed.*golem-humanoid\[train\]"):
        load_network(path, 5)


OWN = "left_hip_yaw,left_hip_pitch,left_hip_roll,left_knee,left_ankle_pitch,left_ankle_roll"
OWN = f"{OWN},{OWN.replace('left', 'right')}"
