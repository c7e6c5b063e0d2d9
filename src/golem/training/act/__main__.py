"""`golem train act`: a small ACT from a data set of demonstrations, as one ONNX file for `policy`."""

from __future__ import annotations

import json
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import onnx
import torch
import tyro
from tyro.conf import Positional

from golem.capabilities.policies.onnx_policy import MEASURED, META, POSITIONS
from golem.capabilities.policies.vectors import ACTION, STATE
from golem.datasets.store import DatasetFolder
from golem.errors import ConfigError
from golem.training.act.act_network import ActNetwork

SEEN = tuple(name for name in STATE if "hand." in name or name.endswith("palm.z"))
"""Entries of the state that go in [own]: with joints and places a policy learns where the screws of its data were."""
LEAST = 1e-3
"""Least standard deviation that is divided by: what never moved in the data must not be blown up."""


def train_act(
    dataset: Positional[Path],
    out: Path = Path("runs/act.onnx"),
    camera: str = "right_hand",
    width: int = 96,
    chunk: int = 16,
    steps: int = 3000,
    batch: int = 16,
    rate: float = 3e-4,
    beta: float = 1.0,
    held_out: int = 1,
    seed: int = 0,
) -> None:
    """Train ACT on a data set of this robot, on the CPU; writes one file, and again every 200 steps.

    Args:
        dataset: folder of the demonstrations.
        out: file to write.
        camera: whose pictures it sees.
        width: of its pictures [px].
        chunk: actions that it says at once.
        steps: of the optimiser (AdamW).
        batch: frames per step.
        rate: of learning.
        beta: weight of the latent's divergence.
        held_out: episodes that are not learned from, whose error is printed.
        seed: of everything that is drawn.
    """
    if min(width // 16, chunk, steps, batch, held_out) < 1:
        raise ConfigError("--width is 16 or more, and --chunk, --steps, --batch and --held-out are 1 or more.")
    torch.manual_seed(seed)
    rng, data = np.random.default_rng(seed), DatasetFolder(dataset)
    video = f"observation.images.{camera}"
    data.require("observation.state", "action", video, like={"observation.state": [*STATE], "action": [*ACTION]})
    if len(data.episodes) <= held_out:
        raise ConfigError(
            f"{dataset} has {len(data.episodes)} episodes; training needs more than the {held_out} held out."
        )
    high, wide = data.features[video].shape[:2]
    size = width, round(width * high / wide)
    episodes = [_Frames(data, k, video, size, chunk) for k in range(len(data.episodes))]
    learned, held = _joined(episodes[:-held_out]), _joined(episodes[-held_out:])
    net = ActNetwork(len(SEEN), len(ACTION), chunk, size)
    known = learned["known"] > 0.5
    with torch.no_grad():
        for name, values in (("in", learned["state"]), ("out", learned["actions"][known])):
            getattr(net, f"mean_{name}").copy_(values.mean(0))
            getattr(net, f"std_{name}").copy_(values.std(0).clamp(min=LEAST))
    count = sum(p.numel() for p in net.parameters())
    print(
        f"{len(learned['state'])} frames of {len(episodes) - held_out} episodes, {count / 1e6:.2f} M parameters.",
        flush=True,
    )
    optimiser = torch.optim.AdamW(net.parameters(), rate, weight_decay=1e-4)
    out.parent.mkdir(parents=True, exist_ok=True)
    begun, total = time.monotonic(), 0.0
    for step in range(1, steps + 1):
        net.train()
        rows = torch.as_tensor(rng.integers(len(learned["state"]), size=batch))
        some = {name: values[rows] for name, values in learned.items()}
        picture = some["picture"].float() * float(rng.uniform(0.8, 1.2)) + float(rng.uniform(-15.0, 15.0))
        loss = net.loss(some["state"], picture.clamp(0.0, 255.0), some["actions"], some["known"], beta)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        for group in optimiser.param_groups:
            group["lr"] = rate * min(1.0, step / 100, 3.0 * (1.0 - step / (steps + 1)))
        optimiser.step()
        total += loss.item()
        if step % 200 == 0 or step == steps:
            error = 1e3 * _palm_error(net, held)
            took = time.monotonic() - begun
            print(
                f"{step:6d}  loss {total / (step % 200 or 200):.3f}  held out: {error:.1f} mm  {took:.0f} s", flush=True
            )
            total = 0.0
            _save(net, out, camera, size, data.fps)
    print(f"Use it: golem ladder --method visual_servo '{{use: policy, file: {out.resolve()}}}'")


class _Frames:
    """The frames of one episode, each with the actions that follow it."""

    def __init__(self, data: DatasetFolder, index: int, video: str, size: tuple[int, int], chunk: int) -> None:
        episode = data.episode(index)
        n = episode.length
        state, action = data.values(episode, "observation.state"), data.values(episode, "action")
        pictures = [cv2.resize(p, size, interpolation=cv2.INTER_AREA) for p in data.pictures(episode, video)]
        after = np.arange(n)[:, None] + np.arange(chunk)
        actions = action[np.minimum(after, n - 1)].copy()
        actions[:, :, POSITIONS] -= state[:, None, MEASURED]
        self.tensors = {
            "state": torch.as_tensor(state[:, [list(STATE).index(name) for name in SEEN]]),
            "picture": torch.as_tensor(np.array(pictures).transpose(0, 3, 1, 2).copy()),
            "actions": torch.as_tensor(actions),
            "known": torch.as_tensor((after < n).astype(np.float32)),
        }


def _joined(episodes: list[_Frames]) -> dict[str, Any]:
    return {name: torch.cat([e.tensors[name] for e in episodes]) for name in episodes[0].tensors}


def _palm_error(net: ActNetwork, frames: dict[str, Any]) -> float:
    """Return the mean error of the right palm's positions over the chunks [m]."""
    net.eval()
    with torch.no_grad():
        said = net(frames["state"], frames["picture"].float())
    off = (said - frames["actions"])[:, :, POSITIONS[3:]].norm(dim=2)
    return float((off * frames["known"]).sum() / frames["known"].sum())


def _save(net: ActNetwork, out: Path, camera: str, size: tuple[int, int], fps: int) -> None:
    """Write the network and what goes in, whole or not at all."""
    net.eval()
    part = out.with_name(out.name + ".part")
    given = torch.zeros(1, len(SEEN)), torch.zeros(1, 3, size[1], size[0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that there is a newer exporter, which needs one more package
        torch.onnx.export(
            net, given, str(part), dynamo=False, input_names=["state", "picture"], output_names=["actions"]
        )
    model = onnx.load(str(part))
    about = {"state": SEEN, "camera": camera, "size": size, "fps": fps, "relative": True}
    onnx.helper.set_model_props(model, {META: json.dumps(about)})
    onnx.save(model, str(part))
    part.replace(out)


def main(words: list[str]) -> None:
    """Run the command `golem train act` with the `words` that follow it."""
    tyro.cli(train_act, prog="golem train act", args=words)


if __name__ == "__main__":
    main(sys.argv[1:])
