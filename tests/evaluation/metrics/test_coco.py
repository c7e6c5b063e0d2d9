"""COCO folders, and the average precision against a hand-counted example."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from golem.errors import ConfigError
from golem.evaluation.metrics.coco import LabelledImage, read_coco, score_label
from golem.evaluation.speed.localizer_bench import LocalizerBenchConfig, run_localizer_bench
from golem.types import Array, Detection


def folder(tmp_path: Path, annotations: list[dict[str, object]] | None = None) -> Path:
    cv2.imwrite(str(tmp_path / "one.png"), np.full((480, 640, 3), 120, np.uint8))
    data = {
        "images": [{"id": 4, "file_name": "one.png"}],
        "categories": [{"id": 1, "name": "Screw"}, {"id": 2, "name": "Bus Bar"}],
        "annotations": annotations
        or [
            {"image_id": 4, "category_id": 2, "bbox": [10, 20, 30, 40]},
            {"image_id": 4, "category_id": 1, "bbox": [0, 0, 9, 9], "iscrowd": 1},
        ],
    }
    (tmp_path / "annotations.json").write_text(json.dumps(data))
    return tmp_path


def detection(label: str, score: float, *box: float) -> Detection:
    corners: Array = np.array(box)
    return Detection(label, score, corners, corners.reshape(2, 2).mean(axis=0))


def test_a_folder_is_read(tmp_path: Path) -> None:
    (image,) = read_coco(folder(tmp_path))
    assert image.labels == ("bus_bar", "screw")
    np.testing.assert_array_equal(image.boxes, [[10, 20, 40, 60], [0, 0, 9, 9]])
    assert image.ignored == image.crowds == (1,)
    assert image.read().shape == (480, 640, 3)


def test_what_is_no_such_folder_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="it has none"):
        read_coco(tmp_path)
    (tmp_path / "a.json").write_text("[]")
    with pytest.raises(ConfigError, match="in COCO format .*; it has a.json"):
        read_coco(tmp_path)
    (tmp_path / "b.json").write_text("{}")
    with pytest.raises(ConfigError, match="a.json, b.json"):
        read_coco(tmp_path)


def test_an_image_that_is_absent_is_named(tmp_path: Path) -> None:
    folder(tmp_path)
    (tmp_path / "one.png").unlink()
    with pytest.raises(ConfigError, match="one.png is neither in"):
        read_coco(tmp_path)


def test_average_precision_of_a_counted_example() -> None:
    images = [
        LabelledImage(Path("a"), ("nut", "nut"), np.array([[0, 0, 10, 10], [20, 0, 30, 10]], float)),
        LabelledImage(Path("b"), ("nut",), np.array([[0, 0, 10, 10]], float)),
    ]
    found = {
        0: [detection("nut", 0.9, 0, 0, 10, 10), detection("nut", 0.8, 50, 50, 60, 60)],
        1: [
            detection("nut", 0.7, 1, 0, 11, 10),
            detection("nut", 0.6, 0, 0, 10, 10),
            detection("screw", 1, 0, 0, 9, 9),
        ],
    }
    score = score_label("nut", images, found, 0.5)
    # By score: hit, miss, hit, miss; 1/3 of the boxes at precision 1, the next third at 2/3.
    assert score.ap == pytest.approx(1 / 3 + 1 / 3 * 2 / 3)
    assert (score.count, score.false) == (3, 1.0)
    assert score.centre == pytest.approx(0.5)
    nothing = score_label("nut", images, {0: [], 1: []}, 0.5)
    assert nothing.ap == 0.0 and np.isnan(nothing.centre)


def test_what_is_found_on_an_ignored_box_is_neither_right_nor_wrong(tmp_path: Path) -> None:
    row: dict[str, object] = {"image_id": 4, "category_id": 1}
    annotations: list[dict[str, object]] = [
        row | {"bbox": [0, 0, 10, 10]},
        row | {"bbox": [100, 0, 10, 10], "ignore": 1},
        row | {"bbox": [200, 0, 100, 100], "iscrowd": 1},
    ]
    images = read_coco(folder(tmp_path, annotations))
    assert (images[0].ignored, images[0].crowds) == ((1, 2), (2,))
    asked = detection("screw", 0.5, 0, 0, 10, 10)
    ignored = detection("screw", 0.9, 100, 0, 110, 10)
    crowd = [detection("screw", 0.8, 200 + x, 0, 210 + x, 10) for x in (0, 30, 60)]
    right = score_label("screw", images, {0: [asked, ignored, *crowd]}, 0.5)
    assert (right.count, right.ap, right.false, right.centre) == (1, 1.0, 0.0, 0.0)
    # An ignored box takes one detection, and no part of it is a crowd's share.
    doubled = score_label("screw", images, {0: [asked, ignored, ignored]}, 0.5)
    assert (doubled.ap, doubled.false) == (0.5, 1.0)
    part = score_label("screw", images, {0: [asked, detection("screw", 0.4, 100, 0, 103, 3)]}, 0.5)
    assert (part.ap, part.false) == (1.0, 1.0)


def test_a_box_that_is_asked_for_goes_before_an_ignored_one() -> None:
    both: Array = np.array([[0, 0, 10, 10], [0, 0, 10, 9]], float)
    image = LabelledImage(Path("a"), ("nut", "nut"), both, ignored=(0,))
    score = score_label("nut", [image], {0: [detection("nut", 0.9, 0, 0, 10, 10)]}, 0.5)
    assert (score.count, score.ap) == (1, 1.0)


def test_the_bench_scores_any_localizer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scores = run_localizer_bench(LocalizerBenchConfig(folder(tmp_path), json=True))
    assert scores["bus_bar"].count == 1
    said = capsys.readouterr().out
    assert json.loads(said.splitlines()[-1])["labels"]["bus_bar"]["count"] == 1
    with pytest.raises(ConfigError, match="valid: bus_bar"):
        run_localizer_bench(LocalizerBenchConfig(tmp_path, labels=("screw",)))
