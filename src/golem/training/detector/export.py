"""Writes a trained network as a small ONNX file that carries its class names and normalisation."""

from __future__ import annotations

import json
from pathlib import Path

import onnx
import torch

from golem.capabilities.localization.classes import CLASSES
from golem.capabilities.localization.peaks import STRIDE
from golem.training.detector.augment import MEAN, STD
from golem.training.detector.model import MULTIPLE, PartNet

OPSET = 17


def export_onnx(checkpoint: Path, out: Path) -> Path:
    """Write `out`, with dynamic height and width, from a checkpoint of `train`; returns `out`."""
    state = torch.load(checkpoint, weights_only=True)
    model = PartNet()
    model.load_state_dict(state["average"])
    model.eval()
    out.parent.mkdir(parents=True, exist_ok=True)
    torch.onnx.export(
        model,
        (torch.zeros(1, 3, 64, 64),),
        str(out),
        input_names=["image"],
        output_names=["maps"],
        dynamic_axes={"image": {2: "height", 3: "width"}, "maps": {2: "rows", 3: "columns"}},
        opset_version=OPSET,
        dynamo=False,
    )
    graph = onnx.load(str(out))
    graph.metadata_props.clear()
    facts = {
        "classes": CLASSES, "mean": MEAN, "std": STD, "stride": STRIDE, "multiple": MULTIPLE, "step": state["step"],
    }  # fmt: skip
    for key, value in facts.items():
        graph.metadata_props.add(key=key, value=json.dumps(value))
    onnx.checker.check_model(graph)
    onnx.save(graph, str(out))
    return out
