"""A file of remembered objects."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from golem.capabilities.memory.base import MemoryFault
from golem.capabilities.memory.object_records import COLUMNS, ObjectRow
from golem.capabilities.memory.sqlite_file import SqliteFile


class MemoryFile(SqliteFile):
    """An open file, which no other process can open meanwhile; its faults are `MemoryFault`s."""

    fault, what, version = MemoryFault, "memory", 1
    tables = (
        "objects (number INTEGER PRIMARY KEY, label TEXT NOT NULL, "
        f"{', '.join(f'{name} REAL NOT NULL' for name in COLUMNS)})",
        "clock (one INTEGER PRIMARY KEY, last REAL NOT NULL)",
    )

    def read(self) -> tuple[list[ObjectRow], float]:
        """Return every object, and the time of the last look [s], -inf where there was none.

        Raises:
            MemoryFault: the file is damaged.
        """
        with self._faults():
            rows = self._base.execute("SELECT * FROM objects ORDER BY number").fetchall()
            last = self._base.execute("SELECT last FROM clock").fetchone()
        objects = [ObjectRow(int(number), str(label), np.array(values, float)) for number, label, *values in rows]
        return objects, -np.inf if last is None else float(last[0])

    def write(self, changed: Iterable[ObjectRow], removed: Iterable[int], last: float) -> None:
        """Keep what changed: all of it or, when this raises, nothing.

        Raises:
            MemoryFault: the disk is full or cannot be written.
        """
        marks = ", ".join("?" * (2 + len(COLUMNS)))
        rows = [(row.number, row.label, *row.values.tolist()) for row in changed]
        with self._writing() as base:
            base.executemany(f"INSERT OR REPLACE INTO objects VALUES ({marks})", rows)
            base.executemany("DELETE FROM objects WHERE number = ?", [(int(n),) for n in removed])
            base.execute("INSERT OR REPLACE INTO clock VALUES (0, ?)", (last,))
