"""Folders in YOLO's format: one text file of boxes beside, or in `labels` instead of `images`, for each image."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np
import yaml

from golem.errors import ConfigError
from golem.evaluation.metrics.coco import LabelledImage, label_of, read_coco
from golem.types import Array

KINDS = (".jpg", ".jpeg", ".png", ".bmp", ".webp")
"""Endings of images."""
NAMES = ("classes.txt", "obj.names")
"""Files with the name of a class in each line."""


def read_yolo(folder: Path) -> list[LabelledImage]:
    """Return the images of a folder, wherever in it they are.

    The labels of `images/train/a.jpg` are `labels/train/a.txt`, those of `a.jpg` without such a folder are `a.txt`; an
    image without them shows nothing. Class names are those of `names` in the folder's one YAML file, or the lines of
    `classes.txt`; they are told in small letters, with `_` for a space.

    Raises:
        ConfigError: there are no images, no names, labels without an image, or a file is not in this format.
    """
    folder = folder.expanduser()
    names, source = _names(folder)
    images = sorted(p for p in folder.rglob("*") if p.suffix.lower() in KINDS)
    if not images:
        raise ConfigError(f"{folder} holds no images ({', '.join(KINDS)}).")
    texts = [_text_of(path, folder) for path in images]
    for text in sorted(folder.rglob("*.txt")):
        if (
            text not in texts
            and text.name not in NAMES
            and (text.parent.name == "labels" or "labels" in text.parts)
        ):
            raise ConfigError(f"The labels {text.relative_to(folder)} have no image in {folder}.")
    return [_read(image, text, names, source) for image, text in zip(images, texts, strict=True)]


def _names(folder: Path) -> tuple[list[str], str]:
    """Return the labels in the order of their numbers, and the name of the file that has them."""
    for path in (folder / name for name in NAMES):
        if path.is_file():
            lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
            return [label_of(line.strip()) for line in lines if line.strip()], path.name
    files = sorted([*folder.glob("*.yaml"), *folder.glob("*.yml")])
    if len(files) != 1:
        found = ", ".join(file.name for file in files) or "none"
        raise ConfigError(
            f"{folder} needs {NAMES[0]} or one YAML file with the names of the classes; it has {found}."
        )
    try:
        said = yaml.safe_load(files[0].read_text(encoding="utf-8"))
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise ConfigError(f"{files[0]} is no YAML file.") from error
    names: Any = cast("Mapping[str, Any]", said).get("names") if isinstance(said, Mapping) else None
    if isinstance(names, Mapping):
        numbered = cast("Mapping[Any, Any]", names)
        names = [numbered.get(k) for k in range(len(numbered))]
    if not isinstance(names, list) or not names or None in names:
        raise ConfigError(f"{files[0]} has no `names` of classes, numbered from 0 without a gap.")
    return [label_of(str(name)) for name in cast("list[Any]", names)], files[0].name


def _text_of(image: Path, folder: Path) -> Path:
    """Return where the labels of an image are: as ultralytics has it, in `labels` for the last `images`."""
    parts = list(image.relative_to(folder).with_suffix(".txt").parts)
    for k in range(len(parts) - 2, -1, -1):
        if parts[k] == "images":
            parts[k] = "labels"
            break
    return folder.joinpath(*parts)


def _read(image: Path, text: Path, names: list[str], source: str) -> LabelledImage:
    labels: list[str] = []
    boxes: list[Array] = []
    if text.is_file():
        pixels = cv2.imread(str(image))
        if pixels is None:
            raise ConfigError(f"The image {image} cannot be read.")
        size = np.array([pixels.shape[1], pixels.shape[0]] * 2, float)
        for number, line in enumerate(text.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
            words = line.split()
            if not words:
                continue
            where = f"{text}, line {number}"
            try:
                kind, numbers = int(words[0]), np.array([float(word) for word in words[1:]])
            except ValueError as error:
                raise ConfigError(f"{where}: these are not the numbers of a class and a box.") from error
            if not 0 <= kind < len(names):
                raise ConfigError(
                    f"{where}: class {kind} is none of the {len(names)} of {source}: {', '.join(names)}."
                )
            labels.append(names[kind])
            boxes.append(_box(numbers, where) * size)
    return LabelledImage(image, tuple(labels), np.array(boxes).reshape(-1, 4))


def _box(numbers: Array, where: str) -> Array:
    """Return the corners (4,) of a box as middle and size, or of a polygon, all as shares of the image."""
    if not np.isfinite(numbers).all() or numbers.min(initial=0.0) < -0.01 or numbers.max(initial=0.0) > 1.01:
        raise ConfigError(f"{where}: a box is given in shares of the image, from 0 to 1.")
    if len(numbers) == 4:
        return np.concatenate([numbers[:2] - numbers[2:] / 2.0, numbers[:2] + numbers[2:] / 2.0])
    if len(numbers) >= 6 and len(numbers) % 2 == 0:
        corners = numbers.reshape(-1, 2)
        return np.concatenate([corners.min(axis=0), corners.max(axis=0)])
    raise ConfigError(f"{where}: a class is followed by 4 numbers of a box, or by the corners of a polygon.")


def read_labelled(folder: Path) -> list[LabelledImage]:
    """Return the images of a folder in COCO format, where it has a JSON file, or in YOLO's.

    Raises:
        ConfigError: it is neither.
    """
    folder = folder.expanduser()
    if not folder.is_dir():
        raise ConfigError(f"There is no folder {folder}.")
    return read_coco(folder) if any(folder.glob("*.json")) else read_yolo(folder)
