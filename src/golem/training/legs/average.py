"""The mean of several networks that were trained on from one: often better than each of them.

Wortsman et al., "Model soups: averaging weights of multiple fine-tuned models improves accuracy without increasing
inference time", ICML 2022. Networks that were trained apart from the first step on have nothing in common, and their
mean does nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import onnx
import torch
from onnx import helper

from golem.errors import ConfigError
from golem.training.legs.export_policy import TRAINED, graph_of, load_actor


def average(networks: Sequence[Path], weights: Sequence[float], out: Path) -> None:
    """Write the weighted mean of exported networks to `out`, with what trained each of them.

    Raises:
        ConfigError: a file is no such network, the weights do not fit, or `out` is no name of a network.
    """
    if len(networks) < 2 or len(weights) != len(networks):
        raise ConfigError("Give two networks or more, and --weights with a number for each of them.")
    if not all(0.0 <= w < math.inf for w in weights) or sum(weights) == 0.0:
        raise ConfigError("--weights are numbers of 0 or more, and not all of them 0.")
    if out.suffix != ".onnx" or any(path.suffix != ".onnx" for path in networks):
        raise ConfigError("Networks are files that end in .onnx; 'golem train legs export' makes them of checkpoints.")
    share = torch.tensor(weights, dtype=torch.float64) / sum(weights)
    actors = [load_actor(path) for path in networks]
    mean = actors[0]
    with torch.no_grad():
        for parts in zip(*(actor.net.parameters() for actor in actors), strict=True):
            stacked = torch.stack([part.double() for part in parts])
            parts[0].copy_(torch.tensordot(share, stacked, dims=1))
    graph = graph_of(mean)
    said = "; ".join(f"{w:g} x {path.name}: {_trained(path)}" for w, path in zip(weights, networks, strict=True))
    helper.set_model_props(graph, {TRAINED: f"golem train legs average: {said}"})
    out.parent.mkdir(parents=True, exist_ok=True)
    onnx.save(graph, str(out))


def _trained(network: Path) -> str:
    said = {prop.key: prop.value for prop in onnx.load(str(network)).metadata_props}
    return said.get(TRAINED, "unknown")
