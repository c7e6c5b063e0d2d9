"""Mapping a hall: from frontier to frontier until there is nothing more to see, then home."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from golem.capabilities.mapping.map_file import CLOUD, load_map
from golem.capabilities.navigation.frontiers import frontiers
from golem.interfaces import topics
from golem.interfaces.nav_payloads import MapFile
from golem.middleware.bus import News
from golem.options import require
from golem.skills.base import SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.kept_file import KeepsFiles, check_file_name, kept_file
from golem.skills.navigate import FIRST_MAP
from golem.skills.pose_goal import FIRST_REPORT, MARGIN, MAX_TIMEOUT, go_to, standing_after_failure
from golem.types import PlanarPose

RADIUS = 0.55
"""Distance that the robot keeps from obstacles where it looks at a frontier [m]: half its width and some more."""
LOOK = 1.5
"""Time that it looks at a frontier [s]."""
SAVING = 5.0
"""Time that the map gets to be written [s]."""
LEG = 60.0
"""Time for the way to one frontier [s]."""


@dataclass(frozen=True, slots=True)
class ExploreGoal:
    """How far to go.

    Attributes:
        most: frontiers that are visited at most.
        save: plain name of the map's files, without ending; empty for none. The folder is an option of the skill.
        timeout: time after which the robot goes home [s].
    """

    most: int = 20
    save: str = ""
    timeout: float = 600.0

    def __post_init__(self) -> None:
        require(
            "goal of exploring: ",
            ("most", self.most, self.most >= 0, "not negative"),
            ("timeout", self.timeout, 0.0 < self.timeout <= MAX_TIMEOUT, "a time of at most an hour"),
        )
        check_file_name(self.save)


class Explore(KeepsFiles):
    """Map the hall by walking to where the map ends, come home, and keep the map if asked to.

    Stages (see `Skill`): `locate`, `explore`, `home`, `save`, `done`. A frontier that cannot be reached is left out.
    Where the legs or the way home fail, the map is kept all the same.
    """

    Goal = ExploreGoal

    def timeout(self, goal: ExploreGoal) -> float:
        # The last frontier may be set out for just before the goal's time is over; then home.
        return goal.timeout + LEG + LOOK + 2.0 * LEG + FIRST_MAP + SAVING + MARGIN

    async def run(self, context: Context, goal: ExploreGoal) -> SkillResult:
        start, path = context.t, self._file(goal.save) if goal.save else None
        await context.until(lambda: context.legs.reporting, FIRST_REPORT)
        context.legs.check_walking()
        if not await context.until(lambda: context.mapped, FIRST_MAP):
            context.legs.check_located()
            raise StageFailed("locate", "mapper", f"There is no map after {FIRST_MAP:g} s.")
        try:
            with standing_after_failure(context):
                text = await self._tour(context, goal, start)
        except StageFailed as failure:
            saved = await self._save(context, path) if path else ""
            raise StageFailed(failure.stage, failure.slot, f"{failure}{saved}") from failure
        text += await self._save(context, path) if path else ""
        context.say("done", text)
        return SkillResult(True, "done", None, text, {"explore": context.t - start})

    async def _tour(self, context: Context, goal: ExploreGoal, start: float) -> str:
        """Go from frontier to frontier, and home; returns what came of it."""
        home, given_up, visited = self._here(context), list[PlanarPose](), 0
        while visited < goal.most and context.t - start < goal.timeout:
            target = self._next(context, given_up)
            if target is None:
                break
            context.say("explore", f"Frontier {visited + 1}: ({target.x:.1f}, {target.y:.1f}).")
            try:
                await go_to(context, target, "map", LEG, "explore")
            except StageFailed as failure:
                if failure.slot != "navigator":
                    raise
            visited += 1
            given_up.append(target)  # one look is enough: what it did not show, another will not
            await context.sleep(LOOK)
        context.say("home", f"{visited} frontiers seen; going home.")
        result = await go_to(context, home, "map", 2.0 * LEG, "home")
        return f"{visited} frontiers seen in {context.t - start:.0f} s. {result.reason}"

    def _file(self, name: str) -> Path:
        """Return the path of a map without its ending. Raises ConfigError: something else has one of its names."""
        for ending in (".pgm", CLOUD):
            kept_file(self.config.folder, f"{name}{ending}", _of_a_map)
        return kept_file(self.config.folder, f"{name}.yaml", load_map).with_suffix("")

    def _here(self, context: Context) -> PlanarPose:
        return context.T_odom_map.to(PlanarPose.of(context.legs.pose))

    def _next(self, context: Context, given_up: list[PlanarPose]) -> PlanarPose | None:
        """Return from where to look at the frontier that is worth most; None where none is left."""
        grid = context.bus.latest(topics.MAP)
        if grid is None:
            return None
        for frontier in frontiers(grid.in_map, RADIUS, self._here(context)):
            near = (math.hypot(frontier.pose.x - p.x, frontier.pose.y - p.y) < RADIUS for p in given_up)
            if not any(near):
                return frontier.pose
        return None

    async def _save(self, context: Context, path: Path) -> str:
        news = News(context.bus, topics.MAP_SAVED)
        context.publish(topics.MAP_SAVE, MapFile(str(path)))
        found: list[MapFile] = []

        def answered() -> bool:
            answer = news.read()
            found.extend([] if answer is None else [answer])
            return bool(found)

        if not await context.until(answered, SAVING):
            raise StageFailed("save", "mapper", f"The map was not written within {SAVING:g} s.")
        if found[0].problem:
            raise StageFailed("save", "mapper", found[0].problem)
        return f" The map is in {path}.yaml."


def _of_a_map(file: Path) -> None:
    """Check that an image, or the voxels, belong to a map. Raises ConfigError: they do not."""
    load_map(file.with_suffix(".yaml"))
