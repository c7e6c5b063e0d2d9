"""`golem train detector render|train|export|evaluate|curve`, and `golem train detector --labels FOLDER`."""

from __future__ import annotations

import time
from importlib import resources
from pathlib import Path

import cv2
import numpy as np
import tyro
from numpy.typing import NDArray
from tyro.conf import OmitArgPrefixes

from golem.errors import ConfigError
from golem.evaluation.metrics.coco import LabelledImage
from golem.evaluation.metrics.yolo_labels import read_labelled
from golem.robots.sensors.streams import stream
from golem.training.detector import dataset
from golem.training.detector.dataset import Labelled
from golem.training.detector.labels import CLASSES, KITCHEN, MIN_SIDE, PACK
from golem.training.detector.train_detector import RUNS, TrainDetectorConfig
from golem.training.detector.train_detector import train as run_training
from golem.types import Array, Detection

CAMERA = "own"
"""What the camera of such images is called in tables and curves."""
HELD_OUT = ("val", "valid", "validation", "test", "held_out")
"""Folders, or files of annotations, whose images are held out; where there are none, every fifth image is, drawn by
the seed. A year after it (val2017) says nothing."""
SHARE = 0.2


def load_own(folder: Path, seed: int, width: int) -> tuple[list[Labelled], list[Labelled], tuple[str, ...]]:
    """Return the training images, the held-out ones, and the classes in the order of their numbers.

    Args:
        folder: in either format; see `read_labelled`.
        seed: draws what is held out, where no folder says it.
        width: wider images are scaled down to it [px].

    Raises:
        ConfigError: the folder is in neither format, an image is absent or broken, or all are held out.
    """
    images = read_labelled(folder)
    classes = tuple(sorted({image.labels[k] for image in images for k in np.flatnonzero(image.counted)}))
    if not classes:
        raise ConfigError(f"No image of {folder} has a label.")
    base = folder.expanduser()
    held = np.array([any(_plain(p) in HELD_OUT for p in (i.split, *i.path.relative_to(base).parts)) for i in images])
    if not held.any():
        count = round(SHARE * len(images))
        held[stream(seed, "detector/own").permutation(len(images))[: max(count, 1)]] = True
    if held.all():
        raise ConfigError(f"{folder} has {len(images)} images, and all are held out; training needs some, too.")
    scaled = [Labelled(*_scaled(image, classes, width), CAMERA, {}) for image in images]
    splits = [[one for one, out in zip(scaled, held, strict=True) if out == apart] for apart in (False, True)]
    if not any(len(one.labels) for one in splits[0]):
        raise ConfigError(f"All labelled images of {folder} are held out; training needs some, too.")
    return splits[0], splits[1], classes


def _plain(name: str) -> str:
    return name.lower().rstrip("0123456789_-")


def _scaled(image: LabelledImage, classes: tuple[str, ...], width: int) -> tuple[NDArray[np.uint8], Array]:
    """Return an image no wider than `width`, and its labels (n, 8), columns as in `labels.COLUMNS`."""
    pixels = image.read()
    scale = min(1.0, width / pixels.shape[1])
    if scale < 1.0:
        size = (width, max(round(pixels.shape[0] * scale), 1))
        pixels = np.ascontiguousarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)
    # A pixel's middle is at a whole number here, its corner there.
    boxes = np.clip(image.boxes * scale, 0.0, np.tile(pixels.shape[1::-1], 2)) - 0.5
    known = np.array([label in classes for label in image.labels], bool)
    kinds = np.array([classes.index(label) if label in classes else -1 for label in image.labels], float)
    middle = 0.5 * (boxes[:, :2] + boxes[:, 2:])
    ignored = ~image.counted | ((boxes[:, 2:] - boxes[:, :2]).min(axis=1, initial=np.inf) < MIN_SIDE)
    return pixels, np.column_stack([kinds, middle, boxes, ignored.astype(float)]).reshape(-1, 8)[known]


def render(
    folder: Path = RUNS / "data",
    seed: int = 0,
    worlds: int = 150,
    kitchens: int = 75,
    held_out_worlds: int = 30,
    held_out_kitchens: int = 15,
    per_camera: int = 16,
    jobs: int = 1,
) -> None:
    """Render the splits `train` and `held_out`; continues where it was stopped.

    Args:
        folder: where to put them.
        seed: of the worlds.
        worlds: compiled packs of the training split.
        kitchens: compiled kitchens of the training split.
        held_out_worlds: compiled packs of the held-out split.
        held_out_kitchens: compiled kitchens of the held-out split.
        per_camera: images of the head camera per world, and as many of the palm cameras.
        jobs: processes that render.
    """
    held = {"pack": held_out_worlds, "kitchen": held_out_kitchens}
    dataset.generate(folder, seed, "held_out", held, per_camera, jobs)
    dataset.generate(folder, seed, "train", {"pack": worlds, "kitchen": kitchens}, per_camera, jobs)


def train(config: OmitArgPrefixes[TrainDetectorConfig]) -> None:
    """Train on the rendered splits, or resume."""
    print(run_training(config))


