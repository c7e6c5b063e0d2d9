"""The inventory at the end of a job: what was removed, what not and why, as a page and as a table."""

from __future__ import annotations

import csv
from collections import Counter
from html import escape
from io import StringIO
from pathlib import Path

from golem.errors import OutputError
from golem.output_file import write_file
from golem.skills.job_file import Fate, JobFile, PackFastener

COLUMNS = "name class x y z said_loose fate reason tries hand tray stance robot_s date_utc picture".split()
COLOURS = {Fate.IN_TRAY: "#2a2", Fate.OPEN: "#888", Fate.TIGHT: "#c80", Fate.JAMMED: "#c80"}
SCALE = 400.0
"""Pixels per metre of the plan."""
STYLE = "body{font:14px sans-serif}td,th{padding:2px 8px;text-align:left;vertical-align:top}img{height:60px}"


def write_inventory(book: JobFile) -> Path:
    """Write the inventory beside the file of the job, `NAME_inventory.csv` and `.html`; returns the page's path.

    Raises:
        OutputError: it cannot be written.
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
        f'fill="{COLOURS.get(one.fate, "#c22")}"><title>{escape(f"{one.listed.name}: {one.fate}")}</title></circle>'
        for one, x, y in zip(book.fasteners, xs, ys, strict=True)
    )
    return f'<svg width="{width:.0f}" height="{height:.0f}">{dots}</svg>'
