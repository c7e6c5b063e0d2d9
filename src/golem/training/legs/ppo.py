"""Proximal policy optimisation (Schulman et al., 2017) with generalised advantages (2016), as small as it can be.

Networks and experience are float32 on one device; noise is drawn on the CPU, so that a run can go on on another. The
learning rate follows the KL divergence of each update, as ALMI's does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from golem.training.legs.mirror import Mirror
from golem.types import Array

Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class PpoConfig:
    """The optimiser.

    Attributes:
        steps: actions of each robot per update.
        epochs, batches: passes over them, and parts of each pass.
        gamma, lam: discount, and the exponent of the advantage estimate.
        clip: bound of the probability ratio.
        entropy: weight of the entropy bonus.
        kl: divergence that the learning rate aims at.
        rate: initial learning rate.
        hidden: widths of the actor's layers; the critic's are the same.
        noise: initial standard deviation of the actions.
    """

    steps: int = 24
    epochs: int = 3
    batches: int = 4
    gamma: float = 0.99
    lam: float = 0.95
    clip: float = 0.2
    entropy: float = 0.002
    kl: float = 0.01
    rate: float = 1e-3
    hidden: tuple[int, ...] = (128, 128, 64)
    noise: float = 0.8


def mlp(sizes: tuple[int, ...], gain: float) -> nn.Sequential:
    """Return a perceptron with ELU between its layers; `gain` scales the initial weights of the last one."""
    layers: list[nn.Module] = []
    for k, (a, b) in enumerate(zip(sizes[:-1], sizes[1:], strict=True)):
        layer = nn.Linear(a, b)
        last = k == len(sizes) - 2
        nn.init.orthogonal_(layer.weight, gain if last else 1.414)
        nn.init.zeros_(layer.bias)
        layers += [layer] if last else [layer, nn.ELU()]
    return nn.Sequential(*layers)


class Actor(nn.Module):
    """Mean action of a Gaussian policy that is the same for a robot and its mirror image.

    The mean is (f(o) + M f(M o)) / 2 with the mirrors M of observation and action: exactly equivariant, so that the
    robot neither drifts nor turns to one side and learns from every step twice.
    """

    def __init__(self, observation: Mirror, action: Mirror, hidden: tuple[int, ...], noise: float = 0.8) -> None:
        """Build a network for the vectors that the two mirrors are for."""
        super().__init__()
        self.net = mlp((len(observation.sign), *hidden, len(action.sign)), 0.01)
        self.log_std = nn.Parameter(torch.full((len(action.sign),), float(np.log(noise))))
        for name, mirror in (("observation", observation), ("action", action)):
            self.register_buffer(f"{name}_order", torch.as_tensor(mirror.order))
            self.register_buffer(f"{name}_sign", torch.as_tensor(mirror.sign, dtype=torch.float32))

    def forward(self, observation: Tensor) -> Tensor:
        """Return the mean action (..., m) for `observation` (..., n)."""
        mirrored = observation[..., self.observation_order] * self.observation_sign
        out = self.net(mirrored)
        return 0.5 * (self.net(observation) + out[..., self.action_order] * self.action_sign)


class Ppo:
    """One player: actor, critic, their optimiser, and the experience since the last update."""

    def __init__(self, actor: Actor, known: int, n: int, config: PpoConfig, seed: int, device: str = "cpu") -> None:
        """Train `actor` on `n` robots, with a critic that sees `known` values beside the actor's observation."""
        self.config, self.actor, self._device = config, actor.to(device), device
        self._generator = torch.Generator().manual_seed(seed)
        observed = len(actor.observation_sign)
        self.critic = mlp((observed + known, *config.hidden, 1), 1.0).to(device)
        parameters = [*actor.parameters(), *self.critic.parameters()]
        self._optimiser = torch.optim.Adam(parameters, lr=config.rate)
        self._parameters = parameters
        actions = len(actor.action_sign)
        self._obs, self._known, self._act, self._mean = (
            torch.zeros(config.steps, n, size, device=device) for size in (observed, known, actions, actions)
        )
        self._logp, self._value, self._reward, self._cut = torch.zeros(4, config.steps, n, device=device)
        self._k = 0

    @torch.no_grad()
    def act(self, observation: Array, known: Array) -> Array:
        """Return sampled actions (n, m) and remember what they were based on."""
        k = self._k
        self._obs[k] = torch.from_numpy(observation)
        self._known[k] = torch.from_numpy(known)
        mean, std = self.actor(self._obs[k]), self.actor.log_std.exp()
        self._mean[k] = mean
        self._act[k] = mean + std * torch.randn(mean.shape, generator=self._generator).to(self._device)
        self._logp[k] = _log_prob(self._act[k], mean, self.actor.log_std)
        self._value[k] = self._evaluate(self._obs[k], self._known[k])
        return self._act[k].double().cpu().numpy()

    def learn_of(self, reward: Array, ended: Bools, truncated: Bools) -> None:
        """Remember what the last actions led to; an episode that was merely cut goes on in the critic's eyes."""
        k = self._k
        bonus = self.config.gamma * self._value[k] * self._tensor(truncated)
        self._reward[k] = self._tensor(reward) + bonus
        self._cut[k] = self._tensor(ended | truncated)
        self._k += 1

    def update(self, observation: Array, known: Array, policy: bool = True) -> dict[str, float]:
        """Improve critic and `policy`, or the critic alone, on what was remembered.

        Args:
            observation: what the policy sees after the last step.
            known: what only the critic knows then.
            policy: whether the policy learns, too.
        """
        c = self.config
        with torch.no_grad():
            value = self._evaluate(self._tensor(observation), self._tensor(known))
            advantage = torch.zeros_like(self._reward)
            running = torch.zeros_like(value)
            for k in reversed(range(c.steps)):
                going = 1.0 - self._cut[k]
                delta = self._reward[k] + c.gamma * going * value - self._value[k]
                running = delta + c.gamma * c.lam * going * running
                advantage[k], value = running, self._value[k]
            target = advantage + self._value
            advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
            old_std = self.actor.log_std.exp().clone()
        flat = [
            x.reshape(-1, *x.shape[2:])
            for x in (self._obs, self._known, self._act, self._logp, advantage, target, self._mean)
        ]
        total, stats = len(flat[0]), {"value_loss": 0.0, "kl": 0.0}
        for _ in range(c.epochs):
            order = torch.randperm(total, generator=self._generator).to(self._device)
            for part in order.chunk(c.batches):
                loss, value_loss, kl = self._loss([x[part] for x in flat], old_std, policy)
                if policy:
                    group = self._optimiser.param_groups[0]
                    if kl > 2.0 * self.config.kl:
                        group["lr"] = max(group["lr"] / 1.5, 1e-5)
                    elif 0.0 < kl < 0.5 * self.config.kl:
                        group["lr"] = min(group["lr"] * 1.5, 5e-3)
                self._optimiser.zero_grad(set_to_none=True)
                loss.backward()
                nn.utils.clip_grad_norm_(self._parameters, 1.0)
                self._optimiser.step()
                stats["value_loss"] += value_loss / (c.epochs * c.batches)
                stats["kl"] += kl / (c.epochs * c.batches)
        self._k = 0
        stats["std"] = float(self.actor.log_std.detach().exp().mean())
        stats["rate"] = self._optimiser.param_groups[0]["lr"]
        return stats

    @torch.no_grad()
    def bound_noise(self, maximum: float) -> None:
        """Let the standard deviation of no action exceed `maximum`."""
        self.actor.log_std.clamp_(max=float(np.log(maximum)))

    @torch.no_grad()
    def set_noise(self, deviation: float) -> None:
        """Explore every action with this standard deviation."""
        self.actor.log_std.fill_(float(np.log(deviation)))

    def state(self) -> dict[str, Any]:
        """Return everything that a checkpoint needs."""
        return {
            "actor": self.actor.state_dict(),
            "critic": self.critic.state_dict(),
            "optimiser": self._optimiser.state_dict(),
            "generator": self._generator.get_state(),
        }

    def load(self, state: dict[str, Any]) -> None:
        """Go on from a checkpoint's `state`."""
        self.take_networks(state)
        self._optimiser.load_state_dict(state["optimiser"])
        self._generator.set_state(state["generator"])

    def take_networks(self, state: dict[str, Any]) -> None:
        """Take over the networks of a checkpoint's `state`, and nothing else."""
        self.actor.load_state_dict(state["actor"])
        self.critic.load_state_dict(state["critic"])

    def _tensor(self, values: Array | Bools) -> Tensor:
        return torch.from_numpy(values).to(self._device, torch.float32)

    def _evaluate(self, observation: Tensor, known: Tensor) -> Tensor:
        return self.critic(torch.cat([observation, known], dim=-1)).squeeze(-1)

    def _loss(self, rows: list[Tensor], old_std: Tensor, policy: bool) -> tuple[Tensor, float, float]:
        """Return the loss of a batch (in the order of `flat` in `update`), its value part, and the KL divergence."""
        obs, known, act, logp, advantage, target, old_mean = rows
        c = self.config
        value_loss = (self._evaluate(obs, known) - target).square().mean()
        if not policy:
            return value_loss, float(value_loss.detach()), 0.0
        mean, log_std = self.actor(obs), self.actor.log_std
        ratio = (_log_prob(act, mean, log_std) - logp).exp()
        clipped = ratio.clamp(1.0 - c.clip, 1.0 + c.clip)
        surrogate = torch.minimum(ratio * advantage, clipped * advantage).mean()
        entropy = log_std.sum()
        with torch.no_grad():
            std = log_std.exp()
            kl = (old_std.square() + (old_mean - mean).square()) / (2.0 * std.square()) - 0.5
            divergence = float((kl + torch.log(std / old_std)).sum(dim=-1).mean())
        return -surrogate + value_loss - c.entropy * entropy, float(value_loss.detach()), divergence


def _log_prob(action: Tensor, mean: Tensor, log_std: Tensor) -> Tensor:
    scaled = (action - mean) / log_std.exp()
    return -(0.5 * scaled.square() + log_std).sum(dim=-1)
