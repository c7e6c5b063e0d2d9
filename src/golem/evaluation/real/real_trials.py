"""A lab's CSV of real trials: its format, checked line by line."""

from __future__ import annotations

import csv
import io
import math
from contextlib import suppress
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from golem.errors import ConfigError, unknown_name
from golem.evaluation.base import RUNGS, make_rung
from golem.evaluation.metrics.published import GGX_F

COLUMNS = ("rung", "method", "case", "metric", "stat", "n", "value", "sd", "index", "source")
NEEDED = ("rung", "method", "metric", "stat", "value")
STATS = ("count", "trial", "mean", "median")
SUCCESS = "success"
MOST = 1_000_000
"""Trials that a cell has at most."""


@dataclass(frozen=True, slots=True)
class RealRow:
    """One line.

    Attributes:
        rung, method, case: the cell, as a ladder names it; an empty case is all cases.
        metric: `success`, or a figure of the ladder's records [SI units].
        stat: `count`: `value` of `n` trials were won; `trial`: one was (1) or was not (0); `mean` or `median` of `n`.
        n: trials; 1 of a `trial`.
        value, sd: the figure, and the standard deviation of a mean; None where nobody says.
        index: of the twin's trial that a `trial` repeats; None where it repeats none.
        source: in words.
    """

    rung: str
    method: str
    case: str
    metric: str
    stat: str
    n: int
    value: float
    sd: float | None
    index: int | None
    source: str


def data_text(name: str) -> str:
    """Return a CSV that comes with the package: `paper` or `template`."""
    return (files(__package__ or "") / f"{name}.csv").read_text(encoding="utf-8")


def read_real(path: str) -> list[RealRow]:
    """Read a CSV; `paper` is the paper's own rows.

    Raises:
        ConfigError: it cannot be read, lacks a column, or a line says what cannot be; names the line.
    """
    try:
        text = data_text(path) if path == "paper" else Path(path).read_text(encoding="utf-8-sig")
        reader = csv.DictReader(io.StringIO(text, newline=""), strict=True)
        head = [name.strip() for name in reader.fieldnames or ()]
        lacking, unknown = [c for c in NEEDED if c not in head], [c for c in head if c not in COLUMNS]
        if lacking or unknown:
            what = f"lacks the column {lacking[0]}" if lacking else f"has the unknown column '{unknown[0]}'"
            raise ConfigError(f"{path} {what}; columns: {', '.join(COLUMNS)} (golem real --template FILE).")
        reader.fieldnames = head
        rows = [_row(f"Line {reader.line_num} of {path}", line) for line in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"{path} cannot be read as CSV: {error}.") from error
    if not rows:
        raise ConfigError(f"{path} has no line of trials.")
    return rows


def _row(where: str, line: dict[str | None, str | None]) -> RealRow:
    if None in line:
        raise ConfigError(f"{where} has more cells than columns.")
    cell = {name: (line.get(name) or "").strip() for name in COLUMNS}
    rung, stat, success = cell["rung"], cell["stat"], cell["metric"] == SUCCESS
    if rung not in RUNGS:
        raise unknown_name(f"rung ({where})", rung, RUNGS)
    methods = make_rung(RUNGS[rung]).methods()
    method = GGX_F if cell["method"] == "GGX-F" else cell["method"]
    if method not in methods and ":" not in method and not method.startswith("{"):
        raise unknown_name(f"method ({where})", method, methods)
    if stat not in STATS or success != (stat in STATS[:2]):
        valid = STATS[:2] if success else STATS[2:]
        raise ConfigError(
            f"{where}: the stat of {cell['metric'] or 'no metric'} is {' or '.join(valid)}, not '{stat}'."
        )
    number = {name: _number(f"{where}: {name}", cell[name]) for name in ("n", "value", "sd", "index") if cell[name]}
    number = {"n": 1.0, **number} if stat == "trial" else number
    for name, least in (("n", 1), ("index", 0)):
        if name in number and not (number[name].is_integer() and least <= number[name] <= MOST):
            raise ConfigError(f"{where}: {name} is a whole number from {least} to {MOST}, not '{cell[name]}'.")
    for name in ("n", "value"):
        if name not in number:
            raise ConfigError(f"{where}: the {name} is missing.")
    n, value, sd, index = int(number["n"]), number["value"], number.get("sd"), number.get("index")
    if success and not (value.is_integer() and 0 <= value <= n):
        raise ConfigError(f"{where} says {value:g} of {n} successes; that is a whole number from 0 to {n}.")
    if (sd is not None and (stat != "mean" or sd <= 0.0 or n < 2)) or (index is not None and stat != "trial"):
        raise ConfigError(f"{where}: an sd is above 0 and of a mean of two or more, and only a trial has an index.")
    at = None if index is None else int(index)
    return RealRow(rung, method, cell["case"], cell["metric"], stat, n, value, sd, at, cell["source"])


def _number(what: str, text: str) -> float:
    with suppress(ValueError):
        if math.isfinite(value := float(text)):
            return value
    raise ConfigError(f"{what} is a number, not '{text}'.")
