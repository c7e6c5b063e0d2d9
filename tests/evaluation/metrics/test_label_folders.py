"""Folders of labelled images as others lay them out: each box is where it was drawn, or a sentence says why not."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from golem.errors import ConfigError
from golem.evaluation.metrics.yolo_labels import read_labelled

BOX = [10.0, 20.0, 30.0, 40.0]
"""Corners of the one box [px] of an image of 64 x 48."""


def picture(path: Path, size: tuple[int, int] = (64, 48)) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new("RGB", size, (90, 90, 90)).save(path)


def coco(path: Path, name: str = "a.png", encoding: str = "utf-8", **changes: Any) -> None:
    """Write a file in COCO format with one image and one box; `changes` replace its lists."""
    data = {
        "images": [{"id": 1, "file_name": name, "width": 64, "height": 48}],
        "annotations": [{"id": 1, "image_id": 1, "category_id": 3, "bbox": [10, 20, 20, 20], "iscrowd": 0}],
        "categories": [{"id": 3, "name": "Screw Head"}],
    } | changes
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({k: v for k, v in data.items() if v is not None}), encoding=encoding)


def yolo(folder: Path, rows: str, data: str = "names: [screw, nut]\n") -> Path:
    picture(folder / "train" / "images" / "a.png")
    (folder / "data.yaml").write_text(data)
    (folder / "train" / "labels").mkdir(parents=True)
    (folder / "train" / "labels" / "a.txt").write_text(rows)
    return folder


@pytest.mark.parametrize(
    ("file", "images"),
    [
        ("_annotations.coco.json", ""),
        ("labels.json", "images"),
        ("train/_annotations.coco.json", "train"),
        ("annotations/instances_val2017.json", "val2017"),
        ("annotations/instances_default.json", "images/default"),
        ("annotations/instances_default.json", "images"),
        ("annotations/train.json", "images"),
    ],
    ids=["flat", "images", "Roboflow", "COCO", "CVAT", "CVAT, older", "others"],
)
def test_the_layouts_of_coco(file: str, images: str, tmp_path: Path) -> None:
    picture(tmp_path / images / "a.png")
    coco(tmp_path / file)
    if "instances" in file:  # COCO itself has others beside
        coco(tmp_path / "annotations" / "captions_val2017.json", categories=None)
    (tmp_path / "notes.json").write_text("{}")
    (image,) = read_labelled(tmp_path)
    assert image.path == tmp_path / images / "a.png" and image.labels == ("screw_head",)
    assert image.split == {"instances_val2017": "val2017", "instances_default": "default"}.get(
        Path(file).stem, Path(file).stem
    )
    np.testing.assert_array_equal(image.boxes, [BOX])


def test_roboflow_has_a_file_in_each_split(tmp_path: Path) -> None:
    for split in ("train", "valid", "test"):
        picture(tmp_path / split / "a.png")
        coco(tmp_path / split / "_annotations.coco.json")
    assert [image.path.parent.name for image in read_labelled(tmp_path)] == ["test", "train", "valid"]


@pytest.mark.parametrize(
    ("changes", "boxes"),
    [
        ({"annotations": [{"image_id": 99, "category_id": 3, "bbox": [1, 1, 9, 9]}]}, []),
        ({"annotations": []}, []),
        ({"annotations": [{"image_id": 1.0, "category_id": 3.0, "bbox": [10, 20, 20, 20]}]}, [BOX]),
        (
            {
                "images": [{"id": "img1", "file_name": "a.png"}],
                "categories": [{"id": "s", "name": "Screw Head"}],
                "annotations": [{"image_id": "img1", "category_id": "s", "bbox": ["10", 20, 20, 20]}],
            },
            [BOX],
        ),
    ],
    ids=["of an image left out", "none", "ids as fractions", "ids as words"],
)
def test_what_pycocotools_takes(changes: dict[str, Any], boxes: list[list[float]], tmp_path: Path) -> None:
    picture(tmp_path / "a.png")
    coco(tmp_path / "a.json", encoding="utf-8-sig", **changes)
    (image,) = read_labelled(tmp_path)
    np.testing.assert_array_equal(image.boxes, np.array(boxes).reshape(-1, 4))


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"annotations": None}, "it has no list `annotations`"),
        ({"categories": None}, "it has no list `categories`"),
        ({"images": {"a": 1}}, "it has no list `images`"),
        ({"images": [{"file_name": "a.png"}]}, "an entry of `images` is no mapping with an id"),
        ({"images": [{"id": 1}]}, "an image has no `file_name`"),
        ({"annotations": [{"image_id": 1, "bbox": [1, 1, 2, 2]}]}, "an annotation has no `category_id`"),
        ({"annotations": [{"image_id": 1, "category_id": 3}]}, "the bbox of .* is no list of x, y, width"),
        ({"annotations": [{"image_id": 1, "category_id": 4, "bbox": [1, 1, 2, 2]}]}, r"of class 4; .* 3 \(screw"),
        ({"annotations": [{"image_id": 1, "category_id": 3, "bbox": [50, 20, 20, 20]}]}, "not in its 64 x 48 pixels"),
        ({"annotations": [{"image_id": 1, "category_id": 3, "bbox": [-9, 20, 20, 20]}]}, r"corner \(-9, 20, 11, 40\)"),
        (
            {"images": [{"id": 1, "file_name": "a.png", "width": 128, "height": 96}]},
            "has 64 x 48 pixels, in .* 128 x 96: boxes do not fit",
        ),
        ({"images": [{"id": k, "file_name": "a.png"} for k in (1, 2)]}, "a.png is listed twice"),
    ],
)
def test_what_is_wrong_is_said_without_python(changes: dict[str, Any], match: str, tmp_path: Path) -> None:
    picture(tmp_path / "a.png")
    coco(tmp_path / "a.json", **changes)
    with pytest.raises(ConfigError, match=match) as refusal:
        read_labelled(tmp_path)
    assert not any(word in str(refusal.value) for word in ("Error", "Traceback", "NoneType", "\n"))


@pytest.mark.parametrize(
    ("shape", "row"),
    [
        ("[2, 2]", "0 0.5 0.5 0.1 0.1 0.48 0.48 0.52 0.52"),
        ("[2, 3]", "0 0.5 0.5 0.1 0.1 0.48 0.48 1 0.52 0.52 1"),
        ("[2, 3]", "0 0.5 0.5 0.1 0.1 0.48 0.48 2 0 0 0"),
        ("[3, 2]", "0 0.5 0.5 0.1 0.1 0 0 0.9 0.9 0.1 0.8"),
        ("[1, 3]", "0 0.5 0.5 0.1 0.1 0.48 0.48 2.0"),
        ("[17, 3]", "0 0.5 0.5 0.1 0.1" + " 0.9 0.1 2" * 17),
    ],
)
def test_key_points_are_no_polygon(shape: str, row: str, tmp_path: Path) -> None:
    (image,) = read_labelled(yolo(tmp_path, row, f"names: [screw]\nkpt_shape: {shape}\n"))
    np.testing.assert_allclose(image.boxes, [[28.8, 21.6, 35.2, 26.4]])


@pytest.mark.parametrize(
    ("row", "label"),
    [
        ("0.0 0.5 0.5 0.25 0.25", "screw"),
        ("1e0 0.5 0.5 0.25 0.25", "nut"),
        ("\ufeff1 0.5 0.5 0.25 0.25", "nut"),
        ("1\t0.375 0.375 0.625 0.375 0.625 0.625 0.375 0.625\r\n", "nut"),
    ],
)
@pytest.mark.parametrize(
    "data",
    [
        "names: [screw, nut]\n",
        "names: {0: screw, 1: nut}\n",
        'names: {"1": nut, "0": screw}\n',
        "\ufeffnames: [screw, nut]\n",
    ],
)
def test_numbers_of_classes_however_they_are_written(row: str, label: str, data: str, tmp_path: Path) -> None:
    (tmp_path / "labels").mkdir()  # a parent of this name is no folder of labels
    folder = yolo(tmp_path / "labels" / "set", row, data)
    (folder / "notes.json").write_text("{}")
    (folder / "export.json").write_text('[{"id": 1, "annotations": []}]')
    (folder / "train.txt").write_text("./train/images/a.png\n")
    (folder / "hyp.yaml").write_text("lr0: 0.01\n")
    (image,) = read_labelled(folder)
    assert image.labels == (label,)
    np.testing.assert_allclose(image.boxes, [[24, 18, 40, 30]])


@pytest.mark.parametrize(
    ("row", "data", "match"),
    [
        ("0.5 0.5 0.5 0.2 0.2", "names: [screw]\n", "line 1: these are not the numbers of a class"),
        ("2.0 0.5 0.5 0.2 0.2", "names: [screw]\n", "class 2 is none of the 1"),
        ("0 0.95 0.5 0.3 0.2", "names: [screw]\n", "line 1: the box .* is not in its 64 x 48 pixels"),
        ("0 0.5 0.5 0.1 0.1 0.4 0.4 1", "names: [screw]\n", "`kpt_shape` in the YAML file"),
        ("0 0.5 0.5 0.1 0.1 0.4 0.4 2 0.4 0.4 2", "names: [screw]\n", "`kpt_shape` in the YAML file"),
        ("0 0.5 0.5 0.1 0.1 0.4 0.4", "names: [screw]\nkpt_shape: [2, 2]\n", "are 8 numbers, not 6"),
        ("0 0.5 0.5 0.1 0.1", "names: [screw]\nkpt_shape: 2\n", r"it is \[points, 2\] or"),
    ],
)
def test_rows_that_are_no_labels_are_named(row: str, data: str, match: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=match):
        read_labelled(yolo(tmp_path, row, data))


def test_a_photograph_on_its_side_has_the_size_that_is_seen(tmp_path: Path) -> None:
    folder = yolo(tmp_path, "0 0.5 0.5 0.5 0.25")
    exif = Image.Exif()
    exif[274] = 6
    Image.new("RGB", (48, 64)).save(folder / "train" / "images" / "a.jpg", exif=exif)
    (folder / "train" / "images" / "a.png").unlink()
    (image,) = read_labelled(folder)
    assert image.read().shape == (48, 64, 3)
    np.testing.assert_allclose(image.boxes, [[16, 18, 48, 30]])
