"""Writes a trained leg policy as what the stack runs: a small ONNX network and its description beside it.

The graph is written node by node, mirror and all, so that the file depends on no exporter's version.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
import yaml
from google.protobuf.message import DecodeError
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper
from torch import nn

from golem.capabilities.legs.base import Envelope
from golem.errors import ConfigError
from golem.training.legs.checkpoint import read_checkpoint
from golem.training.legs.env import LAYOUT, PERIOD, SEEN, TASKS, EnvConfig, Task
from golem.training.legs.mirror import Mirror, leg_mirror
from golem.training.legs.ppo import Actor
from golem.training.legs.training_model import KD, KP, STANCE

OPSET = 17
IR_VERSION = 8
DECLARED = Envelope((-0.4, 0.8), (-0.3, 0.3), (-0.6, 0.6))
"""The twists the shipped controller promises to follow; training commands a little more."""


TRAINED = "golem.trained"
"""Name of the network's metadata that say what trained it."""


def load_actor(path: Path) -> Actor:
    """Return the trained actor of a checkpoint, or of an exported network (`.onnx`). Raises ConfigError: neither."""
    return _exported_actor(path) if path.suffix == ".onnx" else _trained_actor(read_checkpoint(path))


def _trained_actor(saved: dict[str, Any]) -> Actor:
    actor = _untrained_actor(tuple(saved["config"]["ppo"]["hidden"]))
    actor.load_state_dict(saved["legs"]["actor"])
    return actor


def _exported_actor(path: Path) -> Actor:
    try:
        weights = {w.name: numpy_helper.to_array(w) for w in onnx.load(str(path)).graph.initializer}
        layers = sum(name.startswith("bias") for name in weights)
        actor = _untrained_actor(tuple(len(weights[f"bias{k}"]) for k in range(layers - 1)))
        with torch.no_grad():
            for k, layer in enumerate(_linear(actor)):
                layer.weight.copy_(torch.from_numpy(weights[f"weight{k}"].T.copy()))
                layer.bias.copy_(torch.from_numpy(weights[f"bias{k}"].copy()))
    except OSError as error:
        raise ConfigError(f"The network {path} cannot be read: {error.strerror or error}.") from error
    except (KeyError, RuntimeError, DecodeError) as error:
        raise ConfigError(f"{path} is no network of 'golem train legs export' of today.") from error
    return actor


def _untrained_actor(hidden: tuple[int, ...]) -> Actor:
    return Actor(Mirror(SEEN.components), leg_mirror(), hidden).eval()


def _linear(actor: Actor) -> list[nn.Linear]:
    return [layer for layer in actor.net if isinstance(layer, nn.Linear)]


def export(checkpoint: Path, folder: Path) -> tuple[Path, Path]:
    """Write `folder/almi_TASK.onnx` and `.yaml` of a checkpoint; return both. Raises ConfigError: it is none."""
    saved = read_checkpoint(checkpoint)
    task: Task = saved["config"]["task"]
    name = f"almi_{task}"
    folder.mkdir(parents=True, exist_ok=True)
    network = folder / f"{name}.onnx"
    graph = graph_of(_trained_actor(saved))
    helper.set_model_props(graph, {TRAINED: command_of(saved)})
    onnx.save(graph, str(network))
    description = folder / f"{name}.yaml"
    description.write_text(_description(network.name, TASKS[task]), encoding="utf-8")
    return network, description


def command_of(saved: dict[str, Any]) -> str:
    """Return the command that made a checkpoint, and with what code."""
    config = saved["config"]
    words = ("task", "seed", "adversary", "robots", "shards")
    options = " ".join(f"--{word} {config[word]}" for word in words if word in config)
    start = "" if config["start"] is None else f" --start {Path(config['start']).name}"
    codes = ", then ".join(saved.get("codes", ["unknown"]))
    return f"golem train legs run {options} --steps {config['steps']:g}{start} (commit {codes})"


