"""Images with labelled boxes, from folders in COCO format, and the average precision of detections against them."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, cast

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from golem.errors import ConfigError
from golem.types import Array, Detection


@dataclass(frozen=True, slots=True)
class LabelledImage:
    """One image.

    Attributes:
        labels: (n,) class names of its boxes.
        boxes: (n, 4) x_min, y_min, x_max, y_max [px].
        ignored: numbers of the boxes that are neither asked for nor make what is found there wrong.
        crowds: those of them that hold any number of things.
        split: what the file that lists it is named after; empty where none does.
    """

    path: Path
    labels: tuple[str, ...]
    boxes: Array
    ignored: tuple[int, ...] = ()
    crowds: tuple[int, ...] = ()
    split: str = ""

    @property
    def counted(self) -> NDArray[np.bool_]:
        """(n,) whether a box is asked for."""
        counted = np.ones(len(self.labels), bool)
        counted[list(self.ignored)] = False
        return counted

    def read(self) -> NDArray[np.uint8]:
        """Return it as (height, width, 3) RGB. Raises ConfigError: it cannot be read."""
        image = cv2.imread(str(self.path))
        if image is None:
            raise ConfigError(f"The image {self.path} cannot be read.")
        return np.ascontiguousarray(image[:, :, ::-1], np.uint8)


def label_of(name: str) -> str:
    """Return the label of a class as others name it: in small letters, with `_` for a space."""
    return name.lower().replace(" ", "_")


@dataclass(frozen=True, slots=True)
class LabelScore:
    """How a detector did on one class.

    Attributes:
        count: labelled boxes that are not ignored.
        ap: average precision at the given overlap (all points of the curve).
        centre: median distance of the centres of matched boxes [px]; nan without any.
        false: detections that matched nothing, not even an ignored box, per image.
    """

    count: int
    ap: float
    centre: float
    false: float


def score_label(
    label: str, images: Sequence[LabelledImage], found: Mapping[int, Sequence[Detection]], overlap: float
) -> LabelScore:
    """Return the score of one class.

    As COCO counts: what matches no box that is asked for, but one that is ignored, is neither right nor wrong. A box
    takes one detection; a crowd takes all of which it holds a share of `overlap`.

    Args:
        found: detections of each image, by its number.
        overlap: least share of the union (IoU) that matches.
    """
    hits: list[tuple[float, bool]] = []
    off: list[float] = []
    count = 0
    for k, image in enumerate(images):
        own = np.array([name == label for name in image.labels], bool)
        boxes, counted, crowd = (image.boxes[own], image.counted[own], np.isin(np.flatnonzero(own), image.crowds))
        count += int(counted.sum())
        free = np.ones(len(boxes), bool)
        for detection in sorted((d for d in found[k] if d.label == label), key=lambda d: -d.score):
            shares = np.where(free, _shares(detection.box, boxes, crowd), 0.0)
            fits = shares >= overlap
            asked = fits & counted
            best = int(np.where(asked if asked.any() else fits, shares, -1.0).argmax()) if fits.any() else -1
            if best >= 0:
                free[best] = crowd[best]
            if asked.any():
                off.append(float(np.linalg.norm(detection.center - boxes[best].reshape(2, 2).mean(axis=0))))
            if asked.any() or not fits.any():
                hits.append((detection.score, bool(asked.any())))
    hits.sort(key=lambda one: -one[0])
    ap = average_precision([hit for _, hit in hits], count)
    wrong = sum(not hit for _, hit in hits) / max(len(images), 1)
    return LabelScore(count, ap, float(np.median(off)) if off else float("nan"), wrong)


def average_precision(hits: Sequence[bool], count: int) -> float:
    """Return the area under the precision-recall curve, all points of it.

    Args:
        hits: whether each detection is right, best score first.
        count: of what there is to be found.
    """
    right = np.array(hits, bool)
    precision = np.cumsum(right) / np.arange(1, len(right) + 1)
    # The curve never falls towards lower recall (all-point interpolation, PASCAL VOC 2010).
    precision = np.maximum.accumulate(precision[::-1])[::-1]
    return float(precision[right].sum() / max(count, 1))


def _shares(box: Array, boxes: Array, crowd: NDArray[np.bool_]) -> Array:
    """Return what share of the union of `box` and each of `boxes` (n, 4) is in both; of a crowd what share of `box`."""
    low, high = np.maximum(box[:2], boxes[:, :2]), np.minimum(box[2:], boxes[:, 2:])
    shared = np.prod(np.maximum(high - low, 0.0), axis=1)
    own = float(np.prod(box[2:] - box[:2]))
    union = own + np.prod(boxes[:, 2:] - boxes[:, :2], axis=1) - shared
    return shared / np.maximum(np.where(crowd, own, union), 1e-9)


EDGE = 0.01
"""By what share of the image's side a box may reach beyond it [own]: pictures are cut, labels are rounded."""
PLACES = ("*.json", "*/_annotations.coco.json", "annotations/instances*.json", "annotations/*.json")
"""Where files of annotations are looked for; the first of these places that has any counts."""
_TURNED = 274, (5, 6, 7, 8)
"""EXIF's tag of the orientation, and its values for an image that lies on its side."""


