"""Whole packs where something is not as it seems: two odoms, neighbours, trays, picks that never end."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from tests.skills.job_world import NEAR_EDGE, JobWorld, at, edge_places, picked, write_list

from golem.interfaces import topics
from golem.interfaces.payloads import Odometry
from golem.skills.base import TIMEOUT, SkillResult
from golem.skills.context import Context
from golem.skills.disassemble_goal import DisassembleGoal
from golem.skills.pack_view import SeenFasteners
from golem.skills.pick_config import PickReport, Tried
from golem.types import PlanarPose

PLACES = edge_places(30)
GOAL = DisassembleGoal(list="list.csv", job="pack.sqlite")
DRIFT = PlanarPose(0.05, 0.04, 0.01)
"""The estimator's odom in that of the odometry."""


class TwoOdoms(JobWorld):
    """Detections and hands are in the estimator's odom; the odometry has one of its own, as `lio` has."""

    def tell(self) -> None:
        """Publish where the odometry has the robot."""
        self.bus.publish(topics.ODOMETRY, Odometry(self.t, (DRIFT @ self.pose).matrix()), self.t)

    def navigate(self, goal: Any) -> SkillResult:
        there = DRIFT.to(PlanarPose(goal.x, goal.y, goal.yaw))
        self._move(there)
        self.tell()
        return SkillResult(True, "done", None, "There.")

    async def approach(self, context: Context, navigator: object, target: PlanarPose) -> None:
        await context.tick()
        self._move(DRIFT.to(target))
        self.tell()

    def run(self, goal: DisassembleGoal, steps: int = 100_000) -> SkillResult:
        refresh = self.context.refresh

        def told(t: float) -> None:
            self.tell()
            refresh(t)

        self.context.refresh = told
        return super().run(goal, steps)


def test_what_is_asked_for_is_in_the_odom_of_what_cameras_see(tmp_path: Path) -> None:
    write_list(tmp_path / "list.csv", PLACES)
    world = TwoOdoms(PLACES, tmp_path)
    assert world.run(GOAL).value.fates == ["in_tray"] * 32
    assert max(world.missed) < 1e-3


def test_a_place_at_which_a_hand_always_meets_the_neighbour_is_given_up(tmp_path: Path) -> None:
    class Askew(JobWorld):
        def pick(self, goal: Any) -> SkillResult:
            result = super().pick(goal)
            if self.asked[-1] == 5:
                there = NEAR_EDGE @ at(self.places[4])
                result.value.tried = [Tried(goal.side, there.x, there.y, 0.0, "tight")]
            return result

    write_list(tmp_path / "list.csv", PLACES)
    world = Askew(PLACES, tmp_path, lambda n, tries: PickReport("tight") if n in (4, 5) else picked(n, tries))
    fates = world.run(GOAL, 20_000).value.fates
    assert fates[4:6] == ["tight", "not_found"] and world.asked.count(5) <= 4
    assert Counter(fates)["in_tray"] == 30


def with_trays(folder: Path, places: Any, trays: dict[str, tuple[float, float]], outcome: str) -> JobWorld:
    """Return a world with a list of screws and trays; of the first tray a pick says `outcome`."""
    rows = [f"screw,{x:.4f},{y:.4f},{z:.4f},S{k}," for k, (x, y, z) in enumerate(places.tolist())]
    rows += [f"tray,{x},{y},0.01,{name},screw" for name, (x, y) in trays.items()]
    (folder / "list.csv").write_text("\n".join(["class,x,y,z,name,takes", *rows]))
    first = NEAR_EDGE.matrix()[:2, 3] + next(iter(trays.values()))

    def says(number: int, tries: int) -> PickReport:
        it = np.linalg.norm(first - world.goals[-1].container_at) < 0.05
        return PickReport(outcome) if it else picked(number, tries)

    world = JobWorld(places, folder, says)
    return world


def test_what_only_a_full_tray_can_take_waits_until_it_is_emptied(tmp_path: Path) -> None:
    world = with_trays(tmp_path, edge_places(8), {"near": (0.145, 0.0), "far": (1.0, 0.6)}, "tray_full")
    result = world.run(GOAL)
    waiting = Counter(result.value.fates)["open"]
    assert waiting > 3 and f"{waiting} wait" in result.reason and "near" in result.reason
    world.says = picked
    assert Counter(world.run(DisassembleGoal(job="pack.sqlite")).value.fates)["in_tray"] > waiting / 2


def test_a_tray_that_is_not_seen_does_not_end_the_job(tmp_path: Path) -> None:
    trays = {"a": (0.145, -0.3), "b": (0.145, 0.35), "c": (1.0, 0.6), "d": (1.0, -0.6)}
    fates = Counter(with_trays(tmp_path, PLACES, trays, "tray_missing").run(GOAL).value.fates)
    assert fates["in_tray"] > 16 and fates["in_tray"] + fates["open"] == 32


def test_a_pick_that_never_ends_ends_the_job(tmp_path: Path) -> None:
    """Its hand stays where it is, perhaps at a fastener: nobody walks on with it."""

    class Late(JobWorld):
        def _skill(self, kind: type[Any], act: Callable[[Any], SkillResult]) -> Any:
            skill = super()._skill(kind, act)
            run = skill.run

            async def slow(context: Context, goal: object) -> SkillResult:
                if kind.__name__ == "Pick" and len(self.asked) == 3:
                    await context.sleep(20.0)
                return await run(context, goal)

            skill.run = slow
            return skill

    write_list(tmp_path / "list.csv", PLACES)
    result = Late(PLACES, tmp_path).run(GOAL)
    assert not result.success and result.stage == TIMEOUT
    assert Counter(result.value.fates)["in_tray"] == 3


def test_a_tray_that_the_view_cuts_off_does_not_move_the_pack(tmp_path: Path) -> None:
    """Its middle is 6 cm off. What stands there says better where the pack is."""
    trays = {"a": (0.145, -0.3), "b": (0.145, 0.35)}

    class CutOff(JobWorld):
        async def see_fasteners(self, *args: Any, **options: Any) -> SeenFasteners:
            seen = await super().see_fasteners(*args, **options)
            T = self.pose.matrix()
            place = NEAR_EDGE @ at(np.add(trays["a"], (0.0, 0.06)))
            tray = np.append(((place.x, place.y) - T[:2, 3]) @ T[:2, :2], 0.0)
            return replace(seen, tray=tray)

    with_trays(tmp_path, PLACES, trays, "tray_full")
    world = CutOff(PLACES, tmp_path)
    fates = world.run(GOAL).value.fates
    assert Counter(fates)["in_tray"] > 20 and max(world.missed) < 1e-3
