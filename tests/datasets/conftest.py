"""Small data sets, and a writer in a process of its own that can be killed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pyarrow")
pytest.importorskip("av")

from golem.datasets.episode_writer import DatasetWriter  # noqa: E402
from golem.datasets.schema import Recipe  # noqa: E402

SMALL = Recipe(15, {"right_hand": (64, 48)}, depth=True, masks=("screw",))
PLAIN = Recipe(15)


def frames(count: int, seed: int = 0, recipe: Recipe = SMALL) -> list[dict[str, Any]]:
    """Return frames whose numbers are drawn, and whose pictures get lighter by one level a frame."""
    rng = np.random.default_rng(seed)
    out: list[dict[str, Any]] = []
    for k in range(count):
        frame: dict[str, Any] = {
            name: 0.3 * rng.normal(size=feature.shape)
            for name, feature in recipe.features().items()
            if len(feature.shape) == 1
        }
        for name in recipe.cameras:
            size = recipe.cameras[name][::-1]
            frame[f"observation.images.{name}"] = np.full((*size, 3), 40 + 3 * k, np.uint8)
            frame[f"observation.depth.{name}"] = rng.integers(0, 500, size).astype(np.uint16)
            frame[f"observation.masks.{name}"] = rng.integers(0, 2, size).astype(np.uint8)
        out.append(frame)
    return out


def write(root: Path, lengths: tuple[int, ...], recipe: Recipe = SMALL, task: str = "Take a screw.") -> Path:
    """Write a data set with episodes of these lengths."""
    writer = DatasetWriter(root, recipe, "test")
    for k, length in enumerate(lengths):
        writer.begin(task)
        for frame in frames(length, k, recipe):
            writer.add(frame)
        writer.finish()
    writer.close()
    return root


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    return write(tmp_path / "set", (20, 70, 5))
