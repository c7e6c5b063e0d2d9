"""Taking a pack apart: a whole one by a list of its fasteners, or what is found within reach of a stance or two."""

from __future__ import annotations

import csv
from collections import Counter
from dataclasses import replace
from html import escape
from io import StringIO
from pathlib import Path

from golem.errors import ConfigError, OutputError
from golem.output_file import write_file
from golem.skills.base import SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.disassemble_goal import DisassembleGoal, DisassembleReport
from golem.skills.dock import DockReport
from golem.skills.fastener_list import read_list
from golem.skills.job_file import JobFile, PackFastener
from golem.skills.kept_file import KeptFileConfig, kept_file
from golem.skills.pack_job import PackJob
from golem.skills.pack_picture import COLOURS, OTHER
from golem.skills.pick_config import PickOutcome, PickReport, Sight

COLUMNS = "name class x y z said_loose fate reason tries hand tray stance robot_s date_utc picture".split()
SCALE = 400.0
"""Pixels per metre of the plan."""
STYLE = "body{font:14px sans-serif}td,th{padding:2px 8px;text-align:left;vertical-align:top}img{height:60px}"


def write_inventory(book: JobFile) -> Path:
    """Write the inventory beside the file of the job, `NAME_inventory.csv` and `.html`; returns the page's path.

    Raises OutputError: it cannot be written.
    """
    rows = [_row(one) for one in book.fasteners]
    table = StringIO()
    csv.writer(table, lineterminator="\n").writerows([COLUMNS, *rows])
    page = book.path.with_name(f"{book.path.stem}_inventory.html")
    counts = ", ".join(f"{n} {fate.replace('_', ' ')}" for fate, n in Counter(o.fate for o in book.fasteners).items())
    head = "".join(f"<th>{name}</th>" for name in COLUMNS)
    lines = "".join(f"<tr>{''.join(map(_cell, row))}</tr>\n" for row in rows)
    text = (
        f"<!doctype html><meta charset=utf-8><title>{escape(book.path.stem)}</title><style>{STYLE}</style>\n"
        f"<h1>Inventory of {escape(book.path.stem)}</h1><p>{len(rows)} fasteners: {counts}.</p>\n{_plan(book)}\n"
        f"<table><tr>{head}</tr>\n{lines}</table>\n"
    )
    if page.is_symlink() or page.with_suffix(".csv").is_symlink():
        raise OutputError(f"The inventory '{page}' is a link, which is not written to; take it away.")
    write_file(page.with_suffix(".csv"), table.getvalue())
    return write_file(page, text)


def _row(one: PackFastener) -> tuple[str, ...]:
    said = {None: "", True: "yes", False: "no"}[one.listed.loose]
    stance = "" if one.stance is None else f"{one.stance.x:.2f} {one.stance.y:.2f} {one.stance.yaw:.2f}"
    place = tuple(f"{v:.3f}" for v in one.place.tolist())
    times = (f"{one.t:.1f}" if one.when else "", one.when)
    told = (said, one.fate.value, one.reason, str(one.tries), one.side, one.tray, stance)
    return (one.listed.name, one.listed.kind, *place, *told, *times, one.picture)


def _cell(text: str) -> str:
    return f'<td><img src="{escape(text)}"></td>' if text.endswith(".jpg") else f"<td>{escape(text)}</td>"


def _plan(book: JobFile) -> str:
    """Return a drawing of the pack from above, near edge at the bottom, each fastener in the colour of its fate."""
    xs, ys = ([float(one.place[k]) for one in book.fasteners] for k in (0, 1))
    top, left = max(xs) + 0.05, max(ys) + 0.05
    width, height = ((left - min(ys) + 0.05) * SCALE, (top - min(xs) + 0.05) * SCALE)
    dots = "".join(
        f'<circle cx="{(left - y) * SCALE:.0f}" cy="{(top - x) * SCALE:.0f}" r="6" '
        f'fill="rgb{COLOURS.get(one.fate, OTHER)}"><title>{escape(f"{one.listed.name}: {one.fate}")}</title></circle>'
        for one, x, y in zip(book.fasteners, xs, ys, strict=True)
    )
    return f'<svg width="{width:.0f}" height="{height:.0f}">{dots}</svg>'


LEFT = (PickOutcome.TIGHT, PickOutcome.JAMMED, PickOutcome.SLIPPED, PickOutcome.NOTHING_THERE)
"""What is said of a fastener that is tried again only where there is no other."""
AGAIN = (*LEFT, PickOutcome.OUT_OF_REACH, PickOutcome.BLOCKED, PickOutcome.TRAY_MISSING, PickOutcome.TRAY_OUT_OF_REACH)
"""What a pick says where another stance may help: others are within reach there, or it is free."""


