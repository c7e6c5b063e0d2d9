"""Checkpoints of a training run, and the mean of several networks that were trained on from one.

The mean is often better than each of them:
Wortsman et al., "Model soups: averaging weights of multiple fine-tuned models improves accuracy without increasing
inference time", ICML 2022. Networks that were trained apart from the first step on have nothing in common, and their
mean does nothing.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from onnx import helper

from golem.errors import ConfigError, unknown_name
from golem.training.legs.export_policy import TRAINED, graph_of, load_actor
from golem.types import Array


def average(networks: Sequence[Path], weights: Sequence[float], out: Path) -> None:
    """Write the weighted mean of exported networks to `out`, with what trained each of them.

    Args:
        networks: files that `export` or this wrote, of the same task.
        weights: one per network, not negative; only their ratios count.
        out: the network to write, `.onnx`.

    Raises:
        ConfigError: a file is no such network, the weights do not fit, or `out` is no name of a network.
    """
    if len(networks) < 2 or len(weights) != len(networks):
        raise ConfigError("Give two networks or more, and --weights with a number for each of them.")
    if not all(0.0 <= w < math.inf for w in weights) or sum(weights) == 0.0:
        raise ConfigError("--weights are numbers of 0 or more, and not all of them 0.")
    if out.suffix != ".onnx" or any(path.suffix != ".onnx" for path in networks):
        raise ConfigError(
            "Networks are files that end in .onnx; 'golem train legs export' makes them of checkpoints."
        )
    share = torch.tensor(weights, dtype=torch.float64) / sum(weights)
    actors = [load_actor(path) for path in networks]
    mean = actors[0]
    with torch.no_grad():
        for parts in zip(*(actor.net.parameters() for actor in actors), strict=True):
            stacked = torch.stack([part.double() for part in parts])
            parts[0].copy_(torch.tensordot(share, stacked, dims=1))
    graph = graph_of(mean)
    said = "; ".join(
        f"{w:g} x {path.name}: {_trained(path)}" for w, path in zip(weights, networks, strict=True)
    )
    helper.set_model_props(graph, {TRAINED: f"golem train legs average: {said}"})
    out.parent.mkdir(parents=True, exist_ok=True)
    onnx.save(graph, str(out))


def _trained(network: Path) -> str:
    """Return what the network says trained it."""
    said = {prop.key: prop.value for prop in onnx.load(str(network)).metadata_props}
    return said.get(TRAINED, "unknown")


CHECKPOINT = "checkpoint.pt"
CURVE = "curve.csv"


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Return what the training of the legs saved at `path`.

    Raises:
        ConfigError: there is no file, or it is no such checkpoint.
    """
    try:
        saved = torch.load(path, weights_only=True)
        whole = {"legs", "upper", "steps", "config"} <= saved.keys() and "task" in saved["config"]
    except OSError as error:
        raise ConfigError(f"The checkpoint {path} cannot be read: {error.strerror or error}.") from error
    except Exception as error:  # of any kind: what is read is taken for a program
        raise ConfigError(f"{path} is no checkpoint of 'golem train legs run'.") from error
    if not whole:
        raise ConfigError(f"{path} is no checkpoint of 'golem train legs run', or an older GOLEM wrote it.")
    return saved


def read_curve(run: Path) -> dict[str, Array]:
    """Return the columns of the learning curve in the folder `run`.

    Raises:
        ConfigError: there is none, or it is empty.
    """
    return _columns(run / CURVE, _rows(run / CURVE))


def read_table(table: Path, name: str) -> dict[str, Array]:
    """Return the columns of the run `name` in a table that `learning_curve.draw_curves` wrote.

    Raises:
        ConfigError: there is no such table, or no such run in it.
    """
    runs: dict[str, list[dict[str, str]]] = {}
    for row in _rows(table):
        runs.setdefault(row.pop("run", ""), []).append(row)
    if name not in runs:
        raise unknown_name(f"run of {table}", name, runs)
    return _columns(table, runs[name])


def _rows(path: Path) -> list[dict[str, str]]:
    try:
        with path.open() as file:
            return list(csv.DictReader(file))
    except OSError as error:
        raise ConfigError(
            f"The curve {path} cannot be read: {error.strerror}; name folders of runs."
        ) from error


def _columns(path: Path, rows: Sequence[Mapping[str, str]]) -> dict[str, Array]:
    try:
        return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    except (IndexError, KeyError, ValueError, TypeError) as error:
        raise ConfigError(f"{path} is no learning curve of 'golem train legs run'.") from error


def cut_curve(path: Path, steps: int) -> None:
    """Leave out of the curve at `path`, if there is one, what came after `steps`: it is done again."""
    if not path.exists():
        return
    head, *rows = path.read_text().splitlines(keepends=True)
    column = head.strip().split(",").index("steps")
    kept = [row for row in rows if float(row.split(",")[column]) <= steps * (1.0 + 1e-4)]
    part = path.with_suffix(".part")
    part.write_text("".join([head, *kept]))
    part.replace(path)
