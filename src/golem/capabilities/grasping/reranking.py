"""Any method's grasps by what the arm makes of them: reached, free, away from stops and singularities, balanced.

The paper does so for one network (its GGX-F); here it goes around every method that proposes. Nothing is left out: what
is not reached here, a planner may still reach.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from golem import registry
from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.arms.quick_ik import TURNS, QuickIK
from golem.capabilities.collision.obstacles import scene_world
from golem.capabilities.grasping.base import Grasp, GraspMethod, Gripper, ServoLaw
from golem.capabilities.grasping.centroid import ACROSS
from golem.capabilities.grasping.object_cloud import room_around
from golem.capabilities.planning.joint_space import JointSpace, PlanningRobot
from golem.capabilities.planning.plan_kernel import FREE, WORLD
from golem.errors import ConfigError
from golem.finite import check_finite
from golem.options import require
from golem.types import Array, LocalizedObject, Side

SCENE = 30000
"""Points of the scene that make the world, evenly taken."""
COMFORT = (0.25, 0.12)
"""Distance from a stop [rad] and manipulability of a well-placed arm; more is no better: what such an arm reaches."""


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
    """How much a grasp's comfort counts, and what is comfortable.

    Attributes:
        proposer: whose grasps are ranked.
        comfort: share of the proposer's score that the least comfortable grasp loses. The proposer knows what holds, so
            comfort decides between grasps that hold about as well.
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
    comfort: float = 0.2
    margin: float = 0.5
    manipulability: float = 0.5
    balance: float = 0.3
    level: float = 0.3
    shift: float = 0.05
    retreat: float = 0.12
    most: int = 64
    latency: float = 0.1

    def __post_init__(self) -> None:
        require(
            "reranked ",
            ("comfort", self.comfort, 0.0 <= self.comfort <= 1.0, "from 0 to 1"),
            ("margin", self.margin, self.margin >= 0.0, "0 or more"),
            ("manipulability", self.manipulability, self.manipulability >= 0.0, "0 or more"),
            ("balance", self.balance, self.balance >= 0.0, "0 or more"),
            ("level", self.level, self.level >= 0.0, "0 or more"),
        )


class Reranking:
    """The grasps of another method, first those that the arm can do and of them what suits it; see `GraspMethod`.

    Scores of those that the arm can do are from 1 to 2, those of the others from 0 to 1. The others follow in the
    proposer's order. The latency is that of both together.
    """

    def __init__(self, config: RerankingConfig | None = None) -> None:
        """Make the proposer. Raises ConfigError, ModuleFault: it cannot be made; see `registry.create`."""
        self.config = c = config or RerankingConfig()
        if c.proposer.use == "reranked":
            raise ConfigError("Reranked grasps are not ranked again; choose another proposer.")
        self._proposer: GraspMethod = registry.create("grasp_method", c.proposer.use, c.proposer.options)
        self.latency = self._proposer.latency + c.latency
        self._ik, self._robot = QuickIK(), PlanningRobot()

    def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:
        check_finite("the object's position", target.position)
        grasps = self._proposer.propose(target, scene, gripper)
        if not grasps:
            return []
        q = POSTURES["ready"] if gripper.q is None else gripper.q
        q = np.clip(q, self._robot.lower, self._robot.upper)
        T_base_odom = np.asarray(np.linalg.inv(gripper.T_odom_base), np.float64)
        space = self._space(q, target, scene, T_base_odom)
        best = max(max(grasp.score for grasp in grasps), 1e-9)
        worth = [min(max(grasp.score / best, 0.0), 1.0) for grasp in grasps]
        comfort = self._comfort(grasps[: self.config.most], gripper, q, space, T_base_odom)
        done = [
            replace(grasps[k], score=1.0 + worth[k] * (1.0 - self.config.comfort * (1.0 - ease)))
            for k, ease in comfort.items()
        ]
        left = [replace(grasp, score=worth[k]) for k, grasp in enumerate(grasps) if k not in comfort]
        return sorted(done, key=lambda grasp: -grasp.score) + left

    def servo(self, target: LocalizedObject, grasp: Grasp, t: float) -> ServoLaw | None:
        return self._proposer.servo(target, grasp, t)

    def _space(self, q: Array, target: LocalizedObject, scene: Array, T_base_odom: Array) -> JointSpace:
        """Return the postures that are free of the robot itself and of what the scene shows.

        What the fingers close on is not in the way: the proposer looks after them.
        """
        R, p = T_base_odom[:3, :3], T_base_odom[:3, 3]
        points = scene[:: max(1, len(scene) // SCENE)] @ R.T + p
        thing = target.points[np.isfinite(target.points).all(axis=1)]
        spared = room_around((thing if len(thing) else target.position[None]) @ R.T + p)
        spheres = self._robot.model().placed(np.ascontiguousarray(q))
        return JointSpace(self._robot, q, scene_world(points, spheres, spared))

    def _comfort(
        self, grasps: Sequence[Grasp], gripper: Gripper, q: Array, space: JointSpace, T_base_odom: Array
    ) -> dict[int, float]:
        """Return the comfort, 0 to 1, of those `grasps` that the arm can do with the least turn of the torso."""
        named = [POSTURES["forward"], POSTURES["ready"]]
        if gripper.approach[2] < -ACROSS:
            named.reverse()
        balanced = space.centre_of_mass(q)
        for turn in TURNS:
            starts, comfort = np.array([q, *named]), dict[int, float]()
            starts[:, 0] = q[0] + turn
            for k, grasp in enumerate(grasps):
                there = self._posture(gripper.side, T_base_odom @ grasp.T_odom_gripper, starts, space)
                if there is not None:
                    comfort[k] = self._comfort_at(gripper.side, grasp, there, balanced, space)
            if comfort:
                return comfort
        return {}

    def _posture(self, side: Side, T: Array, starts: Array, space: JointSpace) -> Array | None:
        """Return a posture with the hand at `T` (4, 4), in base_link, that it comes to from a free one; or None.

        There only the robot itself is in the way: as with the skills, the proposer looks after what is at the fingers.
        """
        for start in starts:
            found = self._ik.approach(side, T, self.config.retreat, start[None])
            if found is None or space.verdict(found[0]) != FREE:
                continue
            if space.verdict(found[1]) in (FREE, WORLD):
                return found[1]
        return None

    def _comfort_at(self, side: Side, grasp: Grasp, posture: Array, balanced: Array, space: JointSpace) -> float:
        c, kinematics = self.config, self._ik.kinematics
        shift = float(np.linalg.norm((space.centre_of_mass(posture) - balanced)[:2]))
        margin = max(kinematics.margin(side, posture), 0.0) / COMFORT[0]
        manipulability = kinematics.manipulability(side, posture) / COMFORT[1]
        total = (
            c.margin * min(margin, 1.0)
            + c.manipulability * min(manipulability, 1.0)
            + c.balance * max(0.0, 1.0 - shift / c.shift)
            + c.level * (1.0 - abs(float(grasp.T_odom_gripper[2, 1])))
        )
        return total / max(c.margin + c.manipulability + c.balance + c.level, 1e-9)
