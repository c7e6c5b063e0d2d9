"""Search: find a thing by its name: where it was, then where such things were, then where the map ends."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from golem.capabilities.memory.base import HasPlaces
from golem.capabilities.navigation.frontiers import frontiers
from golem.errors import ConfigError
from golem.interfaces import topics
from golem.options import require
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.skills.explore import LOOK, RADIUS
from golem.skills.fetch import SAME, STAGE, TURN, before
from golem.skills.navigate import NavigateGoal
from golem.skills.pose_goal import FIRST_REPORT
from golem.skills.recall import RecalledPlaces, ask
from golem.skills.remember import RememberGoal
from golem.types import PlanarPose

AGO = 5.0
"""Age up to which a sighting is of the look just made [s]."""
GIVEN_UP = 0.5
"""Places nearer than this to one that was looked at from are not gone to again [m]."""
ANYTHING = 50
"""Most places of other things that are thought of."""


@dataclass(frozen=True, slots=True)
class SearchGoal:
    """What to find.

    Attributes:
        text: the thing, in words that localizer and memory know.
        places: how many places are gone to at most.
    """

    text: str
    places: int = 6

    def __post_init__(self) -> None:
        if not self.text.strip():
            raise ConfigError("Searching needs the name of a thing, such as 'mug'.")
        require("goal of searching: ", ("places", self.places, 0 <= self.places <= 30, "from 0 to 30"))


class Search:
    """Find a thing: look where it was, then where such things were, then where the map ends.

    Stages (see `Skill`): `look`, those of `navigate`, `done`. Legs that do not walk look from where they are.
    """

    Goal, Result = SearchGoal, RecalledPlaces

    def timeout(self, goal: SearchGoal) -> float:
        return 60.0 + 90.0 * goal.places

    async def run(self, context: Context, goal: SearchGoal) -> SkillResult:
        await context.until(lambda: context.legs.reporting, FIRST_REPORT)
        walks, gone = context.legs.status.speed > 0.0, list[PlanarPose]()
        while True:
            found = await self._look(context, goal)
            if found is not None:
                return found
            target = await self._next(context, goal, gone) if walks and len(gone) < goal.places else None
            if target is None:
                return SkillResult(False, "look", "memory", f"No {goal.text} is seen, from {len(gone) + 1} places.")
            gone.append(target)
            walk = NavigateGoal(target.x, target.y, target.yaw, "odom", content=0.15)
            walked = await context.run("navigate", walk)
            if not walked.success:
                context.say(walked.stage, f"{walked.reason} The next place.")

    async def _look(self, context: Context, goal: SearchGoal) -> SkillResult | None:
        await context.run("remember", RememberGoal((goal.text,), LOOK))
        seen = await ask(context, goal.text, "now", None, 3)
        seen.places = [place for place in seen.places if place.last_seen < AGO and place.evidence == "seen"]
        if not seen.places:
            return None
        text = f"The {goal.text} is at ({seen.places[0].x:.2f}, {seen.places[0].y:.2f}) in {seen.frame}."
        context.say("done", text)
        return SkillResult(True, "done", None, text, value=seen)

    async def _next(self, context: Context, goal: SearchGoal, gone: list[PlanarPose]) -> PlanarPose | None:
        """Return from where to look next, in odom; None where nothing is left."""
        here, mapped = PlanarPose.of(context.legs.pose), context.mapped
        was = (await ask(context, goal.text, "anywhere", None, goal.places or 1)).places
        places, memory = [(p.x, p.y) for p in was], context.modules.memory
        # Things of a kind stand together: where anything stood, this may.
        others = memory.places(ANYTHING) if isinstance(memory, HasPlaces) else []
        places += [(float(p.position[0]), float(p.position[1])) for p in others]
        spots = [context.T_odom_memory @ PlanarPose(x, y, 0.0) for x, y in places]
        targets = [before(here, np.array((spot.x, spot.y)), STAGE) for spot in spots if not _seen_from(gone, spot)]
        grid = context.bus.latest(topics.MAP)
        if grid is not None and mapped:
            local = context.T_odom_map.to(here)
            targets += [context.T_odom_map @ each.pose for each in frontiers(grid.in_map, RADIUS, local)]
        if not (spots or targets):
            targets = [here @ PlanarPose(0.0, 0.0, TURN * turn) for turn in (1, -1)]
        for target in targets:
            if all(_apart(target, other) for other in (*gone, here)):
                return target
        return None


def _seen_from(gone: list[PlanarPose], spot: PlanarPose) -> bool:
    """Return whether one of the poses that were `gone` to is before `spot`, from whichever side."""
    ahead = (pose @ PlanarPose(STAGE, 0.0, 0.0) for pose in gone)
    return any(math.hypot(there.x - spot.x, there.y - spot.y) < SAME for there in ahead)


def _apart(a: PlanarPose, b: PlanarPose) -> bool:
    turned = math.remainder(a.yaw - b.yaw, math.tau)
    return math.hypot(a.x - b.x, a.y - b.y) > GIVEN_UP or abs(turned) > 0.5 * TURN
