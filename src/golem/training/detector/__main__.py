"""`golem train detector render|train|export|evaluate|curve`, and `golem train detector --labels FOLDER`."""

from __future__ import annotations

import sys
import time
from importlib import resources
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray

from golem.errors import ConfigError
from golem.training.detector import dataset
from golem.training.detector.labels import CLASSES, KITCHEN, PACK
from golem.training.detector.train_detector import TrainDetectorConfig
from golem.training.detector.train_detector import train as run_training
from golem.types import Detection

RUNS = Path("runs/detector")


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


def train(
    data: Path = RUNS / "data",
    out: Path = RUNS / "run",
    seed: int = 0,
    steps: int = 12000,
    batch: int = 32,
    rate: float = 2.5e-3,
    check_every: int = 1000,
    start: Path | None = None,
    device: str = "cpu",
) -> None:
    """Train on the rendered splits, or resume.

    Args:
        data: folder of the splits.
        out: folder of checkpoints and curve.
        seed: of weights and crops.
        steps: gradient steps.
        batch: crops of a step.
        rate: peak learning rate.
        check_every: steps between evaluations on part of the held-out split.
        start: ONNX file of an earlier detector to begin with.
        device: cpu, or cuda.
    """
    config = TrainDetectorConfig(
        data, out, seed, steps, batch, rate, check_every=check_every, check_images=240, start=start,
        device=device,
    )  # fmt: skip
    print(run_training(config))


def export(checkpoint: Path = RUNS / "run" / "best.pt", out: Path = RUNS / "detector.onnx") -> None:
    """Write a checkpoint as ONNX.

    Args:
        checkpoint: of `train`.
        out: the ONNX file.
    """
    from golem.training.detector.export_detector import export_onnx

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
    for image, camera in zip(held.images, held.cameras, strict=True):
        start = time.process_time()
        found[id(image)] = detector.detect(image)
        times[camera].append(1e3 * (time.process_time() - start))

    def detect(image: NDArray[np.uint8]) -> list[Detection]:
        return found[id(image)]

    for world, classes in (("pack", PACK), ("kitchen", KITCHEN)):
        part = held.of_world(world)
        known = tuple(name for name in classes if name in detector.classes)
        if known:
            print(f"{table(evaluate(part, detect, classes=CLASSES), known)}\n")
        others = [name for name in detector.classes if name not in classes]
        if others:
            per_image = false_alarms(part, detect, others)
            print(f"{world}: {per_image:.3f} false {', '.join(others)} per image ({len(part.images)} images)\n")
    print(condition_table(held.of_world("pack"), detect))
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
    from golem.training.detector.export_detector import export_onnx
    from golem.training.detector.own_labels import load_own
    from golem.training.detector.train_detector import fit

    if steps < 1 or width < 64 or seed < 0:
        raise ConfigError("--steps must be 1 or more, --width 64 px or more, --seed 0 or more.")
    data, held, classes = load_own(labels, seed, width)
    print(f"{len(data.images)} images to train on, {len(held.images)} held out; classes: {', '.join(classes)}")
    shipped = resources.files("golem.capabilities.perception").joinpath(SHIPPED)
    with resources.as_file(shipped) as default:
        config = TrainDetectorConfig(
            labels, out, seed, steps, check_every=min(250, steps), start=start or default, classes=classes
        )
        best = fit(config, data, held)
    path = export_onnx(best, out / "detector.onnx")
    detector = OnnxDetector(OnnxDetectorConfig(str(path), THRESHOLD, {}))
    print(table(evaluate(held, detector.detect, classes=classes)))
    print(f"localizer: {{use: onnx, weights: {path}}}")


def main(words: list[str] | None = None) -> None:
    """Run one of the commands, or `own` where the first word is an option of it; `words` are by default the line's."""
    words = sys.argv[1:] if words is None else words
    if words and words[0].startswith("--") and words[0] != "--help":
        tyro.cli(own, prog="golem train detector", args=words)
        return
    tyro.extras.subcommand_cli_from_dict(
        {"render": render, "train": train, "export": export, "evaluate": evaluate, "curve": curve},
        prog="golem train detector",
        description="Or: golem train detector --labels FOLDER, on your own images; --labels --help lists its options.",
        args=words,
    )


if __name__ == "__main__":
    main()