class _Row(NamedTuple):
    label: str
    box: tuple[float, float, float, float]
    ignored: bool
    crowd: bool


def coco_files(folder: Path) -> list[Path]:
    """Return the files of a folder that are in COCO format: a mapping with images, annotations or categories."""
    for place in PLACES:
        found = [path for path in sorted(folder.glob(place)) if _is_coco(path)]
        if found:
            return found
    return []


def read_coco(folder: Path) -> list[LabelledImage]:
    """Return the images of a folder that its files in COCO format name; see `PLACES`.

    Images are looked for beside the file, in the folder, and there in `images`, in the folder that the file is named
    after (`annotations/instances_val2017.json`: `val2017`) and in that of `images`. Annotations of images that are not
    listed are left out, as by pycocotools. Boxes with `iscrowd` or `ignore` are ignored. Class names are in small
    letters, with `_` for a space. Raises ConfigError: there is no such file, it is damaged, an image is absent, of
    another size or in two files, or a box is not in its image.
    """
    folder = folder.expanduser()
    files = coco_files(folder)
    if not files:
        found = ", ".join(file.name for file in sorted(folder.glob("*.json"))) or "none"
        raise ConfigError(
            f"{folder} needs a JSON file of annotations in COCO format ({', '.join(PLACES)}); it has {found}."
        )
    images = [image for file in files for image in _read(file, folder)]
    twice = [path for path, count in Counter(image.path for image in images).items() if count > 1]
    if twice:
        raise ConfigError(f"{twice[0]} is listed twice in the JSON files of {folder}; take one of them away.")
    return images


def check_boxes(where: str, boxes: Array, width: int, height: int) -> None:
    """Check that boxes (n, 4) [px] are in an image. Raises ConfigError: one is beyond by more than `EDGE`, or 2 px."""
    size = np.array([width, height], float)
    slack = np.maximum(EDGE * size, 2.0)
    wrong = (boxes[:, :2] < -slack).any(axis=1) | (boxes[:, 2:] > size + slack).any(axis=1)
    if wrong.any():
        corners = ", ".join(f"{v:g}" for v in np.round(boxes[wrong][0], 1))
        raise ConfigError(
            f"{where}: the box from corner to corner ({corners}) is not in its {width} x {height} pixels."
        )


def image_size(path: Path) -> tuple[int, int]:
    """Return width and height of an image [px], turned as its EXIF data say. Raises ConfigError: it cannot be read."""
    try:
        with Image.open(path) as image:
            turned = image.getexif().get(_TURNED[0]) in _TURNED[1]
            return (image.height, image.width) if turned else (image.width, image.height)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise ConfigError(f"The image {path} cannot be read.") from error


