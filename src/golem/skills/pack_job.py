"""A whole pack, fastener by fastener: plan, go, dock, take, look, keep what happened, and plan anew."""

from __future__ import annotations

import math

import numpy as np

from golem.capabilities.navigation.goto import GoTo
from golem.interfaces import topics
from golem.interfaces.memory_payloads import ShownPicture
from golem.skills.base import FAULT, REFUSED, TIMEOUT, SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.disassemble_goal import DisassembleGoal, DisassembleReport
from golem.skills.dock import SETTLE, STEPS, DockReport, approach
from golem.skills.fastener_list import KINDS, Listed
from golem.skills.gantry import KEEP_OFF, Gantry
from golem.skills.job_file import TO_DO, Fate, JobFile, PackFastener
from golem.skills.navigate import NavigateGoal
from golem.skills.pack_picture import pack_picture
from golem.skills.pack_plan import PackSides, PackStop, make_plan, stands_well
from golem.skills.pack_view import NOTHING, SeenRim, fit_frames, matched, see_edge, see_fasteners
from golem.skills.pick_config import PickGoal, PickOutcome, PickReport, Sight
from golem.skills.pick_targets import WANTED
from golem.skills.stance_choice import OVER_TRAY, takes, within_reach
from golem.types import Array, PlanarPose, Side

ORDER = ("near", "left", "far", "right")
"""Sides of a pack, as in `PackSides`."""
PLANNING = 1.0
"""Time that a plan takes [s]."""
TRIES = 2
"""How often a fastener is tried, from two stances or with two hands where there are such."""
STRIKES = 3
"""Stops in a row that the robot does not get to, or where no container is seen, after which the job ends."""
SHIFTED = 0.3
"""Farthest that the container may be seen from where it is listed, for the pack to be found by it [m]."""
LONG = 0.25
"""Extent of the fasteners by which the turn of the pack is measured [m]."""
FARTHEST_OFF = 0.08
"""How far a palm camera may see things elsewhere than the head camera [m]: each is off by centimetres."""
AROUND = 0.3
"""What stands this near to a fastener a palm camera may see with it [m]."""
BESIDE = 1.0
"""A stance this near is gone to straight along the edge [m]."""
BACK = 0.35
"""How far the robot steps back before it walks elsewhere [m]."""
APPROACHES = 3
"""How often it steps there, seeing better where the pack is each time."""
STAGE = 0.75
"""Distance before a stance up to which the navigator brings the robot [m]: nearer its arms are above the pack."""
CONTENT = 0.1
"""Distance from there with which it is content [m]."""
FATES = {
    PickOutcome.TIGHT: Fate.TIGHT,
    PickOutcome.JAMMED: Fate.JAMMED,
    PickOutcome.OUT_OF_REACH: Fate.OUT_OF_REACH,
    PickOutcome.TRAY_OUT_OF_REACH: Fate.OUT_OF_REACH,
    PickOutcome.BLOCKED: Fate.BLOCKED,
    PickOutcome.NOTHING_THERE: Fate.NOT_FOUND,
}
"""What becomes of a fastener that is not tried again."""
AT_IT = (PickOutcome.PICKED, PickOutcome.TIGHT, PickOutcome.JAMMED, PickOutcome.SLIPPED)
"""Outcomes of a try in which the palm camera saw the fastener."""
NO_TRAY = (PickOutcome.TRAY_FULL, PickOutcome.TRAY_MISSING)


