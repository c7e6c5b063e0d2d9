"""`python -m golem.training.detector render|train|evaluate|export`."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import tyro

from golem.training.detector import dataset
from golem.training.detector.train import TrainConfig
from golem.training.detector.train import train as run_training

RUNS = Path("runs/detector")


def render(
    folder: Path = RUNS / "data",
    seed: int = 0,
    worlds: int = 44,
    held_out_worlds: int = 10,
    per_camera: int = 55,
) -> None:
    """Render the splits `train` and `held_out`; continues where it was stopped.

    Args:
        folder: where to put them.
        seed: of the worlds.
        worlds: compiled worlds of the training split.
        held_out_worlds: compiled worlds of the held-out split, 30 images per camera each.
        per_camera: images of the head camera per training world, and as many of the palm cameras.
    """
    dataset.generate(folder, seed, "held_out", held_out_worlds, 30)
    dataset.generate(folder, seed, "train", worlds, per_camera)


def train(data: Path = RUNS / "data", out: Path = RUNS / "run", seed: int = 0, steps: int = 20000) -> None:
    """Train on the rendered splits, or resume.

    Args:
        data: folder of the splits.
        out: folder of checkpoints and curve.
        seed: of weights and crops.
        steps: gradient steps of 8 crops.
    """
    print(run_training(TrainConfig(data=data, out=out, seed=seed, steps=steps)))


def export(checkpoint: Path = RUNS / "run" / "best.pt", out: Path = RUNS / "detector.onnx") -> None:
    """Write a checkpoint as ONNX.

    Args:
        checkpoint: of `train`.
        out: the ONNX file.
    """
    from golem.training.detector.export import export_onnx

    print(export_onnx(checkpoint, out))


def evaluate(data: Path = RUNS / "data", weights: Path | None = None, out: Path | None = None) -> None:
    """Print the held-out figures of an ONNX file through the run-time detector.

    Args:
        data: folder of the splits.
        weights: ONNX file; the shipped one if absent.
        out: also write the figures there, as JSON.
    """
    from golem.capabilities.localization.onnx_detector import OnnxDetector, OnnxDetectorConfig
    from golem.training.detector.evaluate import THRESHOLD, evaluate, table

    detector = OnnxDetector(OnnxDetectorConfig(None if weights is None else str(weights), THRESHOLD))
    scores = evaluate(dataset.load(data, "held_out"), detector.detect)
    print(table(scores))
    if out is not None:
        out.write_text(json.dumps({f"{c}/{label}": asdict(s) for (c, label), s in scores.items()}, indent=1))


if __name__ == "__main__":
    tyro.extras.subcommand_cli_from_dict(
        {"render": render, "train": train, "export": export, "evaluate": evaluate},
        prog="golem.training.detector",
    )
