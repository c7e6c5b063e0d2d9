"""Training on the user's own labels: both formats, what is held out, and a sentence for whatever is wrong with them."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs the extra 'train'")

from golem.capabilities.perception.onnx_detector import OnnxDetector, OnnxDetectorConfig  # noqa: E402
from golem.errors import ConfigError  # noqa: E402
from golem.training.detector.detector_commands import load_own, main  # noqa: E402


def picture(rng: np.random.Generator, place: tuple[int, int]) -> np.ndarray:
    """Return noise of 320 x 240 px with a bright square of 40 px."""
    image = rng.integers(0, 80, (240, 320, 3), dtype=np.uint8)
    x, y = place
    image[y : y + 40, x : x + 40] = (40, 220, 250)
    return image


def yolo(folder: Path, count: int = 6) -> Path:
    rng = np.random.default_rng(0)
    for k in range(count):
        split = "val" if k % 3 == 2 else "train"
        for kind in ("images", "labels"):
            (folder / kind / split).mkdir(parents=True, exist_ok=True)
        x, y = (int(v) for v in rng.integers(20, 180, 2))
        cv2.imwrite(str(folder / "images" / split / f"{k}.png"), picture(rng, (x, y)))
        middle, size = ((x + 20) / 320, (y + 20) / 240), (40 / 320, 40 / 240)
        words = " ".join(f"{v:.6f}" for v in (*middle, *size))
        (folder / "labels" / split / f"{k}.txt").write_text(f"1 {words}\n")
    (folder / "data.yaml").write_text("names: {0: Nothing, 1: Orange Cover}\ntrain: images/train\n")
    return folder


def coco(folder: Path, count: int = 5) -> Path:
    rng = np.random.default_rng(0)
    places = [tuple(int(v) for v in rng.integers(20, 180, 2)) for _ in range(count)]
    for k, place in enumerate(places):
        cv2.imwrite(str(folder / f"{k}.png"), picture(rng, (place[0], place[1])))
    data = {
        "images": [{"id": k, "file_name": f"{k}.png"} for k in range(count)],
        "categories": [{"id": 3, "name": "Cap"}],
        "annotations": [{"image_id": k, "category_id": 3, "bbox": [*place, 40, 40]} for k, place in enumerate(places)],
    }
    (folder / "labels.json").write_text(json.dumps(data))
    return folder


def test_folders_of_yolo_say_what_is_held_out(tmp_path: Path) -> None:
    data, held, classes = load_own(yolo(tmp_path), 0, 640)
    assert (len(data), len(held), classes) == (4, 2, ("orange_cover",))
    kind, x, y, x0, y0, x1, y1, ignored = data[0].labels[0]
    assert (kind, x1 - x0, y1 - y0, ignored) == (0.0, pytest.approx(40, abs=0.1), pytest.approx(40, abs=0.1), 0.0)
    np.testing.assert_array_equal(data[0].image[round(y), round(x)], (250, 220, 40))
    corner = round(y0 + 0.5), round(x0 + 0.5)
    assert tuple(data[0].image[corner]) == (250, 220, 40)
    assert tuple(data[0].image[corner[0] - 1, corner[1] - 1]) != (250, 220, 40)


def test_of_coco_every_fifth_is_held_out_and_large_images_shrink(tmp_path: Path) -> None:
    data, held, classes = load_own(coco(tmp_path), 0, 160)
    assert (len(data), len(held), classes) == (4, 1, ("cap",))
    assert data[0].image.shape == (120, 160, 3)
    assert data[0].labels[0, 5] - data[0].labels[0, 3] == pytest.approx(20)


def test_one_command_makes_weights_that_the_localizer_takes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = yolo(tmp_path / "mine")
    main(["--labels", str(folder), "--out", str(tmp_path / "run"), "--steps", "2"])
    said = capsys.readouterr().out
    assert "| own | orange_cover | 2 |" in said and "use: onnx, weights:" in said
    detector = OnnxDetector(OnnxDetectorConfig(str(tmp_path / "run" / "detector.onnx")))
    assert detector.classes == ("orange_cover",)
    with pytest.raises(ConfigError, match="is of other classes"):
        (tmp_path / "caps").mkdir()
        main(["--labels", str(coco(tmp_path / "caps")), "--out", str(tmp_path / "run"), "--steps", "2"])
    again = ["--labels", str(folder), "--out", str(tmp_path / "run"), "--steps", "2"]
    with pytest.raises(ConfigError, match="is of another seed"):
        main([*again, "--seed", "1"])
    yolo(folder, 12)  # more images: what was held out before may train now
    with pytest.raises(ConfigError, match="is of other images or labels"):
        main(again)


def test_whatever_is_wrong_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="There is no folder"):
        load_own(tmp_path / "none", 0, 640)
    with pytest.raises(ConfigError, match=r"needs classes\.txt or one YAML file .* it has none"):
        load_own(tmp_path, 0, 640)
    (tmp_path / "classes.txt").write_text("cap\n")
    with pytest.raises(ConfigError, match="holds no images"):
        load_own(tmp_path, 0, 640)
    cv2.imwrite(str(tmp_path / "a.png"), picture(np.random.default_rng(0), (30, 30)))
    with pytest.raises(ConfigError, match="No image of .* has a label"):
        load_own(tmp_path, 0, 640)
    for line, sentence in (
        ("3 0.5 0.5 0.1 0.1", r"a\.txt, line 1: class 3 is none of the 1 of classes\.txt: cap"),
        ("0 0.5 0.5 0.1", "followed by 4 numbers"),
        ("0 50 50 10 10", "in shares of the image"),
        ("cap 0.5 0.5 0.1 0.1", "not the numbers of a class"),
        ("0 0.5 0.5 0.1 0.1", "all are held out"),
    ):
        (tmp_path / "a.txt").write_text(line)
        with pytest.raises(ConfigError, match=sentence):
            load_own(tmp_path, 0, 640)
    (tmp_path / "a.png").write_text("no image")
    with pytest.raises(ConfigError, match=r"a\.png cannot be read"):
        load_own(tmp_path, 0, 640)
    (tmp_path / "labels").mkdir()
    (tmp_path / "labels" / "b.txt").write_text("0 0.5 0.5 0.1 0.1")
    with pytest.raises(ConfigError, match=r"labels/b\.txt have no image"):
        load_own(tmp_path, 0, 640)


def test_broken_annotations_of_coco_are_one_sentence(tmp_path: Path) -> None:
    coco(tmp_path)
    (tmp_path / "labels.json").write_text('{"images": [')
    with pytest.raises(ConfigError, match="not in COCO format"):
        load_own(tmp_path, 0, 640)
    coco(tmp_path)
    text = (tmp_path / "labels.json").read_text().replace('"category_id": 3', '"category_id": 9', 1)
    (tmp_path / "labels.json").write_text(text)
    with pytest.raises(ConfigError, match=r"of class 9; the categories are 3 \(cap\)"):
        load_own(tmp_path, 0, 640)
    coco(tmp_path)
    (tmp_path / "2.png").unlink()
    with pytest.raises(ConfigError, match=r"2\.png is neither in"):
        load_own(tmp_path, 0, 640)


def test_ignored_boxes_are_neither_learnt_nor_held_against_it(tmp_path: Path) -> None:
    folder = coco(tmp_path)
    path = folder / "labels.json"
    data = json.loads(path.read_text())
    data["categories"].append({"id": 4, "name": "Crowd"})
    extra = {"bbox": [200, 100, 60, 60], "image_id": 0}
    data["annotations"] += [{"category_id": 3, "ignore": 1} | extra, {"category_id": 4, "iscrowd": 1} | extra]
    path.write_text(json.dumps(data))
    train, held, classes = load_own(folder, 0, 640)
    labels = np.concatenate([one.labels for one in (*train, *held)])
    assert classes == ("cap",)
    assert len(labels) == 6 and labels[:, 7].sum() == 1