JOB = 4 * 3600.0
"""Time that a job may take [s] [own: RAPID takes 24 minutes, a robot that stands longer]."""


class Disassemble:
    """Take fasteners out of a pack: all of a list, by a plan and with a file that keeps what was done, or some.

    Stages (see `Skill`): those of `navigate`, `dock` and `pick`, and `plan`, `job`, `done`. Without a list it docks,
    picks, and docks again where a pick says that nothing more is within reach.
    """

    Goal, Result = DisassembleGoal, DisassembleReport

    def __init__(self, config: KeptFileConfig | None = None) -> None:
        self._folder = Path((config or KeptFileConfig()).folder)

    def timeout(self, goal: DisassembleGoal) -> float:
        some = 180.0 * (goal.docks + 1) + 120.0 * (goal.count + goal.docks)
        return JOB if goal.list or goal.job else some

    async def run(self, context: Context, goal: DisassembleGoal) -> SkillResult:
        return await (self._job(context, goal) if goal.list or goal.job else self._some(context, goal))

    async def _job(self, context: Context, goal: DisassembleGoal) -> SkillResult:
        """Begin a job or go on with it; however it ends, the inventory is written."""
        if context.legs.reporting and context.legs.status.speed == 0.0:
            raise ConfigError(
                f"The legs, '{context.legs.status.controller}', do not walk; choose others, such as almi."
            )
        listed = read_list(self._folder / goal.list, {*goal.screws, *goal.nuts}) if goal.list else ()
        path = kept_file(str(self._folder), goal.job or f"{goal.list.removesuffix('.csv')}.sqlite", lambda _: None)
        book = await context.think(lambda: JobFile(path, listed), 0.0)
        job = PackJob(context, goal, book)
        try:
            result = await job.run()
        except StageFailed as failure:
            result = SkillResult(False, failure.stage, failure.slot, str(failure), value=job.report)
        finally:
            job.report.fates = [one.fate.value for one in book.fasteners]
            try:
                job.report.inventory = str(write_inventory(book))
            except OutputError as problem:
                context.say("done", str(problem), failed=True)
            book.close()
        return result

    async def _some(self, context: Context, goal: DisassembleGoal) -> SkillResult:
        start, report, docks = context.t, DisassembleReport(), goal.docks
        if docks:
            docked = await self._dock(context, goal, report)
            docks -= 1
            if not docked.success and not report.docks[-1].served:
                return SkillResult(False, docked.stage, docked.slot, docked.reason, value=report)
        while True:
            result = await context.run("pick", goal.pick)
            found = result.value if isinstance(result.value, PickReport) else PickReport()
            report.picks.append(found)
            if result.success and found.in_tray == Sight.NO:
                text = f"The {goal.pick.label} that was let go is not in the {goal.pick.container}."
                result = replace(result, success=False, stage="place", slot="localizer", reason=text)
            report.picked += result.success
            timings = {"total": context.t - start, **result.timings}
            if report.picked >= goal.count:
                text = f"{report.picked} of {goal.count} picked after {len(report.docks)} dockings."
                context.say("done", text)
                return SkillResult(True, "done", None, text, timings, report)
            if result.success:
                continue
            if not docks or not _worth_another(found):
                return SkillResult(False, result.stage, result.slot, result.reason, timings, report)
            context.say(result.stage, f"{result.reason} Looking for another stance.")
            goal = _without(goal, found)
            await self._dock(context, goal, report)
            docks -= 1

    async def _dock(self, context: Context, goal: DisassembleGoal, report: DisassembleReport) -> SkillResult:
        docked = await context.run("dock", goal.dock)
        report.docks.append(docked.value if isinstance(docked.value, DockReport) else DockReport())
        return docked


def _worth_another(found: PickReport) -> bool:
    """Return whether another stance may help: not where nothing was seen, unless something was tried before."""
    seen = found.tried or found.outcome != PickOutcome.NOTHING_THERE
    return bool(seen) and found.outcome in (*AGAIN, PickOutcome.PICKED)


def _without(goal: DisassembleGoal, found: PickReport) -> DisassembleGoal:
    """Return the goal that leaves what a pick has tried in vain for later."""
    left = [place for one in found.tried if one.outcome in LEFT for place in (one.x, one.y)]
    avoid = (*goal.dock.avoid, *left)
    return replace(goal, dock=replace(goal.dock, avoid=avoid), pick=replace(goal.pick, avoid=avoid))
