"""`golem train act`: a small ACT from a data set of demonstrations, as one ONNX file for `policy`.

The network is that of ACT (Zhao et al. 2023, "Learning Fine-Grained Bimanual Manipulation with Low-Cost Hardware"), but
small: a transformer encoder reads a latent, the state, and a picture as tokens of a convolutional network; a decoder
with a query per future action gives the chunk. In training the latent is drawn from what an encoder of the true actions
says (a conditional VAE, their eq. 1-2); in use it is zero, the mean of its prior.
"""

from __future__ import annotations

import json
import time
import warnings
from pathlib import Path

import cv2
import numpy as np
import onnx
import torch
import tyro
from torch import Tensor, nn
from tyro.conf import Positional

from golem.capabilities.policies.onnx_policy import MEASURED, META, POSITIONS
from golem.capabilities.policies.vectors import ACTION, STATE
from golem.datasets.store import DatasetFolder
from golem.errors import ConfigError

LATENT = 16


class ActNetwork(nn.Module):
    """State (b, s) and picture (b, 3, h, w) of 0 to 255 in, actions (b, n, a) out, all as they are in the data set."""

    def __init__(self, inputs: int, outputs: int, chunk: int, size: tuple[int, int], width: int = 128) -> None:
        """Make it for pictures of `size`, width and height [px]."""
        super().__init__()
        for name, count in (("in", inputs), ("out", outputs)):
            self.register_buffer(f"mean_{name}", torch.zeros(count))
            self.register_buffer(f"std_{name}", torch.ones(count))
        channels = (3, 24, 48, 96, width)
        layers: list[nn.Module] = []
        for a, b in zip(channels, channels[1:], strict=False):
            layers += [nn.Conv2d(a, b, 3, 2, 1), nn.GroupNorm(8, b), nn.ReLU()]
        self.eye = nn.Sequential(*layers)
        with torch.no_grad():
            tokens = self.eye(torch.zeros(1, 3, size[1], size[0])).flatten(2).shape[2]
        self.places = nn.Parameter(0.02 * torch.randn(1, tokens + 2, width))
        self.queries = nn.Parameter(0.02 * torch.randn(1, chunk, width))
        self.steps = nn.Parameter(0.02 * torch.randn(1, chunk + 2, width))
        self.token = nn.Parameter(torch.zeros(1, 1, width))
        self.state_in, self.latent_in = nn.Linear(inputs, width), nn.Linear(LATENT, width)
        self.action_in, self.state_told = nn.Linear(outputs, width), nn.Linear(inputs, width)
        self.posterior = nn.TransformerEncoder(_layer(width), 2)
        self.latent_out = nn.Linear(width, 2 * LATENT)
        self.encoder = nn.TransformerEncoder(_layer(width), 3)
        self.decoder = nn.TransformerDecoder(nn.TransformerDecoderLayer(width, 4, 2 * width, 0.1, batch_first=True), 2)
        self.head = nn.Linear(width, outputs)

    def forward(self, state: Tensor, picture: Tensor) -> Tensor:
        """Return the chunk for latent zero."""
        return self.std_out * self.chunk(state, picture, state.new_zeros(len(state), LATENT)) + self.mean_out

    def chunk(self, state: Tensor, picture: Tensor, latent: Tensor) -> Tensor:
        """Return the normalised chunk (b, n, a)."""
        seen = self.eye(picture / 127.5 - 1.0).flatten(2).transpose(1, 2)
        first = [self.latent_in(latent), self.state_in((state - self.mean_in) / self.std_in)]
        memory = self.encoder(torch.cat([torch.stack(first, 1), seen], 1) + self.places)
        return self.head(self.decoder(self.queries.expand(len(state), -1, -1), memory))

    def loss(self, state: Tensor, picture: Tensor, actions: Tensor, known: Tensor, weight: float) -> Tensor:
        """Return the L1 error of the chunk plus `weight` times the divergence of the latent from its prior.

        Args:
            state: (b, s).
            picture: (b, 3, h, w).
            actions: (b, n, a) true ones.
            known: (b, n) which of them are: an episode ends.
            weight: beta of the paper.
        """
        wanted = (actions - self.mean_out) / self.std_out
        told = [self.token.expand(len(state), -1, -1), self.state_told((state - self.mean_in) / self.std_in)[:, None]]
        hidden = torch.cat([known.new_ones(len(known), 2), known], 1) < 0.5
        read = torch.cat([*told, self.action_in(wanted)], 1) + self.steps
        mean, spread = self.latent_out(self.posterior(read, src_key_padding_mask=hidden)[:, 0]).chunk(2, 1)
        latent = mean + torch.exp(0.5 * spread) * torch.randn_like(mean)
        error = (self.chunk(state, picture, latent) - wanted).abs().mean(2)
        divergence = -0.5 * (1.0 + spread - mean**2 - spread.exp()).sum(1).mean()
        return (error * known).sum() / known.sum() + weight * divergence


