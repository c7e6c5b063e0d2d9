"""Training resumes where it stopped, and the exported network is the trained one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import onnxruntime
import pytest

torch = pytest.importorskip("torch", reason="training needs the extra 'train'")

from golem.capabilities.perception.onnx_detector import OnnxDetector, OnnxDetectorConfig  # noqa: E402
from golem.training.detector.dataset import Labelled  # noqa: E402
from golem.training.detector.evaluate import draw_curve  # noqa: E402
from golem.training.detector.labels import CLASSES  # noqa: E402
from golem.training.detector.part_net import PartNet, export_onnx  # noqa: E402
from golem.training.detector.train_detector import (  # noqa: E402
    TrainDetectorConfig,
    load_onnx,  # noqa: E402
    set_apart,  # noqa: E402
    train,
)


@pytest.fixture(scope="module")
def splits(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two tiny splits: one bright square as a nut on noise."""
    folder = tmp_path_factory.mktemp("data")
    for split in ("train", "held_out"):
        (folder / split).mkdir()
        rng = np.random.default_rng(0)
        arrays = {}
        for k in range(4):
            image = rng.integers(0, 80, (120, 160, 3), dtype=np.uint8)
            image[50:60, 70:80] = 255
            camera = ("head", "palm")[k % 2]
            arrays[f"image_{camera}_{k:04d}"] = np.asarray(cv2.imencode(".png", image)[1])
            arrays[f"label_{camera}_{k:04d}"] = np.array([[2, 74.5, 54.5, 70, 50, 79, 59, 0]], np.float32)
            arrays[f"conditions_{camera}_{k:04d}"] = np.array(["zinc", "grey", "teal", "nominal"])
        np.savez(folder / split / "world_000.npz", **arrays)
    return folder


def test_an_interrupted_run_ends_with_the_same_weights(splits: Path, tmp_path: Path) -> None:
    config = TrainDetectorConfig(data=splits, out=tmp_path / "whole", steps=4, batch=2, check_every=2)
    train(config)
    halves = replace(config, out=tmp_path / "halves")
    train(halves, stop=2)
    train(halves)
    a, b = (torch.load(tmp_path / run / "last.pt", weights_only=True) for run in ("whole", "halves"))
    assert a["step"] == b["step"] == 4
    for key, value in a["model"].items():
        assert torch.equal(value, b["model"][key]), key
    rows = (tmp_path / "halves" / "curve.csv").read_text().splitlines()
    assert len(rows) == 3 and rows[0].startswith("step,") and rows[2].startswith("4,")
    draw_curve(tmp_path / "halves" / "curve.csv", tmp_path / "curve.png")
    assert (tmp_path / "curve.png").stat().st_size > 5000


def test_the_exported_network_computes_what_the_trained_one_does(tmp_path: Path) -> None:
    torch.manual_seed(1)
    model = PartNet(len(CLASSES))
    for name, value in model.state_dict().items():  # as after training: no batch normalisation is the identity
        if "running" in name:
            value.uniform_(0.5, 1.5)
    model.eval()
    torch.save({"average": model.state_dict(), "step": 7, "classes": list(CLASSES)}, tmp_path / "x.pt")
    path = export_onnx(tmp_path / "x.pt", tmp_path / "x.onnx")
    assert path.stat().st_size < 2_000_000
    assert OnnxDetector(OnnxDetectorConfig(weights=str(path))).classes == CLASSES
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    for size in ((96, 128), (48, 80)):
        image = torch.randn(1, 3, *size)
        with torch.inference_mode():
            expected = model(image).numpy()
        np.testing.assert_allclose(np.asarray(session.run(["maps"], {"image": image.numpy()})[0]), expected, atol=1e-4)


def test_training_goes_on_from_an_exported_network(tmp_path: Path) -> None:
    torch.manual_seed(1)
    torch.save({"average": PartNet(len(CLASSES)).state_dict(), "step": 7, "classes": list(CLASSES)}, tmp_path / "x.pt")
    path = export_onnx(tmp_path / "x.pt", tmp_path / "x.onnx")
    model = PartNet(len(CLASSES)).eval()
    load_onnx(model, path, CLASSES)
    image = torch.randn(1, 3, 64, 96)
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    with torch.inference_mode():
        np.testing.assert_allclose(
            model(image).numpy(), np.asarray(session.run(["maps"], {"image": image.numpy()})[0]), atol=1e-3
        )


def test_the_curve_of_the_shipped_weights_reaches_their_step() -> None:
    from importlib import resources

    import onnx

    file = resources.files("golem.capabilities.perception").joinpath("weights/detector.onnx")
    facts = {p.key: json.loads(p.value) for p in onnx.load_model_from_string(file.read_bytes()).metadata_props}
    curve = Path(__file__).parents[3] / "docs" / "images" / "detector_curve.csv"
    assert str(facts["step"]) in [row.split(",")[0] for row in curve.read_text().splitlines()]


@pytest.mark.parametrize("n", [1, 2, 4, 37, 700])
def test_a_checkpoint_is_chosen_on_images_that_do_not_train(n: int) -> None:
    data = [Labelled(np.full((1, 1, 3), k % 256, np.uint8), np.zeros((0, 8)), "own", {}) for k in range(n)]
    train_on, choice = set_apart(data, 80)
    assert 1 <= len(choice) <= max(1, min(80, n // 10))
    seen = {id(one.image) for one in train_on}
    assert n == 1 or not any(id(one.image) in seen for one in choice)
    assert n == 1 or len(train_on) + len(choice) == n
