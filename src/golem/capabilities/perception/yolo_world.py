"""YOLO-World, or any other YOLO, as its ONNX export: the user's own weights, run by onnxruntime.

A YOLO-World is exported after its classes were set, and carries their names in its metadata (`names`, `imgsz`), as do
all exports of that family. Nothing of ultralytics, which is AGPL, is needed or imported here.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np
import onnxruntime
from numpy.typing import NDArray

from golem.capabilities.perception.lift import Box, LiftConfig, lift_boxes
from golem.errors import ConfigError, unknown_name
from golem.options import require
from golem.types import Array, LocalizedObject, RgbdImage

GREY = 114
"""What an image is padded with, as in training."""


@dataclass(frozen=True)
class YoloWorldConfig:
    """Options of `YoloWorld`.

    Attributes:
        weights: the ONNX file.
        rename: name of a class in the file -> label; other classes are their name in small letters, `bus_bar` for
            `Bus Bar`.
        threshold: smallest score of a box.
        overlap: share of two boxes' union that makes them one thing.
        latency: declared time per frame [s].
        lift: how depth is read.
    """

    weights: Path
    rename: dict[str, str] = field(default_factory=dict[str, str])
    threshold: float = 0.25
    overlap: float = 0.6
    latency: float = 0.2
    lift: LiftConfig = field(default_factory=LiftConfig)

    def __post_init__(self) -> None:
        require(
            "yolo_world ",
            ("threshold", self.threshold, 0.0 < self.threshold < 1.0, "between 0 and 1"),
            ("overlap", self.overlap, 0.0 < self.overlap <= 1.0, "from 0 to 1"),
        )


class YoloWorld:
    """The `classes` that the user's export knows, in the order of the network's; see `Localizer`."""

    def __init__(self, config: YoloWorldConfig) -> None:
        """Load the network. Raises ConfigError: the file is absent, no network, no such export, or cannot be run."""
        self.config = config
        self.latency = config.latency
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        try:
            raw = config.weights.expanduser().read_bytes()
        except OSError as error:
            raise ConfigError(f"The weights {config.weights} cannot be read: {error.strerror}.") from error
        try:
            self._session = onnxruntime.InferenceSession(raw, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # onnxruntime's errors have no common base
            raise ConfigError(f"The weights {config.weights} are not an ONNX network.") from error
        names = _names(self._session.get_modelmeta().custom_metadata_map.get("names", ""))
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        shape = inputs[0].shape
        if not names or len(inputs) != 1 or len(shape) != 4:
            raise ConfigError(
                f"{config.weights} is no YOLO export: it has no class names, or its input is no image. Export it with "
                "yolo export format=onnx."
            )
        for name in config.rename:
            if name not in names:
                raise unknown_name(f"class of {config.weights.name}", name, names)
        self.classes = tuple(config.rename.get(name, name.lower().replace(" ", "_")) for name in names)
        self._name, self._outputs = inputs[0].name, [outputs[0].name]
        self._size = (_side(shape[2]), _side(shape[3]))
        self.boxes(np.full((*self._size, 3), GREY, np.uint8))  # what cannot run, or answers otherwise, is found now

    def boxes(self, image: NDArray[np.uint8]) -> list[Box]:
        """Return all boxes in (height, width, 3) RGB, best first. Raises ConfigError: the answer has another shape."""
        x, scale, shift = letterbox(image, self._size)
        try:
            answer = np.asarray(self._session.run(self._outputs, {self._name: x})[0], np.float64)
        except Exception as error:  # onnxruntime's errors have no common base
            raise ConfigError(
                f"{self.config.weights} cannot be run on an image of {x.shape[3]} x {x.shape[2]} pixels."
            ) from error
        corners, scores, classes = self._read(answer)
        corners = (corners - np.tile(shift, 2)) / scale - 0.5
        found: list[Box] = []
        for k in np.unique(classes):
            own = np.flatnonzero(classes == k)
            found += [
                Box(self.classes[int(k)], float(scores[i]), corners[i])
                for i in own[distinct(corners[own], scores[own], self.config.overlap)]
            ]
        return sorted(found, key=lambda box: -box.score)

    def locate(self, frame: RgbdImage, labels: Sequence[str]) -> list[LocalizedObject]:
        for label in labels:
            if label not in self.classes:
                raise unknown_name("label", label, self.classes)
        if not labels:
            return []
        boxes = (box for box in self.boxes(frame.rgb) if box.label in labels)
        return lift_boxes(frame, boxes, self.config.lift)

    def _read(self, answer: Array) -> tuple[Array, Array, NDArray[np.int64]]:
        """Return corners (n, 4) in the padded image, scores (n,) and classes (n,) above the threshold.

        (1, 4 + classes, n) holds middle, size and scores; (1, n, 6), of an export with its own suppression, holds
        corners, score and class.
        """
        count = len(self.classes)
        if answer.ndim == 3 and answer.shape[1] == 4 + count:
            rows = answer[0].T
            classes = rows[:, 4:].argmax(axis=1)
            scores = rows[np.arange(len(rows)), 4 + classes]
            half = rows[:, 2:4] / 2.0
            corners = np.column_stack([rows[:, :2] - half, rows[:, :2] + half])
        elif answer.ndim == 3 and answer.shape[2] == 6:
            corners, scores, numbers = answer[0, :, :4], answer[0, :, 4], answer[0, :, 5]
            told = scores > 0.0
            odd = (numbers[told] % 1.0 > 0.0) | (numbers[told] >= count)
            if odd.any() or (corners[told, 2:] < corners[told, :2]).any():
                raise ConfigError(
                    f"{self.config.weights} answers with shape {answer.shape}, but not with corners, score and class: "
                    f"a box ends before it begins, or a class is none of its {count} (YOLOv5 answers so). Export it "
                    "with nms=True."
                )
            classes = np.where(np.isfinite(numbers), numbers, -1.0).astype(np.int64)
        else:
            raise ConfigError(
                f"{self.config.weights} answers with shape {answer.shape}, not (1, {4 + count}, n) or (1, n, 6)."
            )
        sound = (scores >= self.config.threshold) & (classes >= 0) & (classes < count)
        sound &= np.isfinite(corners).all(axis=1)
        return corners[sound], np.minimum(scores[sound], 1.0), classes[sound]


def letterbox(image: NDArray[np.uint8], size: tuple[int, int]) -> tuple[NDArray[np.float32], float, Array]:
    """Return an RGB image (h, w, 3) in a grey one, (1, 3, height, width) from 0 to 1, the scale, and the shift (2,).

    The grey one has the `size`, height and width, that the network takes; the shift is along x and y [px].
    """
    height, width = image.shape[:2]
    scale = min(size[0] / height, size[1] / width)
    rows, columns = round(height * scale), round(width * scale)
    top, left = (size[0] - rows) // 2, (size[1] - columns) // 2
    canvas = np.full((*size, 3), GREY, np.uint8)
    canvas[top : top + rows, left : left + columns] = cv2.resize(image, (columns, rows), interpolation=cv2.INTER_LINEAR)
    x = np.ascontiguousarray(canvas.transpose(2, 0, 1)[None], np.float32) / np.float32(255.0)
    return x, scale, np.array([left, top], float)


def distinct(corners: Array, scores: Array, overlap: float) -> list[int]:
    """Return which boxes (n, 4) stay, best first, when each takes those that share more than `overlap` with it."""
    order = np.argsort(-scores, kind="stable")
    area = np.prod(np.maximum(corners[:, 2:] - corners[:, :2], 0.0), axis=1)
    kept: list[int] = []
    for k in order.tolist():
        low = np.maximum(corners[kept, :2], corners[k, :2])
        shared = np.prod(np.maximum(np.minimum(corners[kept, 2:], corners[k, 2:]) - low, 0.0), axis=1)
        if not len(kept) or (shared <= overlap * (area[kept] + area[k] - shared)).all():
            kept.append(k)
    return kept


def _names(text: str) -> tuple[str, ...]:
    """Return the class names of an export's metadata, e.g. `{0: 'screw', 1: 'nut'}`; empty where it holds none."""
    try:
        said = ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return ()
    if isinstance(said, Mapping):
        named = cast("Mapping[Any, Any]", said)
        said = [named[key] for key in sorted(named)] if all(isinstance(key, int) for key in named) else []
    return tuple(str(name) for name in said) if isinstance(said, list | tuple) else ()


def _side(value: object) -> int:
    """Return a side of the network's input; one that may vary is 640 px."""
    return value if isinstance(value, int) and value > 0 else 640
