"""`golem bench localizer FOLDER`: any localizer on the user's own labelled images, a folder in COCO or YOLO format."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from golem.capabilities.perception.base import Localizer
from golem.errors import ConfigError, check_known
from golem.evaluation.harness.arguments import new_module
from golem.evaluation.metrics.coco import LabelScore, score_label
from golem.evaluation.metrics.yolo_labels import read_labelled
from golem.evaluation.speed.bench import timed
from golem.types import CameraInfo, Detection, RgbdImage

DEPTH = 0.6
"""Depth that every pixel is given [m]: labelled images have none, and a localizer leaves out what it cannot place."""


@dataclass(frozen=True)
class LocalizerBenchConfig:
    """Score a localizer on labelled images in COCO or YOLO format: average precision, centre error, latency."""

    folder: Annotated[Path, tyro.conf.Positional]
    """Where the images are, with one JSON file of annotations (COCO), or a text file each and their names (YOLO)."""
    use: str = "onnx"
    """The localizer: a name, FILE.py:Class, or {use: NAME, option: value}."""
    labels: tuple[str, ...] = ()
    """Classes that are asked for; by default all that are labelled."""
    overlap: float = 0.5
    """Least overlap (IoU) of a detection and a box that match."""
    json: bool = False
    """Print the figures as a last line of JSON."""


def run_localizer_bench(config: LocalizerBenchConfig) -> dict[str, LabelScore]:
    """Measure and print. Raises ConfigError: no such images, or a label not theirs or not the localizer's."""
    if not 0.0 < config.overlap <= 1.0:
        raise ConfigError(f"--overlap is a share above 0 and up to 1, not {config.overlap:g}.")
    images = read_labelled(config.folder)
    labelled = sorted({image.labels[k] for image in images for k in np.flatnonzero(image.counted)})
    check_known("label", labelled, *config.labels)
    labels = config.labels or tuple(labelled)
    localizer: Localizer = new_module("localizer", config.use)
    pictures = [image.read() for image in images]
    found: dict[int, list[Detection]] = {}

    def look(k: int) -> None:
        found[k] = [one.detection for one in localizer.locate(frame_of(pictures[k]), labels)]

    times = timed(look, len(pictures))
    scores = {label: score_label(label, images, found, config.overlap) for label in labels}
    console = Console()
    title = f"{config.use} on {len(images)} images of {config.folder}, IoU {config.overlap:g}"
    table = Table("label", "boxes", "AP", "centre error, median px", "false per image", title=title)
    for label, score in scores.items():
        table.add_row(label, str(score.count), f"{score.ap:.3f}", f"{score.centre:.1f}", f"{score.false:.2f}")
    console.print(table)
    mean = float(np.mean([score.ap for score in scores.values()]))
    milliseconds = 1e3 * float(np.median(times))
    console.print(f"mean AP {mean:.3f}; {milliseconds:.0f} ms CPU per image, median, one thread")
    if config.json:
        print(json.dumps({"use": config.use, "mean_ap": mean, "ms": milliseconds,
                          "labels": {label: asdict(score) for label, score in scores.items()}}))  # fmt: skip
    return scores


def frame_of(image: NDArray[np.uint8]) -> RgbdImage:
    """Return an image as a frame of a camera of its size, at a depth that means nothing."""
    height, width = image.shape[:2]
    info = CameraInfo(
        "bench", width, height, float(width), float(width), (width - 1) / 2, (height - 1) / 2, 0.1, 10.0, 15.0
    )
    return RgbdImage(0.0, info, image, np.full((height, width), DEPTH, np.float32), np.eye(4))
