"""Folders in YOLO's format: one text file of boxes beside, or in `labels` instead of `images`, for each image."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import yaml

from golem.errors import ConfigError
from golem.evaluation.metrics.coco import EDGE, LabelledImage, check_boxes, coco_files, image_size, label_of, read_coco
from golem.types import Array

KINDS = (".jpg", ".jpeg", ".png", ".bmp", ".webp")
"""Endings of images."""
NAMES = ("classes.txt", "obj.names")
"""Files with the name of a class in each line."""


def read_yolo(folder: Path) -> list[LabelledImage]:
    """Return the images of a folder, wherever in it they are.

    The labels of `images/train/a.jpg` are `labels/train/a.txt`, those of `a.jpg` without such a folder are `a.txt`; an
    image without them shows nothing. Class names are those of `names` in the folder's one YAML file that has them, or
    the lines of `classes.txt`; they are told in small letters, with `_` for a space. Where the YAML file has a
    `kpt_shape`, each box is followed by so many key points, which are left out. Raises ConfigError: there are no
    images, no names, labels without an image, a box that is not in its image, or a file is not in this format.
    """
    folder = folder.expanduser()
    classes = _classes(folder)
    images = sorted(p for p in folder.rglob("*") if p.suffix.lower() in KINDS)
    if not images:
        raise ConfigError(f"{folder} holds no images ({', '.join(KINDS)}).")
    texts = [_text_of(path, folder) for path in images]
    for text in sorted(folder.rglob("*.txt")):
        if text not in texts and text.name not in NAMES and "labels" in text.relative_to(folder).parts:
            raise ConfigError(f"The labels {text.relative_to(folder)} have no image in {folder}.")
    return [_read(image, text, classes) for image, text in zip(images, texts, strict=True)]


class _Classes(NamedTuple):
    """What labels mean: names in the order of their numbers, key points (how many, numbers each), and the file."""

    names: list[str]
    points: tuple[int, int]
    source: str


def _classes(folder: Path) -> _Classes:
    files = sorted([*folder.glob("*.yaml"), *folder.glob("*.yml")])
    said: dict[Path, Mapping[str, Any]] = {}
    for file in files:
        try:
            content = yaml.safe_load(file.read_text(encoding="utf-8-sig"))
        except (OSError, ValueError, yaml.YAMLError) as error:
            raise ConfigError(f"{file} is no YAML file.") from error
        if isinstance(content, Mapping) and "names" in content:
            said[file] = cast("Mapping[str, Any]", content)
    lists = [folder / name for name in NAMES if (folder / name).is_file()]
    if len(said) > 1 or not (said or lists):
        found = ", ".join(file.name for file in files) or "none"
        raise ConfigError(
            f"{folder} needs {NAMES[0]} or one YAML file with the `names` of the classes; it has {found}."
        )
    file, data = next(iter(said.items()), (folder, cast("Mapping[str, Any]", {})))
    shape: Any = data.get("kpt_shape")
    if shape is not None and not (
        isinstance(shape, list) and len(shape) == 2 and all(isinstance(n, int) for n in shape) and shape[1] in (2, 3)
    ):
        raise ConfigError(f"{file} has the kpt_shape {shape}; it is [points, 2] or [points, 3].")
    points = (0, 0) if shape is None else (shape[0], shape[1])
    if lists:
        lines = lists[0].read_text(encoding="utf-8-sig", errors="replace").splitlines()
        return _Classes([label_of(line.strip()) for line in lines if line.strip()], points, lists[0].name)
    names: Any = data["names"]
    if isinstance(names, Mapping):
        numbered = {str(key): name for key, name in cast("Mapping[Any, Any]", names).items()}
        names = [numbered.get(str(k)) for k in range(len(numbered))]
    if not isinstance(names, list) or not names or None in names:
        raise ConfigError(f"{file} has no `names` of classes, numbered from 0 without a gap.")
    return _Classes([label_of(str(name)) for name in cast("list[Any]", names)], points, file.name)


def _text_of(image: Path, folder: Path) -> Path:
    """Return where the labels of an image are: as ultralytics has it, in `labels` for the last `images`."""
    parts = list(image.relative_to(folder).with_suffix(".txt").parts)
    for k in range(len(parts) - 2, -1, -1):
        if parts[k] == "images":
            parts[k] = "labels"
            break
    return folder.joinpath(*parts)


def _read(image: Path, text: Path, classes: _Classes) -> LabelledImage:
    labels: list[str] = []
    boxes: list[Array] = []
    names = classes.names
    if text.is_file():
        width, height = image_size(image)
        for number, line in enumerate(text.read_text(encoding="utf-8-sig", errors="replace").splitlines(), 1):
            words = line.split()
            if not words:
                continue
            where = f"{text}, line {number}"
            try:
                first, numbers = float(words[0]), np.array([float(word) for word in words[1:]])
                kind = int(words[0]) if not first.is_integer() else int(first)
            except ValueError as error:
                raise ConfigError(f"{where}: these are not the numbers of a class and a box.") from error
            if not 0 <= kind < len(names):
                raise ConfigError(
                    f"{where}: class {kind} is none of the {len(names)} of {classes.source}: {', '.join(names)}."
                )
            labels.append(names[kind])
            box = _box(numbers, classes.points, where) * np.tile([width, height], 2)
            check_boxes(where, box[np.newaxis], width, height)
            boxes.append(box)
    return LabelledImage(image, tuple(labels), np.array(boxes).reshape(-1, 4))


def _box(numbers: Array, points: tuple[int, int], where: str) -> Array:
    """Return the corners (4,) of a box as middle and size, or of a polygon, all as shares of the image."""
    count, each = points
    if count and len(numbers) not in (4, 4 + count * each):
        raise ConfigError(
            f"{where}: a box and {count} points of {each} numbers (kpt_shape) are {4 + count * each} numbers, not "
            f"{len(numbers)}."
        )
    numbers = numbers[:4] if count else numbers
    if not np.isfinite(numbers).all() or numbers.min(initial=0.0) < -EDGE or numbers.max(initial=0.0) > 1 + EDGE:
        raise ConfigError(
            f"{where}: a box is given in shares of the image, from 0 to 1; key points after it need a `kpt_shape` in "
            "the YAML file."
        )
    if len(numbers) == 4:
        return np.concatenate([numbers[:2] - numbers[2:] / 2.0, numbers[:2] + numbers[2:] / 2.0])
    if len(numbers) >= 6 and len(numbers) % 2 == 0:
        corners = numbers.reshape(-1, 2)
        return np.concatenate([corners.min(axis=0), corners.max(axis=0)])
    raise ConfigError(
        f"{where}: a class is followed by 4 numbers of a box, by the corners of a polygon, or, with a `kpt_shape` in "
        "the YAML file, by a box and its key points."
    )


def read_labelled(folder: Path) -> list[LabelledImage]:
    """Return the images of a folder in COCO format, where it is, or YOLO's. Raises ConfigError: it is neither."""
    folder = folder.expanduser()
    if not folder.is_dir():
        raise ConfigError(f"There is no folder {folder}.")
    return read_coco(folder) if coco_files(folder) else read_yolo(folder)
