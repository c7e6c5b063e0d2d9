"""Rungs `fridge-tether` and `fridge-stand`: grasp the handle of a fridge and pull its door open.

Both run the same trials: trial `i` of one seed has the same kitchen, calibration errors and noise on either rung.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from golem.evaluation.base import DONE, TrialSpec
from golem.evaluation.episodes.counter_watch import ErrandWatch
from golem.evaluation.episodes.oracle import Oracle
from golem.evaluation.rungs.kitchen_rung import Errand, KitchenOptions, KitchenRung, Verdict
from golem.robots.mujoco.balance import BalanceRecorder
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.worlds.kitchen import KitchenLayout
from golem.runtime.lockstep import LockstepRunner
from golem.skills.open_door import OpenGoal, OpenReport
from golem.types import Side

OPENED = 0.30
"""Angle from which on a door is open [rad]: 17 deg, 16 cm at the handle; the skill is asked for 23 deg."""


class FridgeRung(KitchenRung[KitchenOptions]):
    """One fridge per trial: its handle is seen, grasped, and pulled along its circle."""

    default_methods = ("centroid", "antipodal", "reranked")

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        return {**super().config(method, profile, overrides), "goal": asdict(OpenGoal())}

    def errand(
        self, spec: TrialSpec, running: LockstepRunner, robot: MujocoRobot, kitchen: KitchenLayout, oracle: Oracle
    ) -> Errand:
        side: Side = "left" if kitchen.fridge.handle_y > 0.0 else "right"
        watch = _FridgeWatch(running, robot, oracle, side, self.balances)
        result = running.execute("open", OpenGoal(), watch=watch)
        said = result.value.angle if isinstance(result.value, OpenReport) else 0.0

        def judge() -> Verdict:
            angle = watch.angle
            words = f"The door is open by {np.rad2deg(angle):.0f} deg."
            series = {"door_angle": angle, "door_angle_error": said - angle, **watch.grasp}
            return Verdict(angle >= OPENED, words, series)

        return Errand(result, watch, judge)


class FridgeTether(FridgeRung):
    """Open a fridge while the robot hangs in its hoist: perception and manipulation without balance."""

    name = "fridge-tether"


class FridgeStand(FridgeRung):
    """Open a fridge while the robot balances; the lower body can be replaced with `--use lower_body=...`."""

    name = "fridge-stand"
    balances = True


class _FridgeWatch(ErrandWatch):
    """Looks on after every tick: how far the door is open, where the hand was when it closed."""

    def __init__(self, running: LockstepRunner, robot: MujocoRobot, oracle: Oracle, side: Side, balances: bool) -> None:
        assert robot.scene.seal is not None
        super().__init__(running, oracle, BalanceRecorder(robot) if balances else None)
        self._robot = robot
        self._side: Side = side
        self._hinge = robot.scene.seal.qpos
        self.grasp: dict[str, float] = {}

    @property
    def angle(self) -> float:
        """How far the door is open [rad]."""
        return float(self._robot.data.qpos[self._hinge])

    def __call__(self) -> None:
        self.look()
        feedback = self._news.read()
        if feedback is None:
            return
        if feedback.stage == "grasp" and not feedback.data.get("failed"):
            self.grasp = self._where()
        if feedback.stage in ("release", DONE) or feedback.data.get("failed"):
            self.picture = self.last_picture()

    def _where(self) -> dict[str, float]:
        """Return how far across its approach the hand is from the bar, and from where it was sent [m]."""
        T = self._oracle.gripper(self._side)
        sent = self._running.commanded(self._side)
        T_odom_world = np.linalg.inv(self._robot.truth.T_world_odom)
        bar = self._robot.data.geom("fridge_bar")
        foot, axis = bar.xpos, bar.xmat.reshape(3, 3)[:, 2]
        foot, axis = T_odom_world[:3, :3] @ foot + T_odom_world[:3, 3], T_odom_world[:3, :3] @ axis
        off = foot - T[:3, 3]
        off = off - (off @ axis) * axis
        return {
            "handle_miss": abs(float(off @ T[:3, 1])),
            "handle_reach": float(np.linalg.norm(sent[:3, 3] - T[:3, 3])),
        }
