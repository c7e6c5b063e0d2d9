"""Reads the weights of an exported detector back into a network, to train on from there."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import onnx
import torch
from onnx import numpy_helper
from torch import nn

from golem.training.detector.part_net import PartNet


def load_onnx(model: PartNet, path: Path, classes: Sequence[str]) -> None:
    """Give `model` the weights of an ONNX file that `export_onnx` wrote.

    The normalisation is folded into the convolutions there: here it begins with mean 0 and variance 1. Classes that
    the file does not know keep their random weights; its classes that the network lacks are left out.

    Args:
        model: the network.
        path: the ONNX file.
        classes: what the heatmaps of `model` are.

    Raises:
        ValueError: the file is no such detector.
    """
    network = onnx.load(str(path))
    known = json.loads(next(p.value for p in network.metadata_props if p.key == "classes"))
    weights = {w.name: torch.from_numpy(numpy_helper.to_array(w).copy()) for w in network.graph.initializer}
    folded = [[weights[name] for name in n.input[1:]] for n in network.graph.node if n.op_type == "Conv"]
    layers = [m for m in model.modules() if isinstance(m, nn.Conv2d)]
    norms = {id(block[0]): block[1] for block in model.modules() if _is_block(block)}
    if len(folded) != len(layers):
        raise ValueError(f"{path} has {len(folded)} convolutions; a part detector has {len(layers)}.")
    for layer, (weight, _) in zip(layers, folded, strict=True):
        if layer is not model.heat and layer.weight.shape != weight.shape:
            raise ValueError(
                f"{path} has a convolution of {tuple(weight.shape)}; a part detector has {tuple(layer.weight.shape)}."
            )
    with torch.no_grad():
        for layer, (weight, bias) in zip(layers, folded, strict=True):
            if layer is model.heat:
                for row, label in enumerate(known):
                    if label in classes:
                        layer.weight[classes.index(label)] = weight[row]
                        model.heat.bias[classes.index(label)] = bias[row]
                continue
            layer.weight.copy_(weight)
            norm = norms.get(id(layer))
            (layer if norm is None else norm).bias.copy_(bias)


def _is_block(module: nn.Module) -> bool:
    return isinstance(module, nn.Sequential) and isinstance(module[0], nn.Conv2d)
