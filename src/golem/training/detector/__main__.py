"""`python -m golem.training.detector render|train|export|evaluate|curve`."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import tyro

from golem.training.detector import dataset
from golem.training.detector.train_detector import TrainDetectorConfig
from golem.training.detector.train_detector import train as run_training
from golem.types import Detection

RUNS = Path("runs/detector")


def render(
    folder: Path = RUNS / "data",
    seed: int = 0,
    worlds: int = 150,
    held_out_worlds: int = 30,
    per_camera: int = 16,
) -> None:
    """Render the splits `train` and `held_out`; continues where it was stopped.

    Args:
        folder: where to put them.
        seed: of the worlds.
        worlds: compiled worlds of the training split.
        held_out_worlds: compiled worlds of the held-out split.
        per_camera: images of the head camera per world, and as many of the palm cameras.
    """
    dataset.generate(folder, seed, "held_out", held_out_worlds, per_camera)
    dataset.generate(folder, seed, "train", worlds, per_camera)


def train(
    data: Path = RUNS / "data",
    out: Path = RUNS / "run",
    seed: int = 0,
    steps: int = 12000,
    start: Path | None = None,
) -> None:
    """Train on the rendered splits, or resume.

    Args:
        data: folder of the splits.
        out: folder of checkpoints and curve.
        seed: of weights and crops.
        steps: gradient steps of 8 crops.
        start: ONNX file of an earlier detector to begin with.
    """
    print(run_training(TrainDetectorConfig(data=data, out=out, seed=seed, steps=steps, start=start)))


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
    from golem.training.detector.precision_curve import draw_curve

    draw_curve(run / "curve.csv", out)


def evaluate(data: Path = RUNS / "data", weights: Path | None = None) -> None:
    """Print the held-out figures of an ONNX file through the run-time detector.

    Args:
        data: folder of the splits.
        weights: ONNX file; the shipped one if absent.
    """
    from golem.capabilities.perception.onnx_detector import OnnxDetector, OnnxDetectorConfig
    from golem.training.detector.evaluate import THRESHOLD, condition_table, evaluate, table

    detector = OnnxDetector(OnnxDetectorConfig(None if weights is None else str(weights), THRESHOLD))
    held = dataset.load(data, "held_out")
    found: dict[int, list[Detection]] = {}
    times: dict[str, list[float]] = {"head": [], "palm": []}
    for image, camera in zip(held.images, held.cameras, strict=True):
        start = time.process_time()
        found[id(image)] = detector.detect(image)
        times[camera].append(1e3 * (time.process_time() - start))
    print(table(evaluate(held, lambda image: found[id(image)])))
    print()
    print(condition_table(held, lambda image: found[id(image)]))
    for camera, taken in times.items():
        print(f"{camera}: {np.median(taken):.1f} ms CPU per image (median of {len(taken)}, one thread)")


def main(words: list[str] | None = None) -> None:
    """Run one of the commands; `words` are the command line's by default."""
    tyro.extras.subcommand_cli_from_dict(
        {"render": render, "train": train, "export": export, "evaluate": evaluate, "curve": curve},
        prog="golem train detector",
        args=words,
    )


if __name__ == "__main__":
    main()
