"""YOLO exports: both layouts of their answer, boxes back in the image, and files that are none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from golem.capabilities.perception import yolo_world
from golem.capabilities.perception.yolo_world import YoloWorld, YoloWorldConfig, distinct, letterbox
from golem.errors import ConfigError
from golem.evaluation.conformance import samples
from golem.types import Array

SHIPPED = Path(yolo_world.__file__).parent / "weights" / "detector.onnx"
FRAME = samples.image(0.2)
NAMES = "{0: 'Screw', 1: 'Bus Bar'}"


class Session:
    """Stands in for a network that always answers the same."""

    def __init__(self, answer: Array, names: str = NAMES, size: tuple[int, int] = (640, 640)) -> None:
        self.answer, self.names, self.size = answer, names, size

    def get_modelmeta(self) -> Any:
        return type("Meta", (), {"custom_metadata_map": {"names": self.names}})

    def get_inputs(self) -> list[Any]:
        return [type("Input", (), {"name": "images", "shape": [1, 3, *self.size]})]

    def get_outputs(self) -> list[Any]:
        return [type("Output", (), {"name": "output0"})]

    def run(self, outputs: list[str], inputs: dict[str, Array]) -> list[Array]:
        assert inputs["images"].shape == (1, 3, *self.size)
        return [self.answer]


def network(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, session: Session, **options: Any) -> YoloWorld:
    monkeypatch.setattr(yolo_world.onnxruntime, "InferenceSession", lambda *_, **__: session)
    weights = tmp_path / "mine.onnx"
    weights.write_bytes(b"")
    return YoloWorld(YoloWorldConfig(weights, **options))


def dense(*rows: tuple[float, ...]) -> Array:
    return np.array(rows).T[None]


def test_the_dense_answer_comes_back_into_the_image(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    # 640 x 480 in 640 x 640: no scale, 80 px of grey above.
    answer = dense(
        (320, 320, 40, 20, 0.9, 0.1), (322, 320, 40, 20, 0.5, 0.0), (100, 200, 30, 30, 0.1, 0.8), (9, 99, 9, 9, 0.1, 0)
    )
    module = network(monkeypatch, tmp_path, Session(answer))
    assert module.classes == ("screw", "bus_bar")
    screw, bar = module.boxes(FRAME.rgb)
    np.testing.assert_allclose(screw.corners + 0.5, [300, 230, 340, 250])
    np.testing.assert_allclose(bar.corners + 0.5, [85, 105, 115, 135])
    assert (screw.label, screw.score, bar.label) == ("screw", 0.9, "bus_bar")
    (found,) = module.locate(FRAME, ["screw"])
    assert found.label == "screw" and found.mask is not None
    assert len(found.points) == np.count_nonzero(found.mask.pixels)


def test_an_export_with_its_own_suppression_is_read(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    answer = np.zeros((1, 300, 6))
    answer[0, 0] = 300, 310, 340, 330, 0.7, 1
    answer[0, 1] = 300, 310, 340, 330, np.nan, 0
    (box,) = network(monkeypatch, tmp_path, Session(answer)).boxes(FRAME.rgb)
    assert box.label == "bus_bar"
    np.testing.assert_allclose(box.corners + 0.5, [300, 230, 340, 250])


def test_classes_can_be_renamed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    session = Session(dense((320, 320, 40, 20, 0.9, 0.1)))
    assert network(monkeypatch, tmp_path, session, rename={"Screw": "bolt"}).classes == ("bolt", "bus_bar")
    with pytest.raises(ConfigError, match="Did you mean 'Screw'"):
        network(monkeypatch, tmp_path, session, rename={"Screws": "bolt"})


def test_another_answer_is_a_sentence(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"shape \(1, 84, 8400\), not \(1, 6, n\) or \(1, n, 6\)"):
        network(monkeypatch, tmp_path, Session(np.zeros((1, 84, 8400))))


@pytest.mark.parametrize(
    "row",
    [
        (31.5, 31.5, 16.0, 8.0, 0.9, 1.0),  # middle, size, objectness, class score, as YOLOv5 with one class
        (10.0, 5.0, 30.0, 30.0, 0.9, 0.97),  # one that could be corners
        (10.0, 5.0, 30.0, 30.0, 0.9, 1.0),
        (40.0, 20.0, 30.0, 30.0, 0.9, 0.0),
    ],
)
def test_one_class_of_yolov5_is_no_corners(
    row: tuple[float, ...], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=r"\(1, 1, 6\), but not with corners, score and class"):
        network(monkeypatch, tmp_path, Session(np.array([[row]]), "{0: 'screw'}"))


def test_a_network_that_cannot_run_is_found_at_the_start(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def run(outputs: list[str], inputs: dict[str, Array]) -> list[Array]:
        raise RuntimeError("INVALID_ARGUMENT")

    session = Session(np.zeros((1, 300, 6)))
    monkeypatch.setattr(session, "run", run)
    with pytest.raises(ConfigError, match="cannot be run on an image of 640 x 640 pixels"):
        network(monkeypatch, tmp_path, session)


def test_a_label_it_does_not_know_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="valid: bus_bar, screw"):
        network(monkeypatch, tmp_path, Session(np.zeros((1, 300, 6)))).locate(FRAME, ["nut"])


def test_what_is_no_export_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no YOLO export"):
        YoloWorld(YoloWorldConfig(SHIPPED))
    with pytest.raises(ConfigError, match="cannot be read"):
        YoloWorld(YoloWorldConfig(tmp_path / "none.onnx"))
    (tmp_path / "text.onnx").write_text("not a network")
    with pytest.raises(ConfigError, match="not an ONNX network"):
        YoloWorld(YoloWorldConfig(tmp_path / "text.onnx"))
    with pytest.raises(ConfigError, match="threshold"):
        YoloWorldConfig(SHIPPED, threshold=2.0)


def test_a_wide_image_is_scaled_and_padded_below_and_above() -> None:
    x, scale, shift = letterbox(np.full((270, 480, 3), 255, np.uint8), (320, 320))
    assert scale == pytest.approx(2 / 3) and shift.tolist() == [0, 70]
    assert x[0, :, 69].max() == pytest.approx(114 / 255) and x[0, :, 71].min() == 1.0


def test_boxes_of_one_thing_leave_the_best() -> None:
    boxes = np.array([[0, 0, 10, 10], [1, 0, 11, 10], [20, 0, 30, 10]], float)
    assert distinct(boxes, np.array([0.5, 0.9, 0.4]), 0.6) == [1, 2]
    assert distinct(np.zeros((0, 4)), np.zeros(0), 0.6) == []
