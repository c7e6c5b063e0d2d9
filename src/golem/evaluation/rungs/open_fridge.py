"""Rungs `fridge-tether` and `fridge-stand`: grasp the handle of a fridge and pull its door open.

Both run the same trials: trial `i` of one seed has the same kitchen, calibration errors and noise on either rung.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from golem import registry
from golem.errors import ConfigError
from golem.evaluation.base import DONE, Rung, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import episode_seed, lost
from golem.evaluation.episodes.oracle import Oracle
from golem.evaluation.rungs.pick_screw import ABORTED, SLOT, balance, let_go
from golem.interfaces import topics
from golem.middleware.bus import News
from golem.provenance import stack_facts
from golem.robots.mujoco.balance import TRACE, BalanceRecorder
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.gl import shared_context
from golem.robots.worlds.conditions import LayoutKind
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.open_door import OpenGoal, OpenReport
from golem.slots import KEYS
from golem.stack import Stack, load_stack
from golem.types import Side

OPENED = 0.30
"""Angle from which on a door is open [rad]: 17 deg, 16 cm at the handle; the skill is asked for 23 deg."""
SETTLE = 1.0
"""Robot time that a door gets to come to rest [s]."""


@dataclass(frozen=True)
class FridgeOptions:
    """The kitchen."""

    layout: LayoutKind = "varied"
    """nominal: the fridge always stands at the same place and opens to the right. varied: places, sizes, colours and
    the side of the hinge are drawn from the trial's seed."""


class FridgeRung(Rung[FridgeOptions]):
    """One fridge per trial: its handle is seen, grasped, and pulled along its circle.

    Attributes:
        name: of the rung, and of the shipped stack it runs.
        balances: whether the robot stands on its own feet.
    """

    Options = FridgeOptions
    default_methods = ("centroid", "antipodal", "reranked")
    balances = False

    def methods(self) -> tuple[str, ...]:
        """Return the registered grasp methods."""
        return registry.names(SLOT)

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        """Return what determines a trial besides its seed; see `Rung`."""
        stack = self._stack(method, profile, overrides)
        for key, row in KEYS.items():
            registry.load(row.slot, stack.choice(key).use)
        shared_context()
        return {**stack_facts(stack), "goal": asdict(OpenGoal())}

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        """Run one trial; see `Rung`."""
        stack = self._stack(spec.method, spec.profile, spec.overrides)
        running, robot = build(stack, episode_seed(spec.seed, spec.index))
        if not isinstance(robot, MujocoRobot) or robot.scene.seal is None or robot.scene.kitchen is None:
            raise ConfigError(
                f"Rung {self.name} judges the twin's kitchen; robot: {stack.choice('robot').use} is none."
            )
        if self.onlooker is not None:
            self.onlooker(running, robot)
        oracle = Oracle(robot)
        try:
            hangs = let_go(running, robot) if self.balances else None
            if hangs is not None:
                return hangs
            side: Side = "left" if robot.scene.kitchen.fridge.handle_y > 0.0 else "right"
            watch = _FridgeWatch(running, robot, oracle, side, self.balances)
            result = running.execute("open", OpenGoal(), watch=watch)
            running.executor.run(running.executor.t + SETTLE, watch.look)
            if artefacts is not None and watch.recorder is not None:
                watch.recorder.trace().save(artefacts / TRACE)
            return self._judge(stack, running, result, watch)
        finally:
            oracle.close()
            robot.close()

    def _judge(self, stack: Stack, running: LockstepRunner, result: Any, watch: _FridgeWatch) -> TrialOutcome:
        """Say whether the door is open and the robot still there, and if not, which module lost it."""
        angle = watch.angle
        said = result.value.angle if isinstance(result.value, OpenReport) else 0.0
        series = {"door_angle": angle, "door_angle_error": said - angle, **watch.grasp}
        if watch.recorder is not None:
            series |= balance(watch.recorder.trace())
        loss = lost(running, watch.recorder)
        if loss is not None and result.stage not in ABORTED:
            module = f"lower_body: {stack.choice('lower_body').use}" if self.balances else None
            detail = f"{loss.detail} The errand itself: {result.reason}"
            return TrialOutcome(
                False, loss.stage, module, detail, result.timings, series, watch.last_picture(), loss.trace
            )
        if angle >= OPENED and result.stage not in ABORTED:
            return TrialOutcome(True, DONE, None, result.reason, result.timings, series, watch.last_picture())
        stage = result.stage if result.stage != DONE else "release"
        slot = result.slot if result.stage != DONE else SLOT
        module = None if slot is None else f"{slot}: {stack.choice(slot).use}" if slot in KEYS else slot
        detail = f"{result.reason} The door is open by {np.rad2deg(angle):.0f} deg."
        return TrialOutcome(
            False, stage, module, detail, result.timings, series, watch.last_picture(), result.trace
        )

    def _stack(self, method: str, profile: str, overrides: Mapping[str, str]) -> Stack:
        if SLOT in overrides or "robot" in overrides:
            raise ConfigError(
                f"The method is what sits in {SLOT}, and the kitchen is the rung's; leave out --use {SLOT}=... and "
                "--use robot=..."
            )
        stack = load_stack(self.name, profile=profile).with_choice(SLOT, method)
        stack = stack.with_options("robot", layout=self.options.layout)
        for slot, use in overrides.items():
            stack = stack.with_choice(slot, use)
        return stack


class FridgeTether(FridgeRung):
    """Open a fridge while the robot hangs in its hoist: perception and manipulation without balance."""

    name = "fridge-tether"


class FridgeStand(FridgeRung):
    """Open a fridge while the robot balances; the lower body can be replaced with `--use lower_body=...`."""

    name = "fridge-stand"
    balances = True


class _FridgeWatch:
    """Looks on after every tick: how far the door is open, where the hand was when it closed."""

    def __init__(
        self, running: LockstepRunner, robot: MujocoRobot, oracle: Oracle, side: Side, balances: bool
    ) -> None:
        assert robot.scene.seal is not None
        self._running, self._robot, self._oracle = running, robot, oracle
        self._side: Side = side
        self._hinge = robot.scene.seal.qpos
        self.recorder = BalanceRecorder(robot) if balances else None
        self._news = News(running.bus, topics.FEEDBACK)
        self.grasp: dict[str, float] = {}
        self._picture: bytes | None = None

    @property
    def angle(self) -> float:
        """How far the door is open [rad]."""
        return float(self._robot.data.qpos[self._hinge])

    def last_picture(self) -> bytes:
        """Return the decisive picture: of the pull, or of now."""
        return self._picture or self._oracle.picture()

    def look(self) -> bool:
        """Look on after the errand; it is never a reason to end."""
        if self.recorder is not None:
            self.recorder(self._running.executor.t)
        return False

    def __call__(self) -> None:
        self.look()
        feedback = self._news.read()
        if feedback is None:
            return
        if feedback.stage == "grasp" and not feedback.data.get("failed"):
            self.grasp = self._where()
        if feedback.stage in ("release", DONE) or feedback.data.get("failed"):
            self._picture = self._picture or self._oracle.picture()

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
