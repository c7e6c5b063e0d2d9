"""A file of remembered objects, in SQLite, and its records."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.memory.base import MemoryFault
from golem.errors import GolemError
from golem.types import Array

COLUMNS: tuple[str, ...] = (
    "x", "y", "z", "variance", "size", "belief", "first_seen", "last_seen", "gone_at", "looks", "evidence",
)  # fmt: skip
"""Position [m], variance of each of its coordinates [m^2], radius [m], log odds that it is there, times [s] with
`gone_at` infinite while it may be there, how many looks showed it, and the log odds that it ever was there, of
the looks that found and missed it until it was gone."""
PLACE = slice(0, 3)
VARIANCE, SIZE, BELIEF, FIRST, LAST, GONE, LOOKS, EVIDENCE = range(3, len(COLUMNS))


@dataclass(slots=True)
class ObjectRow:
    """One object: its number, its label and its values of `COLUMNS`."""

    number: int
    label: str
    values: Array


class ObjectRecords:
    """Objects by number, in rows that move when one is removed."""

    def __init__(self) -> None:
        self._values: Array = np.empty((16, len(COLUMNS)), order="F")
        self._numbers: NDArray[np.int64] = np.empty(16, np.int64)
        self._labels: list[str] = []
        self._by_label: dict[str, list[int]] = {}
        self._row: dict[int, int] = {}
        self._next = 0

    def __len__(self) -> int:
        return len(self._labels)

    @property
    def labels(self) -> list[str]:
        """Labels of which there is an object."""
        return [label for label, numbers in self._by_label.items() if numbers]

    @property
    def values(self) -> Array:
        """(n, 11) view of all rows, columns as in `COLUMNS`."""
        return self._values[: len(self._labels)]

    @property
    def numbers(self) -> NDArray[np.int64]:
        """(n,) view of the numbers of the rows."""
        return self._numbers[: len(self._labels)]

    def rows(self, label: str) -> NDArray[np.intp]:
        """Return the rows of all objects with this label, in the order of their numbers."""
        return np.array([self._row[number] for number in self._by_label.get(label, ())], np.intp)

    def label(self, row: int) -> str:
        """Return what a row is."""
        return self._labels[row]

    def add(self, label: str, values: Array, number: int | None = None) -> int:
        """Add an object, with the next number unless it has one, and return its number."""
        number = self._next if number is None else number
        self._next = max(self._next, number + 1)
        row = len(self._labels)
        if row == len(self._values):
            self._values = np.concatenate([self._values, np.empty_like(self._values)])
            self._numbers = np.concatenate([self._numbers, np.empty_like(self._numbers)])
        self._values[row], self._numbers[row] = values, number
        self._labels.append(label)
        self._by_label.setdefault(label, []).append(number)
        self._row[number] = row
        return number

    def remove(self, number: int) -> None:
        """Remove an object; the last row takes its place."""
        row, last = self._row.pop(number), len(self._labels) - 1
        self._by_label[self._labels[row]].remove(number)
        if row != last:
            self._values[row], self._numbers[row] = self._values[last], self._numbers[last]
            self._labels[row] = self._labels[last]
            self._row[int(self._numbers[row])] = row
        self._labels.pop()

    def row(self, number: int) -> ObjectRow:
        """Return a copy of an object."""
        at = self._row[number]
        return ObjectRow(number, self._labels[at], self._values[at].copy())


WHY = {"locked": "another process has it open", "readonly": "it may not be written"}
"""What SQLite's words mean."""


class SqliteFile:
    """An open file, which no other process can open meanwhile."""

    fault: type[GolemError]
    what: str
    version: int
    """Layout of the file."""
    tables: Sequence[str]
    """Statements that make the layout where it is not there."""
    synchronous = "NORMAL"
    """`NORMAL`: what was written survives the process. `FULL`: also a loss of power."""

    def __init__(self, path: Path) -> None:
        """Open or make the file. Raises GolemError, a `fault`: it cannot be used, is foreign, or another process's."""
        self.path = path
        with self._faults():
            path.parent.mkdir(parents=True, exist_ok=True)
            self._base = sqlite3.connect(path, timeout=0.0, isolation_level=None, check_same_thread=False)
            try:
                self._open()
            except BaseException:
                self._base.close()
                raise

    def _open(self) -> None:
        base = self._base
        base.execute("PRAGMA locking_mode=EXCLUSIVE")
        base.execute("PRAGMA journal_mode=WAL")
        base.execute(f"PRAGMA synchronous={self.synchronous}")
        version = base.execute("PRAGMA user_version").fetchone()[0]
        tables = base.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        if (version, bool(tables)) not in ((0, False), (self.version, True)):
            raise self.fault(f"{self.path} is no {self.what} of this version of golem; name another file.")
        base.execute("BEGIN EXCLUSIVE")
        for table in self.tables:
            base.execute(f"CREATE TABLE IF NOT EXISTS {table}")
        base.execute(f"PRAGMA user_version={self.version}")
        base.execute("COMMIT")

    @contextlib.contextmanager
    def _faults(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.DatabaseError, OSError) as error:
            why = next((why for word, why in WHY.items() if word in str(error)), str(error))
            raise self.fault(f"The {self.what} {self.path} cannot be used: {why}.") from None

    @contextlib.contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """Keep all that is written meanwhile or, when something raises, nothing."""
        with self._faults():
            self._base.execute("BEGIN")
            try:
                yield self._base
                self._base.execute("COMMIT")
            except BaseException:
                with contextlib.suppress(sqlite3.Error):
                    self._base.execute("ROLLBACK")
                raise

    def close(self) -> None:
        """Close the file."""
        self._base.close()


class MemoryFile(SqliteFile):
    """An open file, which no other process can open meanwhile; its faults are `MemoryFault`s."""

    fault, what, version = MemoryFault, "memory", 1
    tables = (
        "objects (number INTEGER PRIMARY KEY, label TEXT NOT NULL, "
        f"{', '.join(f'{name} REAL NOT NULL' for name in COLUMNS)})",
        "clock (one INTEGER PRIMARY KEY, last REAL NOT NULL)",
    )

    def read(self) -> tuple[list[ObjectRow], float]:
        """Return every object, and the time of the last look [s], -inf for none. Raises MemoryFault: damaged."""
        with self._faults():
            rows = self._base.execute("SELECT * FROM objects ORDER BY number").fetchall()
            last = self._base.execute("SELECT last FROM clock").fetchone()
        objects = [ObjectRow(int(number), str(label), np.array(values, float)) for number, label, *values in rows]
        return objects, -np.inf if last is None else float(last[0])

    def write(self, changed: Iterable[ObjectRow], removed: Iterable[int], last: float) -> None:
        """Keep what changed: all or, when this raises, nothing. Raises MemoryFault: the disk cannot be written."""
        marks = ", ".join("?" * (2 + len(COLUMNS)))
        rows = [(row.number, row.label, *row.values.tolist()) for row in changed]
        with self._writing() as base:
            base.executemany(f"INSERT OR REPLACE INTO objects VALUES ({marks})", rows)
            base.executemany("DELETE FROM objects WHERE number = ?", [(int(n),) for n in removed])
            base.execute("INSERT OR REPLACE INTO clock VALUES (0, ?)", (last,))
