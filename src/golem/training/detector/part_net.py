"""The network: a small convolutional encoder and decoder with one heatmap per class at a quarter of the resolution.

After Zhou et al., "Objects as Points" (2019). Dense 3x3 convolutions only: on one CPU thread they are faster than
depthwise ones of the same size.

Writes a trained network as a small ONNX file that carries its class names and normalisation.

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
from torch import Tensor, nn

from golem.capabilities.perception.peaks import STRIDE
from golem.training.detector.augment import MEAN, STD

MULTIPLE = 16
"""Image sides must be multiples of this."""
REGRESSION = ("dx", "dy", "left", "top", "right", "bottom")
"""Channels after the heatmaps: the centre's offset from the cell's middle [cells], and the log of the distances from
the centre to the sides of the box [log px]."""


def _block(inputs: int, outputs: int, stride: int = 1, dilation: int = 1) -> nn.Sequential:
    layer = nn.Conv2d(inputs, outputs, 3, stride, padding=dilation, dilation=dilation, bias=False)
    return nn.Sequential(layer, nn.BatchNorm2d(outputs), nn.ReLU(inplace=True))


class PartNet(nn.Module):
    """Images to heatmaps and regression maps.

    Input (n, 3, height, width), normalised RGB, sides multiples of `MULTIPLE`. Output (n, classes + 6,
    height / 4, width / 4): logits of the classes, then `REGRESSION`.
    """

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.stem = _block(3, 16, 2)
        self.down4 = nn.Sequential(_block(16, 24, 2), _block(24, 24))
        self.down8 = nn.Sequential(_block(24, 64, 2), _block(64, 64))
        self.down16 = _block(64, 96, 2)
        self.context = nn.ModuleList(_block(96, 96, dilation=d) for d in (1, 2, 4))
        self.side8 = nn.Conv2d(96, 64, 1)
        self.merge8 = _block(64, 64)
        self.side4 = nn.Conv2d(64, 24, 1)
        self.merge4 = _block(24, 24)
        self.heat = nn.Conv2d(24, classes, 1)
        self.regression = nn.Conv2d(24, len(REGRESSION), 1)
        self.up = nn.Upsample(scale_factor=2, mode="nearest")
        nn.init.constant_(self.heat.bias, -4.6)  # a prior of 1 % per cell, as in focal loss training
        nn.init.normal_(self.heat.weight, std=0.01)

    def forward(self, image: Tensor) -> Tensor:
        """Return heatmap logits and regression, see the class."""
        f4 = self.down4(self.stem(image))
        f8 = self.down8(f4)
        f16 = self.down16(f8)
        for block in self.context:
            f16 = f16 + block(f16)
        u8 = self.merge8(f8 + self.up(self.side8(f16)))
        u4 = self.merge4(f4 + self.up(self.side4(u8)))
        with torch.autocast(image.device.type, enabled=False):  # sub-pixel offsets need the full mantissa
            u4 = u4.float()
            return torch.cat([self.heat(u4), self.regression(u4)], dim=1)


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