def graph_of(actor: Actor) -> onnx.ModelProto:
    """Return the network that the stack runs."""
    nodes: list[onnx.NodeProto] = []
    weights: dict[str, NDArray[np.generic]] = {"half": np.array([0.5], np.float32)}
    for key in ("observation_order", "observation_sign", "action_order", "action_sign"):
        weights[key] = getattr(actor, key).numpy()
    layers = _linear(actor)
    for k, layer in enumerate(layers):
        weights[f"weight{k}"] = layer.weight.detach().numpy().T.copy()
        weights[f"bias{k}"] = layer.bias.detach().numpy()

    def add(kind: str, *inputs: str, output: str, **attributes: object) -> str:
        nodes.append(helper.make_node(kind, list(inputs), [output], **attributes))
        return output

    def network(x: str, tag: str) -> str:
        for k in range(len(layers)):
            x = add("Gemm", x, f"weight{k}", f"bias{k}", output=f"{tag}{k}")
            if k < len(layers) - 1:
                x = add("Elu", x, output=f"{tag}{k}_elu")
        return x

    def mirror(x: str, what: str) -> str:
        turned = add("Gather", x, f"{what}_order", output=f"{what}_swapped", axis=1)
        return add("Mul", turned, f"{what}_sign", output=f"{what}_mirrored")

    plain = network("observation", "plain")
    mirrored = mirror(network(mirror("observation", "observation"), "mirror"), "action")
    add("Mul", add("Add", plain, mirrored, output="sum"), "half", output="action")
    n, m = len(actor.observation_sign), len(actor.action_sign)
    graph = helper.make_graph(
        nodes,
        "legs",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, [1, n])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, [1, m])],
        [numpy_helper.from_array(np.asarray(value), key) for key, value in weights.items()],
    )
    opset = [helper.make_opsetid("", OPSET)]
    model = helper.make_model(graph, producer_name="golem", ir_version=IR_VERSION, opset_imports=opset)
    onnx.checker.check_model(model, full_check=True)
    return model


def _description(network: str, config: EnvConfig) -> str:
    terms = []
    for term in LAYOUT:
        entry: dict[str, object] = {"term": term.term}
        if term.scale != 1.0:
            entry["scale"] = list(term.scale) if isinstance(term.scale, tuple) else term.scale
        if term.of:
            entry["of"] = list(term.of)
        terms.append(entry)
    data = {
        "network": network,
        "rate": 1.0 / PERIOD,
        "envelope": {axis: list(bounds) for axis, bounds in asdict(DECLARED).items() if bounds},
        "gait": asdict(config.gait),
        "posture": STANCE[:6].tolist(),
        "kp": KP[:6].tolist(),
        "kd": KD[:6].tolist(),
        "action": {"scale": config.action_scale, "clip": 10.0, "swing": config.swing},
        "observation": terms,
    }
    head = "# A shipped leg policy; written by `golem train legs export`, see docs/how-to/train-legs.md.\n"
    return head + yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=110)


def average(networks: Sequence[Path], weights: Sequence[float], out: Path) -> None:
    """Write the weighted mean of exported networks to `out`, with what trained each of them.

    Wortsman et al., "Model soups: averaging weights of multiple fine-tuned models improves accuracy without increasing
    inference time", ICML 2022. Networks that were trained apart from the first step on have nothing in common, and
    their mean does nothing. Raises ConfigError: a file is no such network, the weights do not fit, or `out` is no name
    of a network.
    """
    if len(networks) < 2 or len(weights) != len(networks):
        raise ConfigError("Give two networks or more, and --weights with a number for each of them.")
    if not all(0.0 <= w < math.inf for w in weights) or sum(weights) == 0.0:
        raise ConfigError("--weights are numbers of 0 or more, and not all of them 0.")
    if out.suffix != ".onnx" or any(path.suffix != ".onnx" for path in networks):
        raise ConfigError("Networks are files that end in .onnx; 'golem train legs export' makes them of checkpoints.")
    share = torch.tensor(weights, dtype=torch.float64) / sum(weights)
    actors = [load_actor(path) for path in networks]
    if len({tuple(layer.weight.shape for layer in _linear(actor)) for actor in actors}) > 1:
        raise ConfigError("Networks whose layers differ have no mean.")
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
