"""`golem table`: the paper's table of grasps in one command, task by task, method by method, beside its figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Annotated, TypeVar

from tyro.conf import arg

from golem.errors import MissingExtra, unknown_name
from golem.evaluation.base import rung_class
from golem.evaluation.harness.ladder import LadderConfig, LadderResult, run_ladder
from golem.evaluation.harness.records import TrialRecord
from golem.evaluation.metrics.grasp_cells import COLUMNS, ROWS, TableColumn, TableRow, absence
from golem.evaluation.metrics.published import PAPER
from golem.evaluation.metrics.statistics import wilson
from golem.evaluation.metrics.summary import Summary, comparisons_of, row
from golem.evaluation.metrics.tables import comparisons
from golem.evaluation.metrics.text_table import TextTable
from golem.evaluation.report.ladder_report import failure_plot
from golem.evaluation.report.margin_plot import MarginBox, kept_traces, margin_box, margin_boxes
from golem.evaluation.report.svg_figure import render_page, styled
from golem.options import fill
from golem.output_file import write_file
from golem.provenance import command_line


def render_table(table: GraspTable) -> str:
    """Return the page of a finished table as HTML.

    Raises:
        golem.errors.MissingExtra: what draws it is not installed.
    """
    measured = [(line, ladder) for line, ladder in table.rows if ladder is not None]
    first = measured[0][1].records[0] if measured else None
    facts = {} if first is None else {"commit": first.commit, "code": first.code}
    with styled():
        return render_page(
            "table.html",
            facts,
            command=table.config.command(),
            rates=table.rates(),
            absent=table.absent,
            boxes=margin_boxes(_boxes(table)),
            failures=[
                (line.name, failure_plot(ladder.summary, "stages"))
                for line, ladder in measured
                if any(not r.success for r in ladder.records)
            ],
            paired=table.paired(),
            reports=[
                (line.name, f"{line.key}/{ladder.report.name}", sum(not r.success for r in ladder.records))
                for line, ladder in measured
                if ladder.report is not None
            ],
        )


def _boxes(table: GraspTable) -> list[MarginBox]:
    found = [
        margin_box(
            f"{line.name}: {column.head}",
            [t for _, t in kept_traces([r for r in ladder.records if r.method == column.method], ladder.out)],
            number,
        )
        for line, ladder in table.rows
        if ladder is not None
        for number, column in enumerate(table.columns)
    ]
    return [box for box in found if box is not None]


T = TypeVar("T")
EMPTY = "-"


@dataclass(frozen=True)
class TableConfig:
    """Make the paper's table of grasps: screw and fridge, hanging and standing, by every grasp method.

    Each row is a ladder in a folder of its own, and the same command continues what was interrupted. Cells whose
    weights or server are absent stay empty, and the page says why.
    """

    rung: tuple[str, ...] = ()
    """Rows, by their rungs; those with the simulator's masks are called RUNG-truth. Default: all."""
    method: tuple[str, ...] = ()
    """Columns, by their grasp methods. Default: all."""
    n: Annotated[int, arg(aliases=("-n",))] = 30
    """Trials of a cell."""
    profile: str = "field"
    """Realism of sensors and world: ideal, bench or field."""
    seed: int = 0
    """Seed of the run; trial i of every method sees the same scene, hanging and standing."""
    out: Path = Path("runs/table")
    """Folder for the results."""
    j: Annotated[int, arg(aliases=("-j",))] = 1
    """Processes that run trials at the same time."""

    def command(self) -> str:
        """Return the command line that makes this table."""
        return command_line("golem table", self, always=("seed",))


