"""A pack of words: a job runs against skills that say what they did in a file, in a process that may be killed.

python -m tests.skills.job_world FOLDER [DIES_AT]: go on with the job in FOLDER; in the write number DIES_AT, die.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from tests.skills.conftest import modules

from golem.capabilities.navigation.edge_fit import NearEdge
from golem.interfaces import topics
from golem.interfaces.payloads import LegStatus
from golem.middleware.bus import Bus
from golem.robots.model.pinocchio_model import Kinematics
from golem.skills import pack_job
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.skills.disassemble import Disassemble
from golem.skills.disassemble_goal import DisassembleGoal
from golem.skills.job_file import JobFile
from golem.skills.kept_file import KeptFileConfig
from golem.skills.navigate import Navigate
from golem.skills.pack_view import NOTHING, SeenFasteners
from golem.skills.pick import Pick
from golem.skills.pick_config import PickOutcome, PickReport, Tried
from golem.skills.pick_targets import WANTED
from golem.skills.poses import stands_at
from golem.skills.runner import SkillRun
from golem.types import Array, BaseEstimate, PlanarPose, Twist

Pose = PlanarPose
NEAR_EDGE = Pose(0.5, 0.0, 0.0)
"""The pack in odom."""
RIM = -0.05
"""Height of the rim over base_link [m]."""
Says = Callable[[int, int], PickReport]
"""Number of a fastener and of the try -> what a pick reports of it; its places are filled in."""


def picked(number: int, tries: int) -> PickReport:
    """Take everything at the first try."""
    return PickReport(PickOutcome.PICKED.value, [], "yes", "yes")


def at(place: Any) -> PlanarPose:
    """Return the pose of a place."""
    return PlanarPose(float(place[0]), float(place[1]), 0.0)


class JobWorld:
    """A robot before a pack, as far as a job knows it.

    Attributes:
        asked: numbers of the fasteners that were asked for, in order.
        out: those that are out of their places; with the file `world.txt` of the folder they outlive the process.
        walked: way that the robot was sent along [m].
        palm_off: where palm cameras see fasteners, from where they are, in base_link [m].
        told: by how much each pick was told that they are off, in base_link [m].
        missed: how far from a fastener each pick was sent [m].
    """

    def __init__(self, places: Array, folder: Path, says: Says = picked, fails: str = "") -> None:
        self.places, self.folder, self.says, self.fails = places, folder, says, fails
        self.log = folder / "world.txt"
        lines = self.log.read_text().split("\n") if self.log.exists() else []
        self.out = {int(line[4:]) for line in lines if line.startswith("out ")}
        self.asked, self.palm_off, self.told = list[int](), (0.0, 0.0), list[tuple[float, ...]]()
        self.goals, self.missed = list[Any](), list[float]()
        self.walked, self.bus, self.t = 0.0, Bus(), 0.0
        self.pose = Pose(-0.7, 0.0, 0.0)
        made = {"pick": self._skill(Pick, self.pick), "navigate": self._skill(Navigate, self.navigate)}
        self.context = Context(self.bus, Kinematics(), 0.01, modules(skill=made.__getitem__))
        self._move(self.pose)

    def _skill(self, kind: type[Any], act: Callable[[Any], SkillResult]) -> Any:
        world = self

        class Skill:
            Goal = kind.Goal

            def timeout(self, goal: object) -> float:
                return 10.0

            async def run(self, context: Context, goal: object) -> SkillResult:
                await context.tick()
                world.goals.append(goal)
                if world.fails == kind.__name__:
                    return SkillResult(False, "look", "dock", "No edge.")
                return act(goal)

        return Skill()

    def _move(self, pose: PlanarPose) -> None:
        self.walked += float(np.hypot(pose.x - self.pose.x, pose.y - self.pose.y))
        self.pose = pose
        still = Twist(), Twist(), False, "", False, False, Pose(0.0, 0.0, 0.0), np.zeros(2)
        self.bus.publish(topics.LEG_STATUS, LegStatus(self.t, *still, "fake", None, 0.5), self.t)
        T = pose.matrix()
        self.bus.publish(topics.BASE, BaseEstimate(self.t, T, np.zeros(3), 0.0, np.zeros(2), False), self.t)

    def write(self, line: str) -> None:
        with self.log.open("a") as file:
            file.write(f"{line}\n")
            file.flush()
            os.fsync(file.fileno())

    def navigate(self, goal: Any) -> SkillResult:
        self._move(Pose(goal.x, goal.y, goal.yaw))
        return SkillResult(True, "done", None, "There.")

    def pick(self, goal: Any) -> SkillResult:
        in_pack = NEAR_EDGE.to(at(goal.wanted))
        away = np.hypot(self.places[:, 0] - in_pack.x, self.places[:, 1] - in_pack.y)
        number = int(away.argmin())
        self.missed.append(float(away.min()))
        self.asked.append(number)
        self.told.append(tuple(self.pose.matrix()[:2, :2].T @ goal.off) if goal.off else ())
        self.write(f"ask {number}")
        if number in self.out:
            return SkillResult(False, "detect", "localizer", "Nothing.", value=PickReport("nothing_there"))
        report = self.says(number, self.asked.count(number))
        there = NEAR_EDGE @ at(self.places[number])
        if report.outcome != PickOutcome.NOTHING_THERE:
            x, y = (there.x, there.y) + self.pose.matrix()[:2, :2] @ self.palm_off
            report.tried = [Tried(goal.side, x, y, 0.0, report.outcome)]
        if report.outcome == PickOutcome.PICKED:
            self.write(f"out {number}")
            self.out.add(number)
        good = report.outcome == PickOutcome.PICKED
        return SkillResult(
            good, "done" if good else "servo", None if good else "skill", f"{report.outcome}.", {}, report
        )

    async def see_edge(self, context: Context) -> NearEdge:
        await context.tick()
        return NearEdge(self.pose.to(NEAR_EDGE), 2.0, 0.0, 40, RIM)

    async def see_fasteners(
        self, context: Context, label: str, container: str, avoid: Array, around: bool, wanted: Array = NOTHING
    ) -> SeenFasteners:
        await context.tick()
        left = [k for k in range(len(self.places)) if k not in self.out]
        T = self.pose.matrix()
        odom = [NEAR_EDGE @ at(self.places[k]) for k in left]
        if len(wanted):
            here = [k for k, p in enumerate(odom) if stands_at(np.array([p.x, p.y]), wanted, WANTED)]
            left, odom = [left[k] for k in here], [odom[k] for k in here]
        base = [((p.x, p.y) - T[:2, 3]) @ T[:2, :2] for p in odom]
        seen = np.array([(*p, RIM + self.places[k, 2]) for p, k in zip(base, left, strict=True)]).reshape(-1, 3)
        return SeenFasteners(seen, np.ones(len(seen)), None)

    async def approach(self, context: Context, navigator: object, target: PlanarPose) -> None:
        await context.tick()
        if self.fails != "approach":
            self._move(target)

    def run(self, goal: DisassembleGoal, steps: int = 100_000) -> SkillResult:
        """Run the job to its end."""
        parts = {name: getattr(self, name) for name in ("see_edge", "see_fasteners", "approach")}
        with patch.multiple(pack_job, **parts):
            run = SkillRun("disassemble", Disassemble(KeptFileConfig(str(self.folder))).run(self.context, goal))
            while run.result is None and steps:
                steps -= 1
                self.t += 0.01
                self.context.refresh(self.t)
                self.bus.deliver(self.t)
                run.step()
        if run.error is not None:
            raise run.error
        assert run.result is not None
        return run.result


def write_list(path: Path, places: Array, kind: str = "screw") -> None:
    """Write a list of fasteners at `places` (n, 3)."""
    rows = [f"{kind},{x:.4f},{y:.4f},{z:.4f}" for x, y, z in places.tolist()]
    path.write_text("\n".join(["class,x,y,z", *rows]) + "\n")


def edge_places(n: int) -> Array:
    """Return (n, 3) places along the near edge, and two far ones that give the pack its size."""
    y = np.linspace(-0.9, 0.9, n)
    far = np.array([(1.15, -0.9, 0.0), (1.15, 0.9, 0.0)])
    return np.concatenate([np.column_stack([np.full(n, 0.022), y, np.zeros(n)]), far])


def main() -> None:
    """Run a job in this process."""
    folder, dies = Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0
    written = 0

    def die(statement: str) -> None:
        nonlocal written
        if statement.startswith("INSERT INTO events"):
            written += 1
        if dies and written == dies:
            # In the midst of the statement, after some of its steps.
            opened[0]._base.set_progress_handler(lambda: os.kill(os.getpid(), signal.SIGKILL), 5)

    opened = list[JobFile]()
    begin = JobFile._open

    def opening(self: JobFile) -> None:
        begin(self)
        opened[:] = [self]
        self._base.set_trace_callback(die)

    with patch.object(JobFile, "_open", opening):
        goal = DisassembleGoal(list="list.csv", job="pack.sqlite")
        result = JobWorld(edge_places(30), folder).run(goal)
    print(result.reason)


if __name__ == "__main__":
    main()