def _layer(width: int) -> nn.TransformerEncoderLayer:
    return nn.TransformerEncoderLayer(width, 4, 2 * width, 0.1, batch_first=True)


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
    """Train ACT on a data set of this robot, on the CPU; writes one file, and again every 100 steps.

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
    rng, data, video = np.random.default_rng(seed), DatasetFolder(dataset), f"observation.images.{camera}"
    data.require("observation.state", "action", video, like={"observation.state": [*STATE], "action": [*ACTION]})
    count = len(data.episodes) - held_out
    if count < 1:
        raise ConfigError(f"{dataset} has {len(data.episodes)} episodes, and {held_out} of them are held out.")
    high, wide = data.features[video].shape[:2]
    size = width, round(width * high / wide)
    frames = [_frames(data, k, video, size, chunk) for k in range(len(data.episodes))]
    learned, held = ([torch.cat(p) for p in zip(*some, strict=True)] for some in (frames[:count], frames[count:]))
    net = ActNetwork(len(SEEN), len(ACTION), chunk, size)
    for name, values in (("in", learned[0]), ("out", learned[2][learned[3] > 0.5])):
        getattr(net, f"mean_{name}").copy_(values.mean(0))
        getattr(net, f"std_{name}").copy_(values.std(0).clamp(min=LEAST))
    weights = sum(p.numel() for p in net.parameters()) / 1e6
    print(f"{len(learned[0])} frames of {count} episodes, {weights:.2f} M parameters.", flush=True)
    optimiser = torch.optim.AdamW(net.parameters(), rate, weight_decay=1e-4)
    out.parent.mkdir(parents=True, exist_ok=True)
    begun = time.monotonic()
    for step in range(1, steps + 1):
        net.train()
        rows = torch.as_tensor(rng.integers(len(learned[0]), size=batch))
        state, picture, actions, known = (values[rows] for values in learned)
        lit = picture.float() * float(rng.uniform(0.8, 1.2)) + float(rng.uniform(-15.0, 15.0))
        loss = net.loss(state, lit.clamp(0.0, 255.0), actions, known, beta)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.param_groups[0]["lr"] = rate * min(1.0, step / 100, 3.0 * (1.0 - step / (steps + 1)))
        optimiser.step()
        if step % 100 == 0 or step == steps:
            took, error = time.monotonic() - begun, 1e3 * _palm_error(net, held)
            print(f"{step:6d}  loss {loss.item():.3f}  held out: {error:.1f} mm  {took:.0f} s", flush=True)
            _save(net, out, camera, size, data.fps)
    print(f"Use it: golem ladder --method visual_servo '{{use: policy, file: {out.resolve()}}}'")


def _frames(data: DatasetFolder, index: int, video: str, size: tuple[int, int], chunk: int) -> list[Tensor]:
    """Return state, picture, the actions that follow, and which of them there are, of each frame of an episode."""
    episode = data.episode(index)
    state, action = data.values(episode, "observation.state"), data.values(episode, "action")
    pictures = [cv2.resize(p, size, interpolation=cv2.INTER_AREA) for p in data.pictures(episode, video)]
    after = np.arange(episode.length)[:, None] + np.arange(chunk)
    actions = action[np.minimum(after, episode.length - 1)].copy()
    actions[:, :, POSITIONS] -= state[:, None, MEASURED]
    seen = state[:, [list(STATE).index(name) for name in SEEN]]
    known = (after < episode.length).astype(np.float32)
    return [torch.as_tensor(x.copy()) for x in (seen, np.array(pictures).transpose(0, 3, 1, 2), actions, known)]


def _palm_error(net: ActNetwork, frames: list[Tensor]) -> float:
    """Return the mean error of the right palm's positions over the chunks [m]."""
    net.eval()
    state, picture, actions, known = frames
    with torch.no_grad():
        off = (net(state, picture.float()) - actions)[:, :, POSITIONS[3:]].norm(dim=2)
    return float((off * known).sum() / known.sum())


def _save(net: ActNetwork, out: Path, camera: str, size: tuple[int, int], fps: int) -> None:
    """Write the network and what goes in, whole or not at all."""
    part, given = out.with_name(out.name + ".part"), (torch.zeros(1, len(SEEN)), torch.zeros(1, 3, size[1], size[0]))
    names: dict[str, list[str]] = {"input_names": ["state", "picture"], "output_names": ["actions"]}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that there is a newer exporter, which needs one more package
        torch.onnx.export(net.eval(), given, str(part), dynamo=False, **names)
    model = onnx.load(str(part))
    about = {"state": SEEN, "camera": camera, "size": size, "fps": fps, "relative": True}
    onnx.helper.set_model_props(model, {META: json.dumps(about)})
    onnx.save(model, str(part))
    part.replace(out)


def main(words: list[str]) -> None:
    """Run the command `golem train act` with the `words` that follow it."""
    tyro.cli(train_act, prog="golem train act", args=words)
