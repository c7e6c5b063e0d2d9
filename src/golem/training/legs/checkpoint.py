"""Reads what a training run left."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import torch

from golem.errors import ConfigError
from golem.evaluation.harness.records import whole_lines
from golem.types import Array

CHECKPOINT = "checkpoint.pt"
CURVE = "curve.csv"


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Return what the training of the legs saved at `path`. Raises ConfigError: there is no such checkpoint."""
    try:
        saved = torch.load(path, map_location="cpu", weights_only=True)
        whole = {"legs", "upper", "steps", "config"} <= saved.keys() and "task" in saved["config"]
    except OSError as error:
        raise ConfigError(f"The checkpoint {path} cannot be read: {error.strerror or error}.") from error
    except Exception as error:  # of any kind: what is read is taken for a program
        raise ConfigError(f"{path} is no checkpoint of 'golem train legs run'.") from error
    if not whole:
        raise ConfigError(f"{path} is no checkpoint of 'golem train legs run', or an older GOLEM wrote it.")
    return saved


def read_curve(run: Path) -> dict[str, Array]:
    """Return the columns of the learning curve in the folder `run`. Raises ConfigError: it is absent or empty."""
    path = run / CURVE
    try:
        with path.open() as file:
            rows = list(csv.DictReader(file))
        return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    except OSError as error:
        raise ConfigError(f"The curve {path} cannot be read: {error.strerror}; name folders of runs.") from error
    except (IndexError, KeyError, ValueError, TypeError) as error:
        raise ConfigError(f"{path} is no learning curve of 'golem train legs run'.") from error


def cut_curve(path: Path, steps: int) -> None:
    """Leave out of the curve at `path`, if there is one, what came after `steps`, and half a line: it is done again."""
    text = path.read_bytes() if path.exists() else b""
    whole = text[: whole_lines(text)].decode()
    if not whole:
        path.unlink(missing_ok=True)
        return
    head, *rows = whole.splitlines(keepends=True)
    column = head.strip().split(",").index("steps")
    kept = [row for row in rows if float(row.split(",")[column]) <= steps * (1.0 + 1e-4)]
    part = path.with_suffix(".part")
    part.write_text("".join([head, *kept]))
    part.replace(path)
