"""The network: ACT (Zhao et al. 2023, "Learning Fine-Grained Bimanual Manipulation with Low-Cost Hardware"), but small.

A transformer encoder reads a latent, the state, and a picture as tokens of a convolutional network; a decoder with
a query per future action gives the chunk. In training the latent is drawn from what an encoder of the true actions says
(a conditional VAE, their eq. 1-2); in use it is zero, the mean of its prior.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

LATENT = 16


class ActNetwork(nn.Module):
    """State (b, s) and picture (b, 3, h, w) of 0 to 255 in, actions (b, n, a) out, all as they are in the data set.

    Attributes:
        mean_in, std_in, mean_out, std_out: what is subtracted and divided by.
    """

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