def export(checkpoint: Path = RUNS / "run" / "best.pt", out: Path = RUNS / "detector.onnx") -> None:
    """Write a checkpoint as ONNX.

    Args:
        checkpoint: of `train`.
        out: the ONNX file.
    """
    from golem.training.detector.part_net import export_onnx

    print(export_onnx(checkpoint, out))


def curve(run: Path = RUNS / "run", out: Path = RUNS / "curve.png") -> None:
    """Draw the training curve.

    Args:
        run: folder of `train`.
        out: PNG file.
    """
    from golem.training.detector.evaluate import draw_curve

    draw_curve(run / "curve.csv", out)


def evaluate(data: Path = RUNS / "data", weights: Path | None = None) -> None:
    """Print the held-out figures of an ONNX file through the run-time detector.

    Args:
        data: folder of the splits.
        weights: ONNX file; the shipped one if absent.
    """
    from golem.capabilities.perception.onnx_detector import OnnxDetector, OnnxDetectorConfig
    from golem.training.detector.evaluate import THRESHOLD, condition_table, evaluate, false_alarms, table

    detector = OnnxDetector(OnnxDetectorConfig(None if weights is None else str(weights), THRESHOLD, {}))
    held = dataset.load(data, "held_out")
    found: dict[int, list[Detection]] = {}
    times: dict[str, list[float]] = {"head": [], "palm": []}
    for image, _, camera, _ in held:
        start = time.process_time()
        found[id(image)] = detector.detect(image)
        times[camera].append(1e3 * (time.process_time() - start))

    def detect(image: NDArray[np.uint8]) -> list[Detection]:
        return found[id(image)]

    for world, classes in (("pack", PACK), ("kitchen", KITCHEN)):
        part = [one for one in held if one.conditions["world"] == world]
        known = tuple(name for name in classes if name in detector.classes)
        if known:
            print(f"{table(evaluate(part, detect, classes=CLASSES), known)}\n")
        others = [name for name in detector.classes if name not in classes]
        if others:
            per_image = false_alarms(part, detect, others)
            print(f"{world}: {per_image:.3f} false {', '.join(others)} per image ({len(part)} images)\n")
    print(condition_table([one for one in held if one.conditions["world"] == "pack"], detect))
    for camera, taken in times.items():
        print(f"{camera}: {np.median(taken):.1f} ms CPU per image (median of {len(taken)}, one thread)")


def own(
    labels: Path,
    out: Path = RUNS / "own",
    seed: int = 0,
    steps: int = 2000,
    width: int = 640,
    start: Path | None = None,
) -> None:
    """Train the shipped network on your own labels; a run that was stopped is resumed.

    Writes `detector.onnx` (for `localizer: {use: onnx, weights: ...}`), and `curve.csv`.

    Args:
        labels: folder in COCO format (one JSON file) or YOLO's (a text file for each image); its classes are learned.
        out: folder of weights, checkpoints and curve.
        seed: of weights, crops, and what is held out.
        steps: gradient steps of 8 crops.
        width: wider images are scaled down to it: the head camera's [px].
        start: ONNX file of an earlier detector to begin with; the shipped one if absent.
    """
    from golem.capabilities.perception.onnx_detector import SHIPPED, OnnxDetector, OnnxDetectorConfig
    from golem.training.detector.evaluate import THRESHOLD, evaluate, table
    from golem.training.detector.part_net import export_onnx
    from golem.training.detector.train_detector import fit

    if steps < 1 or width < 64 or seed < 0:
        raise ConfigError("--steps must be 1 or more, --width 64 px or more, --seed 0 or more.")
    data, held, classes = load_own(labels, seed, width)
    print(f"{len(data)} images to train on, {len(held)} held out; classes: {', '.join(classes)}")
    shipped = resources.files("golem.capabilities.perception").joinpath(SHIPPED)
    with resources.as_file(shipped) as default:
        config = TrainDetectorConfig(
            labels, out, seed, steps, 8, check_every=min(250, steps), check_images=80, start=start or default,
            classes=classes,
        )  # fmt: skip
        best = fit(config, data)
    path = export_onnx(best, out / "detector.onnx")
    detector = OnnxDetector(OnnxDetectorConfig(str(path), THRESHOLD, {}))
    print("On the held-out images, which neither trained the network nor chose its checkpoint:")
    print(table(evaluate(held, detector.detect, classes=classes)))
    print(f"localizer: {{use: onnx, weights: {path}}}")


def main(words: list[str]) -> None:
    """Run one of the commands, or `own` where the first word is an option of it."""
    if words and words[0].startswith("--") and words[0] != "--help":
        tyro.cli(own, prog="golem train detector", args=words)
        return
    tyro.extras.subcommand_cli_from_dict(
        {"render": render, "train": train, "export": export, "evaluate": evaluate, "curve": curve},
        prog="golem train detector",
        description="Or: golem train detector --labels FOLDER, on your own images; --labels --help lists its options.",
        args=words,
    )
