"""Any method's grasps by what the arm makes of them: reached, free, away from stops and singularities, balanced.

The paper does so for one network (its GGX-F); here it goes around every method that proposes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from golem import registry
from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.arms.quick_ik import QuickIK
from golem.capabilities.collision.scene_cloud import scene_world
from golem.capabilities.grasping.base import Grasp, GraspMethod, Gripper, ServoLaw
from golem.capabilities.grasping.centroid import ACROSS
from golem.capabilities.planning.joint_space import JointSpace, PlanningRobot
from golem.errors import ConfigError
from golem.finite import check_finite
from golem.types import Array, LocalizedObject, Side

SCENE = 30000
"""Points of the scene that make the world, evenly taken."""
SPARED = 0.10
"""Radius around the object within which nothing is in the arm's way [m]: the proposer looks after the fingers."""
COMFORT = (0.25, 0.12)
"""Distance from a stop [rad] and manipulability of a well-placed arm; more is no better. As in `arms.solve`."""


@dataclass(frozen=True, slots=True)
class ProposerChoice:
    """Whose grasps are ranked.

    Attributes:
        use: a grasp method, as the slot names it.
        options: its options.
    """

    use: str = "antipodal"
    options: dict[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True)
class RerankingConfig:
    """What counts how much, each between 0 and 1.

    Attributes:
        proposer: whose grasps are ranked.
        quality: the proposer's own score, of its best grasp 1.
        margin: distance of the arm's joints from their stops.
        manipulability: distance from singular postures.
        balance: how little the centre of mass moves.
        level: how level the closing axis is, as the wrist holds it.
        shift: movement of the centre of mass that counts nothing any more [m].
        retreat: how far the hand has to be able to back off along its approach [m].
        most: proposals that are looked at, the proposer's best.
        latency: time of ranking 64 grasps [s], on top of the proposer's; `golem bench grasp` measures it.
    """

    proposer: ProposerChoice = field(default_factory=ProposerChoice)
    quality: float = 1.0
    margin: float = 0.5
    manipulability: float = 0.5
    balance: float = 0.3
    level: float = 0.3
    shift: float = 0.05
    retreat: float = 0.08
    most: int = 64
    latency: float = 0.15


class Reranking:
    """The grasps of another method that the arm can do, the one that suits it best first; see `GraspMethod`.

    Attributes:
        config: its options.
        latency: that of both together [s].
    """

    def __init__(self, config: RerankingConfig | None = None) -> None:
        """Make the proposer.

        Raises:
            ConfigError, ModuleFault: it cannot be made; see `registry.create`.
        """
        self.config = c = config or RerankingConfig()
        if c.proposer.use == "reranked":
            raise ConfigError("Reranked grasps are not ranked again; choose another proposer.")
        self._proposer: GraspMethod = registry.create("grasp_method", c.proposer.use, c.proposer.options)
        self.latency = self._proposer.latency + c.latency
        self._ik, self._robot = QuickIK(), PlanningRobot()

    def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:
        """Return the proposals that can be reached and are free, best first; see `GraspMethod`."""
        check_finite("the object's position", target.position)
        grasps = self._proposer.propose(target, scene, gripper)[: self.config.most]
        if not grasps:
            return []
        q = POSTURES["ready"] if gripper.q is None else gripper.q
        q = np.clip(q, self._robot.lower, self._robot.upper)
        T_base_odom = np.asarray(np.linalg.inv(gripper.T_odom_base), np.float64)
        space = self._space(q, target, scene, T_base_odom)
        best = max(max(grasp.score for grasp in grasps), 1e-9)
        ranked: list[Grasp] = []
        named = [POSTURES["forward"], POSTURES["ready"]]
        if gripper.approach[2] < -ACROSS:
            named.reverse()
        starts = [q, *named]
        for grasp in grasps:
            posture = self._posture(gripper.side, T_base_odom @ grasp.T_odom_gripper, starts, space)
            if posture is None:
                continue
            starts = [posture, q, *named]
            quality = min(max(grasp.score / best, 0.0), 1.0)
            score = self._score(gripper.side, grasp, posture, q, space, quality)
            ranked.append(Grasp(grasp.T_odom_gripper, grasp.gap, score))
        return sorted(ranked, key=lambda grasp: -grasp.score)

    def servo(self, target: LocalizedObject, grasp: Grasp, t: float) -> ServoLaw | None:
        """Return the proposer's law; see `GraspMethod`."""
        return self._proposer.servo(target, grasp, t)

    def _space(self, q: Array, target: LocalizedObject, scene: Array, T_base_odom: Array) -> JointSpace:
        """Return the postures that are free of the robot itself and of what the scene shows."""
        points = scene[:: max(1, len(scene) // SCENE)] @ T_base_odom[:3, :3].T + T_base_odom[:3, 3]
        spheres = self._robot.model().placed(np.ascontiguousarray(q))
        centre = T_base_odom[:3, :3] @ target.position + T_base_odom[:3, 3]
        return JointSpace(self._robot, q, scene_world(points, spheres, [(centre, SPARED)]))

    def _posture(self, side: Side, T: Array, starts: list[Array], space: JointSpace) -> Array | None:
        """Return a free posture with the hand at `T` (4, 4), in base_link, from which it can back off; or None."""
        before = T.copy()
        before[:3, 3] -= self.config.retreat * T[:3, 2]
        away = self._ik.solve(side, before, np.array(starts))
        if away is None or space.verdict(away):
            return None
        at = self._ik.solve(side, T, away[None])
        return None if at is None or space.verdict(at) else at

    def _score(
        self, side: Side, grasp: Grasp, posture: Array, q: Array, space: JointSpace, quality: float
    ) -> float:
        c, kinematics = self.config, self._ik.kinematics
        shift = float(np.linalg.norm((space.centre_of_mass(posture) - space.centre_of_mass(q))[:2]))
        margin = max(kinematics.margin(side, posture), 0.0) / COMFORT[0]
        manipulability = kinematics.manipulability(side, posture) / COMFORT[1]
        return (
            c.quality * quality
            + c.margin * min(margin, 1.0)
            + c.manipulability * min(manipulability, 1.0)
            + c.balance * max(0.0, 1.0 - shift / c.shift)
            + c.level * (1.0 - abs(float(grasp.T_odom_gripper[2, 1])))
        )
