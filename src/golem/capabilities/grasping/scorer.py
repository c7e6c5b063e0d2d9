"""Antipodal grasps in the order of a small network that was trained on simulated grasps of the MAGPIE hand.

After Mahler et al., Dex-Net 2.0 (RSS 2017): analytic proposals, ranked by a network that has seen what was held.
Ours is trained by `golem train grasps`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from golem.capabilities.grasping.antipodal import Antipodal, AntipodalConfig
from golem.capabilities.grasping.base import Grasp, Gripper, OpenLoop
from golem.capabilities.grasping.grasp_net import load_net
from golem.capabilities.grasping.hand_view import hand_view
from golem.capabilities.grasping.object_cloud import object_points, thinned
from golem.options import require
from golem.types import Array, LocalizedObject

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
    """Antipodal grasps, the one that most probably holds first; see `GraspMethod`.

    Attributes:
        config: its options.
        latency: of proposals and network together [s].
    """

    def __init__(self, config: ScorerConfig | None = None) -> None:
        """Load the network.

        Raises:
            ConfigError: the weights cannot be read, or are of another network.
        """
        self.config = config or ScorerConfig()
        self._proposer = Antipodal(self.config.proposer)
        self._net = load_net(SHIPPED if self.config.weights is None else Path(self.config.weights).expanduser())
        self.latency = self._proposer.latency + self.config.latency

    def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:
        """Return the antipodal grasps, best first, with the probability that they hold as score; see `GraspMethod`."""
        return self.scored(target, self._proposer.propose(target, scene, gripper))

    def scored(self, target: LocalizedObject, grasps: list[Grasp]) -> list[Grasp]:
        """Return `grasps` of `target` in the order of the network, with its probabilities as scores."""
        if not grasps:
            return []
        cloud = thinned(object_points(target.points, target.position, self.config.proposer.seed), POINTS)
        chance = 1.0 / (1.0 + np.exp(-self._net.logits(*hand_view(grasps, cloud)).astype(np.float64)))
        order = np.argsort(-chance, kind="stable")
        return [replace(grasps[k], score=float(chance[k])) for k in order if chance[k] >= self.config.least]
