"""Writes a trained network as a small ONNX file that carries its class names and normalisation.

The graph is written node by node, with the batch normalisation folded into the convolutions, so that the file depends
on no exporter's version.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper
from torch import nn

from golem.capabilities.perception.peaks import STRIDE
from golem.training.detector.augment import MEAN, STD
from golem.training.detector.part_net import MULTIPLE, REGRESSION, PartNet

OPSET = 17
IR_VERSION = 8


class _Graph:
    """Collects nodes and weights; every method returns the name of its output."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.weights: list[onnx.TensorProto] = []

    def add(self, kind: str, *inputs: str, output: str = "", **attributes: object) -> str:
        name = output or f"t{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, list(inputs), [name], **attributes))
        return name

    def constant(self, value: NDArray[np.float32]) -> str:
        name = f"w{len(self.weights)}"
        self.weights.append(numpy_helper.from_array(value, name))
        return name

    def conv(self, x: str, layer: nn.Conv2d, norm: nn.BatchNorm2d | None = None) -> str:
        weight = layer.weight.detach().double()
        bias = torch.zeros(len(weight)).double() if layer.bias is None else layer.bias.detach().double()
        if norm is not None:
            assert norm.running_mean is not None and norm.running_var is not None
            gain = norm.weight.detach().double() / (norm.running_var.double() + norm.eps).sqrt()
            weight = weight * gain[:, None, None, None]
            bias = norm.bias.detach().double() - norm.running_mean.double() * gain
        pad, dilation = int(layer.padding[0]), int(layer.dilation[0])
        arrays = [value.float().numpy() for value in (weight, bias)]
        return self.add(
            "Conv", x, *(self.constant(a) for a in arrays),
            pads=[pad] * 4, dilations=[dilation] * 2, strides=[int(layer.stride[0])] * 2,
        )  # fmt: skip

    def blocks(self, x: str, module: nn.Sequential) -> str:
        """Write a block (convolution, normalisation, ReLU) or a sequence of them."""
        first = module[0]
        if isinstance(first, nn.Conv2d):
            norm = module[1]
            assert isinstance(norm, nn.BatchNorm2d)
            return self.add("Relu", self.conv(x, first, norm))
        for block in module:
            assert isinstance(block, nn.Sequential)
            x = self.blocks(x, block)
        return x

    def up(self, x: str) -> str:
        scales = self.constant(np.array([1, 1, 2, 2], np.float32))
        return self.add(
            "Resize", x, "", scales, mode="nearest", nearest_mode="floor", coordinate_transformation_mode="asymmetric"
        )


def export_onnx(checkpoint: Path, out: Path) -> Path:
    """Write `out`, with dynamic height and width, from a checkpoint of `train`; returns `out`."""
    state = torch.load(checkpoint, map_location="cpu", weights_only=True)
    classes: list[str] = state["classes"]
    model = PartNet(len(classes))
    model.load_state_dict(state["average"])
    g = _Graph()
    f4 = g.blocks(g.blocks("image", model.stem), model.down4)
    f8 = g.blocks(f4, model.down8)
    f16 = g.blocks(f8, model.down16)
    for block in model.context:
        assert isinstance(block, nn.Sequential)
        f16 = g.add("Add", f16, g.blocks(f16, block))
    u8 = g.blocks(g.add("Add", f8, g.up(g.conv(f16, model.side8))), model.merge8)
    u4 = g.blocks(g.add("Add", f4, g.up(g.conv(u8, model.side4))), model.merge4)
    g.add("Concat", g.conv(u4, model.heat), g.conv(u4, model.regression), output="maps", axis=1)
    channels = len(classes) + len(REGRESSION)
    graph = helper.make_graph(
        g.nodes,
        "part_detector",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, "height", "width"])],
        [helper.make_tensor_value_info("maps", TensorProto.FLOAT, [1, channels, "rows", "columns"])],
        g.weights,
    )
    network = helper.make_model(
        graph, producer_name="golem", ir_version=IR_VERSION, opset_imports=[helper.make_opsetid("", OPSET)]
    )
    facts = {
        "classes": classes, "mean": MEAN, "std": STD, "stride": STRIDE, "multiple": MULTIPLE, "step": state["step"],
    }  # fmt: skip
    helper.set_model_props(network, {key: json.dumps(value) for key, value in facts.items()})
    onnx.checker.check_model(network, full_check=True)
    out.parent.mkdir(parents=True, exist_ok=True)
    onnx.save(network, str(out))
    return out
