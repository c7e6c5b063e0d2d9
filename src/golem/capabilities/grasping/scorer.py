"""Antipodal grasps in the order of a small network that was trained on simulated grasps of the MAGPIE hand.

After Mahler et al., Dex-Net 2.0 (RSS 2017): analytic proposals, ranked by a network that has seen what was held.
Ours is trained by `golem train grasps`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.grasping.antipodal import Antipodal, AntipodalConfig
from golem.capabilities.grasping.base import Grasp, Gripper, OpenLoop
from golem.capabilities.grasping.hand_view import FACTS, SEEN, hand_view
from golem.capabilities.grasping.object_cloud import object_points, thinned
from golem.errors import ConfigError
from golem.options import require
from golem.types import Array, LocalizedObject

Weights = NDArray[np.float32]
ROWS = 32
"""Grasps in one product: from 64 on OpenBLAS starts threads, which took 16 ms for what takes 0.1 ms on one."""
KIND = "golem grasp scorer"
"""What a file of weights says it is."""


@dataclass(frozen=True, slots=True)
class GraspNet:
    """Layers of (inputs, outputs) weights and (outputs,) biases; ReLU between them, a logistic at the end."""

    weights: tuple[Weights, ...]
    biases: tuple[Weights, ...]

    def logits(self, cells: NDArray[np.bool_], facts: NDArray[np.float32]) -> Weights:
        """Return (n,) the log odds that each grasp holds, from pictures (n, `SEEN`) and numbers (n, `FACTS`)."""
        x = np.concatenate([cells.astype(np.float32), facts], axis=1)
        answers = [self._some(x[first : first + ROWS]) for first in range(0, len(x), ROWS)]
        return np.concatenate([np.zeros(0, np.float32), *answers])

    def _some(self, x: Weights) -> Weights:
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            x = np.maximum(x @ weight + bias, 0.0)
        return (x @ self.weights[-1] + self.biases[-1])[:, 0]

    def save(self, path: Path) -> None:
        """Write a file of weights, in half precision."""
        arrays = {f"w{k}": w.astype(np.float16) for k, w in enumerate(self.weights)}
        arrays |= {f"b{k}": b.astype(np.float16) for k, b in enumerate(self.biases)}
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, kind=np.array(KIND), **arrays)


def load_net(path: Path) -> GraspNet:
    """Return the network of a file that `GraspNet.save` wrote.

    Raises ConfigError: it cannot be read, is no such file, or is of another network.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            if str(file["kind"]) != KIND:
                raise ValueError(str(file["kind"]))
            count = sum(name.startswith("w") for name in file.files)
            weights = tuple(file[f"w{k}"].astype(np.float32) for k in range(count))
            biases = tuple(file[f"b{k}"].astype(np.float32) for k in range(count))
    except OSError as error:
        raise ConfigError(f"The scorer's weights {path} cannot be read: {error.strerror or error}.") from error
    except Exception as error:  # a broken archive raises one of several
        raise ConfigError(f"{path} holds no grasp scorer; `golem train grasps` writes one.") from error
    sizes = [SEEN + FACTS, *(len(bias) for bias in biases)]
    shapes = [w.shape for w in weights]
    if not weights or shapes != list(zip(sizes[:-1], sizes[1:], strict=True)) or sizes[-1] != 1:
        raise ConfigError(f"{path} is a scorer of another architecture; train it again with `golem train grasps`.")
    return GraspNet(weights, biases)


SHIPPED = Path(__file__).with_name("weights") / "scorer.npz"
POINTS = 800
"""Points of the thing that the network's pictures are made of."""


@dataclass(frozen=True)
class ScorerConfig:
    """Whose proposals, and how they are ordered.

    Attributes:
        weights: file that `golem train grasps` wrote; the shipped one if absent.
        least: probability to hold below which a grasp is left out.
        proposer: options of the antipodal grasps.
        latency: declared time of the network alone [s]; `golem bench grasp` measures it.
    """

    weights: str | None = None
    least: float = 0.0
    proposer: AntipodalConfig = field(default_factory=AntipodalConfig)
    latency: float = 0.02

    def __post_init__(self) -> None:
        require("scorer ", ("least", self.least, 0.0 <= self.least < 1.0, "from 0 to below 1"))


class Scorer(OpenLoop):
    """Antipodal grasps, with the probability that they hold as score; see `GraspMethod`."""

    def __init__(self, config: ScorerConfig | None = None) -> None:
        """Load the network. Raises ConfigError: the weights cannot be read, or are of another network."""
        self.config = config or ScorerConfig()
        self._proposer = Antipodal(self.config.proposer)
        self._net = load_net(SHIPPED if self.config.weights is None else Path(self.config.weights).expanduser())
        self.latency = self._proposer.latency + self.config.latency

    def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:
        return self.scored(target, self._proposer.propose(target, scene, gripper))

    def scored(self, target: LocalizedObject, grasps: list[Grasp]) -> list[Grasp]:
        """Return `grasps` of `target` in the order of the network, with its probabilities as scores."""
        if not grasps:
            return []
        cloud = thinned(object_points(target.points, target.position, self.config.proposer.seed), POINTS)
        chance = 1.0 / (1.0 + np.exp(-self._net.logits(*hand_view(grasps, cloud)).astype(np.float64)))
        order = np.argsort(-chance, kind="stable")
        return [replace(grasps[k], score=float(chance[k])) for k in order if chance[k] >= self.config.least]