@dataclass(frozen=True, slots=True)
class GraspTable:
    """The finished table.

    Attributes:
        config: what was asked.
        columns: of the table.
        rows: each with its ladder; None where no cell could be measured.
        absent: why cells are empty, each sentence once.
    """

    config: TableConfig
    columns: tuple[TableColumn, ...]
    rows: tuple[tuple[TableRow, LadderResult | None], ...]
    absent: tuple[str, ...]

    def rates(self) -> TextTable:
        """Return success by task and method with Wilson's intervals, and below each row what the paper has."""
        lines: list[tuple[str, ...]] = []
        for line, ladder in self.rows:
            lines.append((line.name, *(self._cell(ladder, column) for column in self.columns)))
            published = [f for column in self.columns for f in PAPER.get((line.key, column.method), ())]
            for label in dict.fromkeys(figure.label for figure in published):
                cells = (_published(line, column, label) for column in self.columns)
                lines.append((f"the paper, {label}", *cells))
        heads = (f"{c.head} ({c.paper})" if c.paper else c.head for c in self.columns)
        c = self.config
        note = f"Percent, 95 % Wilson intervals. Profile {c.profile}, n = {c.n} a cell, seed {c.seed}."
        return TextTable("Grasp success", ("task", *heads), tuple(lines), f"{note} The paper's n is 30.")

    def paired(self) -> list[TextTable]:
        """Return McNemar's tests: method by method, then what a level of autonomy costs each."""
        found = [
            replace(table, title=f"{line.name}: method against method")
            for line, ladder in self.rows
            if ladder is not None and (table := comparisons(ladder.summary)) is not None
        ]
        levels = comparisons(self._levels())
        return found if levels is None else [*found, replace(levels, title="Level against level")]

    def text(self) -> str:
        """Return all tables and the reasons for what is empty, in Markdown."""
        parts = [table.markdown() for table in (self.rates(), *self.paired())]
        return "\n\n".join([*parts, *(f"Empty: {reason}" for reason in self.absent)])

    def _cell(self, ladder: LadderResult | None, column: TableColumn) -> str:
        found = () if ladder is None else (r for r in ladder.summary.rows if r.method == column.method)
        return next((_figure(r.successes, r.n) for r in found), EMPTY)

    def _levels(self) -> Summary:
        """Return the paired tests of each method between a level and the one before it."""
        pairs: list[tuple[list[TrialRecord], list[TrialRecord]]] = []
        for (one, a), (other, b) in product(self.rows, self.rows):
            if a is None or b is None or (one.task, one.level) != (other.task, other.after):
                continue
            for column in self.columns:
                before, after = (_trials(column, *side) for side in ((one, a), (other, b)))
                both = sorted(before.keys() & after.keys())
                if both:
                    pairs.append(([before[i] for i in both], [after[i] for i in both]))
        return Summary(tuple(row(side) for pair in pairs for side in pair), comparisons_of(pairs))


def run_table(config: TableConfig) -> GraspTable:
    """Run the ladders that the folder does not hold yet; write and print the table.

    Raises:
        golem.errors.ConfigError: an option says nothing this software can do.
        golem.errors.GolemError: see `run_ladder`.
        OutputError: the folder cannot be written.
    """
    lines = _chosen("row", config.rung, {line.key: line for line in ROWS})
    columns = _chosen("column", config.method, {column.method: column for column in COLUMNS})
    empty = {column.method: absence(column) for column in columns}
    rows: list[tuple[TableRow, LadderResult | None]] = []
    absent = [why for why in empty.values() if why]
    for line in lines:
        methods: list[str] = []
        for column in columns:
            if line.task not in column.tasks:
                absent.append(f"{column.head} on the {line.task}: `open` follows no servo law, as in the paper.")
            elif empty[column.method] is None:
                methods.append(column.method)
        rows.append((line, _ladder(config, line, tuple(methods)) if methods else None))
    table = GraspTable(config, columns, tuple(rows), tuple(dict.fromkeys(absent)))
    _write(table)
    return table


def _ladder(config: TableConfig, line: TableRow, methods: tuple[str, ...]) -> LadderResult:
    print(f"{line.name} ({line.key}): {', '.join(methods)}", flush=True)
    options = fill(f"option of rung {line.rung}", rung_class(line.rung).Options, line.options)
    return run_ladder(
        LadderConfig(
            line.rung, methods, config.n, config.profile, config.seed, config.out / line.key, config.j,
            use=line.use, options=options,
        )
    )  # fmt: skip


def _write(table: GraspTable) -> None:
    text, page = table.text() + "\n", None
    try:
        page = render_table(table)
    except MissingExtra as missing:
        print(f"No page was written: {missing}")
    write_file(table.config.out / "table.md", text)
    if page is not None:
        write_file(table.config.out / "table.html", page)
    print(text, end="")
    print(f"Page: {table.config.out / 'table.html'}" if page is not None else "")


def _chosen(what: str, names: Sequence[str], known: dict[str, T]) -> tuple[T, ...]:
    """Return what the `names` mean, in the order of the table; all of `known` where none is named."""
    for name in names:
        if name not in known:
            raise unknown_name(what, name, known)
    return tuple(value for name, value in known.items() if not names or name in names)


def _trials(column: TableColumn, line: TableRow, ladder: LadderResult) -> dict[int, TrialRecord]:
    """Return the records of a cell by index, named after it."""
    name = f"{column.head} on {line.name}"
    return {r.index: replace(r, method=name, case={}) for r in ladder.records if r.method == column.method}


def _published(line: TableRow, column: TableColumn, label: str) -> str:
    figures = PAPER.get((line.key, column.method), ())
    return next((_figure(f.successes, f.n) for f in figures if f.label == label), EMPTY)


def _figure(successes: int, n: int) -> str:
    interval = wilson(successes, n)
    return f"{100 * successes / n:.1f} {interval.text(100.0)}"