def _load(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8-sig"))


def _is_coco(path: Path) -> bool:
    try:
        data = _load(path)
    except (OSError, ValueError, RecursionError):
        named = path.name.endswith(".coco.json") or path.name.startswith("instances")
        return named or not any(path.parent.rglob("*.txt"))  # a damaged file, unless labels are in YOLO's format
    return isinstance(data, dict) and "images" in data and ("annotations" in data or "categories" in data)


def _read(file: Path, folder: Path) -> list[LabelledImage]:
    try:
        data = cast("dict[str, Any]", _load(file))
        absent = [key for key in ("images", "annotations", "categories") if not isinstance(data.get(key), list)]
    except (OSError, ValueError, AttributeError, RecursionError) as error:
        raise ConfigError(f"{file} is not in COCO format: it is no JSON object.") from error
    if absent:
        raise ConfigError(f"{file} is not in COCO format: it has no list `{absent[0]}`.")
    names = {
        _key(c["id"]): label_of(str(_get(file, c, "category", "name"))) for c in _entries(file, data, "categories")
    }
    images = {_key(image["id"]): image for image in _entries(file, data, "images")}
    rows: dict[str, list[_Row]] = {key: [] for key in images}
    for one in _entries(file, data, "annotations"):
        image, kind = (_key(_get(file, one, "annotation", f"{what}_id")) for what in ("image", "category"))
        if image not in rows:
            continue
        if kind not in names:
            raise ConfigError(
                f"{file}: an annotation is of class {kind}; the categories are "
                f"{', '.join(f'{key} ({name})' for key, name in names.items()) or 'none'}."
            )
        try:
            x, y, w, h = (float(v) for v in one["bbox"])
        except (KeyError, TypeError, ValueError) as error:
            what = f"annotation {one.get('id', '')} of image {image}"
            raise ConfigError(f"{file}: the bbox of {what} is no list of x, y, width, height.") from error
        crowd = bool(one.get("iscrowd"))
        rows[image].append(_Row(names[kind], (x, y, x + w, y + h), crowd or bool(one.get("ignore")), crowd))
    found: list[LabelledImage] = []
    split = file.stem.removeprefix("instances_")
    for key in sorted(images, key=lambda key: (not key.isdecimal(), int(key) if key.isdecimal() else 0, key)):
        said, own = images[key], rows[key]
        path = _image(file, folder, split, str(_get(file, said, "image", "file_name")).replace("\\", "/"))
        size = image_size(path)
        told = tuple(said.get(side) or size[k] for k, side in enumerate(("width", "height")))
        if told != size:
            raise ConfigError(
                f"The image {path} has {size[0]} x {size[1]} pixels, in {file} {told[0]} x {told[1]}: boxes do not fit."
            )
        boxes = np.array([row.box for row in own]).reshape(-1, 4)
        check_boxes(f"{file}, {path.name}", boxes, *size)
        found.append(
            LabelledImage(
                path,
                tuple(row.label for row in own),
                boxes,
                tuple(k for k, row in enumerate(own) if row.ignored),
                tuple(k for k, row in enumerate(own) if row.crowd),
                split,
            )
        )
    return found


def _entries(file: Path, data: dict[str, Any], key: str) -> Sequence[dict[str, Any]]:
    entries: list[Any] = data[key]
    for one in entries:
        if not isinstance(one, dict) or (key != "annotations" and "id" not in one):
            raise ConfigError(f"{file} is not in COCO format: an entry of `{key}` is no mapping with an id.")
    return entries


def _get(file: Path, entry: dict[str, Any], what: str, key: str) -> object:
    if key not in entry:
        raise ConfigError(f"{file} is not in COCO format: an {what} has no `{key}`.".replace("an c", "a c"))
    return entry[key]


def _key(value: object) -> str:
    """Return an id, a number or a word, as a word."""
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)


def _image(file: Path, folder: Path, split: str, name: str) -> Path:
    places = (file.parent, file.parent / "images", folder, folder / "images", folder / split, folder / "images" / split)
    for path in (place / one for one in (name, Path(name).name) for place in places):
        if path.is_file():
            return path
    raise ConfigError(f"The image {name} is neither in {file.parent} nor in {folder / 'images'}.")