class PackJob:
    """One pursuit of a job.

    Attributes:
        report: what was done.
    """

    def __init__(self, context: Context, goal: DisassembleGoal, book: JobFile) -> None:
        """Go on with what `book` has open."""
        self._context, self._goal, self._book = context, goal, book
        self.report, self._gantry = DisassembleReport(), Gantry(context, book)
        self._sides = PackSides(np.array([one.place for one in book.fasteners]))
        self._T_odom_pack = PlanarPose(0.0, 0.0, 0.0)
        self._rim = SeenRim()  # above base_link, had the legs no height
        self._off = dict[str, Array]()  # (2,) from what the head camera sees to what a hand's does, in base_link [m]
        self._full, self._doubted, self._strikes = set[str](), set[str](), 0
        self._stops: list[PackStop] = []

    async def run(self) -> SkillResult:
        """Take out what is open; return how it went.

        Raises:
            StageFailed: the pack is not seen, or the robot does not get on.
        """
        start, first = self._context.t, True
        with self._context.minding(self._gantry):
            await self._find()
            while True:
                todo = [one for one in self._book.fasteners if self._wanted(one)]
                plan = await self._plan(todo)
                if first:
                    self.report.stops, self.report.planned, first = len(plan), sum(s.way for s in plan), False
                if plan:
                    await self._work(plan[0])
                elif self._goal.loosened != "gantry" or self._gantry.silent:
                    break
                else:
                    heard = self._gantry.t
                    await self._context.until(lambda: self._gantry.t != heard or self._gantry.silent, math.inf)  # noqa: B023
        for one in todo:
            if not (self._near_gantry(one.place[:2]) or self._full & {tray.name for tray in self._listed(one.label)}):
                await self._tell(one, Fate.OUT_OF_REACH, "From no stance a hand reaches it and a container for it.")
        return self._summary(self._context.t - start)

    @property
    def _left(self) -> list[PackFastener]:
        """What is in no tray."""
        return [one for one in self._book.fasteners if one.fate is not Fate.IN_TRAY]

    def _wanted(self, one: PackFastener) -> bool:
        """Return whether a fastener is to be taken now."""
        said = {"list": one.listed.loose is True, "gantry": one.listed.name in self._book.loosened}
        claimed = said.get(self._goal.loosened, True)
        return one.fate in TO_DO and claimed and bool(self._container(one.label))

    def _trays(self, label: str) -> list[Listed]:
        """Return the containers of the list that take fasteners of a label and are not full, of one class."""
        mine = [c for c in self._listed(label) if c.kind in self._classes(label) and c.name not in self._full]
        return [c for c in mine if c.kind == mine[0].kind]

    def _listed(self, label: str) -> list[Listed]:
        return [c for c in self._book.containers if c.takes in ("", label)]

    def _classes(self, label: str) -> tuple[str, ...]:
        return self._goal.nuts if label == "nut" else self._goal.screws

    def _container(self, label: str) -> str:
        """Return the class of what fasteners of a label are put into; empty where all are full."""
        if self._listed(label):
            return next((tray.kind for tray in self._trays(label)), "")
        return next((name for name in self._classes(label) if name not in self._full), "")

    def _tray(self, label: str, side: Side) -> Listed | None:
        """Return the listed container that a hand gets to best from here; None where none is listed."""

        def room(tray: Listed) -> float:
            over = self._from_here(tray) + (0.0, 0.0, OVER_TRAY)
            return float(within_reach(np.zeros((1, 3)), over, side).max()) - math.hypot(*over[0, :2])

        return max(self._trays(label), key=room, default=None)

    def _from_here(self, one: Listed) -> Array:
        """Return (n, 3) where something of the list is in base_link, at each height that the legs have [m]."""
        here = self._T_pack_base.to(PlanarPose(one.x, one.y, 0.0))
        return np.array([(here.x, here.y, one.z + rim) for rim in self._rims])

    @property
    def _rims(self) -> list[float]:
        """Heights of the rim above base_link at each height that the legs have [m]."""
        now = self._rim.height - self._context.legs.height
        return [now + drop for drop in self._context.legs.drops]

    def _gantry_at(self) -> Array | None:
        """Return (2,) where the gantry works, in the pack frame [m]; None where nobody said."""
        return next((one.place[:2] for one in self._book.fasteners if one.listed.name == self._gantry.at), None)

    def _near_gantry(self, place: Array) -> bool:
        at = self._gantry_at()
        return at is not None and float(np.linalg.norm(place - at)) < KEEP_OFF

    async def _plan(self, todo: list[PackFastener]) -> list[PackStop]:
        """Return the stops from here, and say them."""
        containers: dict[str, Array] = {}
        for label in set(KINDS.values()):
            places = [(c.x, c.y, c.z) for c in self._trays(label)]
            containers |= {label: np.array(places)} if places else {}
        away = None if (at := self._gantry_at()) is None else (at, KEEP_OFF)
        await self._context.think(self._book.keep_loosened, 0.0)  # live, another thread waits for the disk
        args = self._sides, todo, containers, self._T_pack_base, self._rims, away
        plan = await self._context.think(lambda: make_plan(*args), PLANNING)
        served, walk = sum(len(stop.picks) for stop in plan), sum(stop.way for stop in plan)
        text = f"{len(plan)} stops, {walk:.1f} m of way, for {served} of {len(todo)} fasteners."
        stops = [[s.pose.x, s.pose.y, s.pose.yaw, *(number for number, _ in s.picks)] for s in plan]
        fates = [[*one.place.tolist(), one.fate.value] for one in self._book.fasteners]
        self._context.say("plan", text, stops=stops, fasteners=fates)
        self._stops = plan
        self._show()
        return plan

    def _show(self) -> None:
        """Let people see how far it is."""
        book, at = self._book, self._gantry_at()
        rgb = pack_picture(book.fasteners, book.containers, self._stops, self._T_pack_base, at)
        self._context.publish(topics.PACK_PLAN, ShownPicture(self._context.t, rgb))

    @property
    def _T_pack_base(self) -> PlanarPose:
        return self._T_odom_pack.to(PlanarPose.of(self._context.legs.pose))

    def _in_odom(self, one: PackFastener | Listed) -> Array:
        """Return (2,) where something of the list is, as the head camera sees it, in odom [m]."""
        at = one.listed if isinstance(one, PackFastener) else one
        there = self._context.T_odom_estimate.to(self._T_odom_pack @ PlanarPose(at.x, at.y, 0.0))
        return np.array([there.x, there.y])

    def _level(self, one: PackFastener) -> float:
        """Return how high a fastener stands in odom, as the head camera sees it [m]."""
        above = self._rim.at(one.place) - self._context.legs.height + one.listed.z
        return float(self._context.T_odom_base[2, 3]) + above

    async def _find(self) -> None:
        """Find the pack by the edge that the robot stands before."""
        edge = await see_edge(self._context)
        T_pack_edge = self._sides.edges[min(ORDER.index(self._goal.side), len(self._sides.edges) - 1)]
        T_edge_pack = T_pack_edge.to(PlanarPose(0.0, 0.0, 0.0))
        self._T_odom_pack = PlanarPose.of(self._context.legs.pose) @ edge.pose @ T_edge_pack
        base = self._context.bus.latest(topics.BASE)
        self._rim = SeenRim(edge.height - (0.0 if base is None else base.height) + self._context.legs.height)

    async def _work(self, stop: PackStop) -> None:
        """Go to a stop, and take what is planned there, until the gantry comes or there is trouble with the tray."""
        by_number = {one.number: one for one in self._book.fasteners}
        ones: list[tuple[PackFastener, Side]] = [(by_number[k], side) for k, side in stop.picks]
        if not await self._stand(stop, ones):
            for one, side in ones:
                await self._tell(one, Fate.OPEN, one.reason, side, stance=stop.pose)
            return self._strike("The robot does not get to its stances before the pack.", "skill")
        for one, side in ones:
            if self._near_gantry(one.place[:2]) or self._near_gantry(np.array([stop.pose.x, stop.pose.y])):
                return None
            if not self._wanted(one):
                continue
            if one.fate is not Fate.OPEN and not await self._still_there(one):
                why = one.reason or "The job ended while it was being taken: it may be in the tray."
                await self._tell(one, Fate.LOST, f"{why} Its place is empty now.")
                continue
            if not self._reaches(one, side):
                text = f"Where the robot stopped the {side} hand does not reach it."
                await self._tell(one, Fate.OPEN, text, side, stance=stop.pose)
                continue
            outcome = await self._take(one, side)
            if outcome is PickOutcome.TRAY_MISSING and not self._listed(one.label):
                return self._strike(f"No {self._container(one.label)} is seen.", "localizer")
            if outcome in NO_TRAY:
                return None
            if outcome is PickOutcome.NOTHING_THERE:  # odom drifts while the arms work, so its place may have moved
                self._off.pop(side, None)  # or the hand learned it from a neighbour
                await self._find_again(one.label, self._container(one.label))
        self._strikes = 0
        return None

    def _reaches(self, one: PackFastener, side: Side) -> bool:
        """Return whether a hand gets to a fastener, at one of the heights that the legs have."""
        return bool(takes(np.zeros((1, 3)), self._from_here(one.listed), side).any())

    def _strike(self, text: str, slot: str) -> None:
        self._strikes += 1
        if self._strikes >= STRIKES:
            raise StageFailed("detect", slot, text)

    async def _stand(self, stop: PackStop, ones: list[tuple[PackFastener, Side]]) -> bool:
        """Bring the robot to a stop, and find the pack anew from there; returns whether something is within reach."""
        context, target = self._context, self._T_odom_pack @ stop.pose
        here = PlanarPose.of(context.legs.pose)
        left, navigator, found = here.to(target), GoTo(STEPS), DockReport()
        if math.hypot(left.x, left.y) < BESIDE and abs(left.yaw) < 0.5:
            if not stands_well(left):
                await approach(context, navigator, target)
        else:
            if self._sides.away(self._T_pack_base) < STAGE:
                await approach(context, navigator, here @ PlanarPose(-BACK, 0.0, 0.0))
            stage = target @ PlanarPose(-STAGE, 0.0, 0.0)
            walked = await context.run("navigate", NavigateGoal(stage.x, stage.y, stage.yaw, "odom", content=CONTENT))
            if not walked.success:
                context.say(walked.stage, walked.reason, failed=True)
                return False
        while True:
            await context.sleep(SETTLE)
            for label in sorted({one.label for one, _ in ones}):
                await self._find_again(label, self._container(label))
            left = self._T_pack_base.to(stop.pose)
            found.left = (left.x, left.y, left.yaw)
            if stands_well(left) or found.approaches == APPROACHES:
                break
            await approach(context, navigator, self._T_odom_pack @ stop.pose)
            found.approaches += 1
        found.served = sum(self._reaches(one, side) for one, side in ones)
        self.report.docks.append(found)
        away = 100.0 * math.hypot(left.x, left.y)
        context.say("look", f"{away:.1f} cm from the stance, {found.served} of {len(ones)} within reach.")
        return bool(found.served)

    async def _find_again(self, label: str, container: str) -> None:
        """Measure where the pack is by what the head camera shows of it: first by the container, then by the rest."""
        seen = await see_fasteners(self._context, label, container, NOTHING, False)
        ones = [one.place for one in self._left if one.label == label]
        known, T = np.array(ones).reshape(-1, 3), self._T_pack_base.matrix()
        places = seen.places[:, :2] @ T[:2, :2].T + T[:2, 3]
        boxes = np.array([(c.x, c.y) for c in self._book.containers if c.kind == container]).reshape(-1, 2)
        shifts = [np.zeros(2)]  # a tray that the view cuts off seems to be elsewhere
        if seen.tray is not None and len(boxes):
            away = T[:2, :2] @ seen.tray[:2] + T[:2, 3] - boxes
            nearest = away[int(np.linalg.norm(away, axis=1).argmin())]
            shifts = [nearest, *shifts] if np.linalg.norm(nearest) < SHIFTED else shifts
        cloud = np.column_stack([places, seen.places[:, 2] + self._context.legs.height])
        shift, a, b = max(((s, *matched(known + (*s, 0.0), cloud, WANTED)) for s in shifts), key=lambda m: len(m[1]))
        if not len(a):
            return
        self._rim, a, b = self._rim.seen(a[:, :2], b[:, 2] - a[:, 2]), a[:, :2], b[:, :2]
        moved, _ = fit_frames(a - shift, b)
        if len(a) < 4 or float(np.ptp(a, axis=0).max()) < LONG:
            x, y = (b - a + shift).mean(axis=0).tolist()
            moved = PlanarPose(x, y, 0.0)
        self._T_odom_pack = self._T_odom_pack @ moved

    async def _still_there(self, one: PackFastener) -> bool:
        """Look whether a fastener that may be anywhere is in its place: what is seen nearer to another is that."""
        there, container, T = self._in_odom(one)[None], self._container(one.label), self._context.T_odom_base
        seen = await see_fasteners(self._context, one.label, container, NOTHING, False, there)
        left = self._left
        known = np.array([self._in_odom(other) for other in left])
        away = np.linalg.norm((seen.places @ T[:3, :3].T + T[:3, 3])[:, None, :2] - known, axis=2)
        return any(left[int(k)] is one for k in away.argmin(axis=1))

    async def _take(self, one: PackFastener, side: Side) -> PickOutcome:
        """Try one fastener, and keep what came of it."""
        stance, container, listed = self._T_pack_base, self._container(one.label), self._tray(one.label, side)
        await self._tell(one, Fate.TRYING, side=side, stance=stance)
        (x, y), name = self._in_odom(one).tolist(), container if listed is None else listed.name
        at = () if listed is None else tuple(self._in_odom(listed).tolist())
        off = tuple((self._context.T_odom_base[:2, :2] @ self._off[side]).tolist()) if side in self._off else ()
        near = [other for other in self._left if math.dist(other.place, one.place) < AROUND]
        marks = tuple(v for other in near for v in (*self._in_odom(other).tolist(), self._level(other)))
        goal = PickGoal(one.label, container, side, (), (x, y), (self._level(one),), at, off, marks)
        result = await self._context.run("pick", goal)
        found = result.value if isinstance(result.value, PickReport) else PickReport()
        self.report.picks.append(found)
        outcome, reason, fate = PickOutcome(found.outcome), result.reason, Fate.OPEN
        taken = self._which(one, found) if found.tried and outcome in AT_IT else one
        if taken is not one:
            last = Fate.OPEN if result.success or one.tries < TRIES else Fate.NOT_FOUND
            await self._tell(one, last, f"A hand came to {taken.listed.name} instead.")
        out = result.success and taken.label == "nut"  # where it was, a stud looks like it
        believed = outcome is PickOutcome.TIGHT and self._goal.loosened == "unknown" and not taken.listed.loose
        tries = 1 if believed else TRIES
        if result.success and found.in_tray != Sight.NO:
            fate, self.report.picked = Fate.IN_TRAY, self.report.picked + 1
            self._doubted.discard(name)
        elif outcome is PickOutcome.TRAY_FULL or (outcome in NO_TRAY and listed is not None):
            (self._full if name in self._doubted else self._doubted).add(name)  # one view of it may err
        elif result.success or (outcome is PickOutcome.SLIPPED and found.bore_empty != Sight.NO):
            reason = f"It was let go and is not seen in the {name}." if result.success else reason
            await self._tell(taken, Fate.UNSETTLED, reason, side)
            if out or not await self._still_there(taken):
                fate, reason = Fate.LOST, reason if out else f"{reason} Its place is empty now."
        if fate is Fate.OPEN and taken.tries >= tries and outcome not in NO_TRAY:
            fate = FATES.get(outcome, Fate.FAILED)
            fate = Fate.MISSING if fate is Fate.NOT_FOUND and not found.tried else fate
        tray = name if fate is Fate.IN_TRAY else ""
        await self._tell(taken, fate, reason, side, tray, stance, await self._picture(taken))
        if result.stage in (FAULT, REFUSED, TIMEOUT):
            raise StageFailed(result.stage, result.slot or "skill", result.reason)
        return outcome

    def _which(self, one: PackFastener, found: PickReport) -> PackFastener:
        """Return which fastener a hand was at that was sent to `one`, and learn what the palm cameras are off by."""
        there, tried = self._left, found.tried[-1]
        place, turn = np.array([tried.x, tried.y]), self._context.T_odom_base[:2, :2]
        known = np.array(found.off or turn @ self._off.get(tried.side, np.zeros(2)))
        left = [np.linalg.norm(place - known - self._in_odom(each)) for each in there]
        nearest = int(np.argmin(left))
        taken = there[nearest] if left[nearest] < WANTED / 2 else one
        if np.linalg.norm(off := place - self._in_odom(taken)) < FARTHEST_OFF:
            self._off[tried.side] = turn.T @ off
        return taken

    async def _tell(
        self, one: PackFastener, fate: Fate, reason: str = "", side: str = "", tray: str = "",
        stance: PlanarPose | None = None, picture: str = "",
    ) -> None:  # fmt: skip
        """Keep what happened, on the disk, before anything else happens; live, another thread waits for the disk."""
        t = self._context.t
        await self._context.think(lambda: self._book.tell(one, fate, t, reason, side, tray, stance, picture), 0.0)
        self._show()
        if fate is not Fate.TRYING:
            text = f"{one.listed.name}: {fate.value.replace('_', ' ')}. {reason}"
            self._context.say("job", text, number=one.number, fate=fate.value)

    async def _picture(self, one: PackFastener) -> str:
        """Keep what the head camera shows; return the path of the picture, from the folder of the job."""
        frame = self._context.bus.latest(topics.rgbd_images("head"))
        return await self._context.think(lambda: self._book.keep(one, frame.rgb), 0.0) if frame else ""

    def _summary(self, seconds: float) -> SkillResult:
        ones = self._book.fasteners
        done, left = (sum(one.fate is Fate.IN_TRAY for one in ones), sum(one.fate in TO_DO for one in ones))
        text = f"{done} of {len(ones)} fasteners are in their trays, {len(ones) - done - left} are set aside"
        if self._full:
            text += f", {left} wait: full or not seen are {', '.join(sorted(self._full))}; empty them and start again."
            return SkillResult(False, "place", "localizer", text, {"total": seconds}, self.report)
        text += f", {left} are not said to be loose, or by the gantry." if left else "."
        self._context.say("done", text)
        return SkillResult(True, "done", None, text, {"total": seconds}, self.report)
