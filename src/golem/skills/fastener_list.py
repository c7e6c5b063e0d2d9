"""Lists of what is on a pack: CSV files of classes and places in the pack frame, checked before anything moves."""

from __future__ import annotations

import csv
import math
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from golem.errors import ConfigError, shorten

KINDS = {"screw": "screw", "bolt": "screw", "nut": "nut"}
"""What is taken out -> what the localizer calls it."""
HOLE = "hole"
COLUMNS = ("class", "x", "y", "z", "name", "loose", "frame", "takes")
"""The first four have to be there."""
MOST = 500
"""Rows of a list; a pack has 84."""
SIZE = 1 << 20
"""Bytes of a list."""
BOUNDS = {"x": (-0.1, 3.0), "y": (-2.0, 2.0), "z": (-0.3, 0.3)}
"""Where things on a pack can be [m]."""
TWICE = 0.015
"""What is nearer to each other than this is one fastener, listed twice [m]; real ones are 24 mm apart."""
FRAME = "metres in the pack frame: origin in the middle of the near edge, on the rim, x across it, y left, z up"
LOOSE = {"": None, "1": True, "0": False}


@dataclass(frozen=True, slots=True)
class Listed:
    """One row.

    Attributes:
        name: what others call it, e.g. `Screw_12`.
        kind: `screw`, `bolt` or `nut`, or the class of a container.
        x, y, z: place of its top in the pack frame: origin in the middle of the near edge, on the rim, x across the
            pack, z up [m].
        loose: whether it is said to be loose; None where nobody says.
        takes: the fasteners that a container is for, as the localizer calls them; empty: any.
    """

    name: str
    kind: str
    x: float
    y: float
    z: float
    loose: bool | None = None
    takes: str = ""


def read_list(path: Path, containers: Collection[str]) -> list[Listed]:
    """Read a CSV file with `class`, `x`, `y`, `z` and, if given, the other columns of `COLUMNS`; `loose` is 1 or 0.

    Classes of `containers`, which fasteners are put into, may be listed, too. Raises ConfigError: it cannot be read, is
    empty or too long, has a row twice, in another frame or of an unknown class.
    """
    try:
        if path.stat().st_size > SIZE:
            raise ConfigError(f"The list '{path}' is larger than a megabyte; a pack has at most {MOST} fasteners.")
        with path.open(encoding="utf-8-sig", newline="") as file:
            table = csv.DictReader(file, restkey="more", skipinitialspace=True)
            columns = list(table.fieldnames or ())
            rows = [(table.line_num, row) for row in table if any(row.values())]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"The list '{path}' cannot be read: {error}.") from error
    if sorted(columns) != sorted({*COLUMNS[:4], *columns} & set(COLUMNS)):
        said = shorten(", ".join(columns))
        raise ConfigError(
            f"The first line of the list '{path}' is '{said}'; it names class, x, y, z and, if given, name, loose, "
            "frame and takes, each once, with commas between."
        )
    if len(rows) > MOST:
        raise ConfigError(f"The list '{path}' has {len(rows)} rows; a pack has at most {MOST} fasteners.")
    found: list[Listed] = []
    for line, row in rows:
        one = _row(f"'{path}', line {line}", row, containers)
        for other in found if one else ():
            if one and math.dist((one.x, one.y, one.z), (other.x, other.y, other.z)) < TWICE:
                raise ConfigError(f"'{path}', line {line}: {one.name} is at the place of {other.name}; leave one out.")
            if one and one.name == other.name:
                raise ConfigError(f"'{path}', line {line}: there is another {one.name}; name each once.")
        found += [one] if one else []
    if not any(one.kind in KINDS for one in found):
        raise ConfigError(f"The list '{path}' names no fastener; its places are {FRAME}.")
    return found


def _row(where: str, row: dict[str, str | None], containers: Collection[str]) -> Listed | None:
    """Return what a row says; None for a hole."""
    if "more" in row:
        raise ConfigError(f"{where}: it has more cells than the first line has columns; decimals have points.")
    kind = (row.get("class") or "").strip()
    if kind not in (*KINDS, HOLE, *containers):
        valid = ", ".join(dict.fromkeys((*KINDS, HOLE, *containers)))
        raise ConfigError(f"{where}: the class '{shorten(kind, 40)}' is unknown; valid: {valid}.")
    if (frame := (row.get("frame") or "").strip()) not in ("", "pack"):
        raise ConfigError(f"{where}: the frame is '{shorten(frame, 40)}'; places are {FRAME}.")
    place: list[float] = []
    for axis, (low, high) in BOUNDS.items():
        text = row.get(axis) or ""
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            what = f"{axis} is '{shorten(text, 40)}', not a number from {low:g} to {high:g}"
            raise ConfigError(f"{where}: {what}; places are {FRAME}.")
        place.append(value)
    loose = (row.get("loose") or "").strip()
    if loose not in LOOSE:
        raise ConfigError(f"{where}: loose is '{shorten(loose, 40)}'; it is 1, 0 or empty.")
    takes = (row.get("takes") or "").strip()
    if takes not in ("", *KINDS) or (takes and kind not in containers):
        raise ConfigError(
            f"{where}: takes is '{shorten(takes, 40)}'; it is empty, or, of a container, {', '.join(KINDS)}."
        )
    name = " ".join((row.get("name") or "").split()) or f"{kind.capitalize()}_{where.rpartition(' ')[2]}"
    x, y, z = place
    return None if kind == HOLE else Listed(shorten(name, 60), kind, x, y, z, LOOSE[loose], KINDS.get(takes, ""))
