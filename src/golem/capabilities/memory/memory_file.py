"""A file of remembered objects: SQLite, written ahead, so that what was kept survives the death of the process."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from golem.capabilities.memory.base import MemoryFault
from golem.capabilities.memory.object_records import COLUMNS, ObjectRow

VERSION = 1
"""Layout of the file."""


class MemoryFile:
    """An open file, which no other process can open meanwhile."""

    def __init__(self, path: Path) -> None:
        """Open or make the file.

        Raises:
            MemoryFault: it cannot be opened or written, another process has it, or it is no memory of ours.
        """
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
        base.execute("PRAGMA synchronous=NORMAL")
        version = base.execute("PRAGMA user_version").fetchone()[0]
        tables = base.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        if (version, bool(tables)) not in ((0, False), (VERSION, True)):
            raise MemoryFault(f"{self.path} is no memory of this version of golem; name another file.")
        values = ", ".join(f"{name} REAL NOT NULL" for name in COLUMNS)
        base.execute("BEGIN EXCLUSIVE")
        base.execute(f"CREATE TABLE IF NOT EXISTS objects (number INTEGER PRIMARY KEY, label TEXT NOT NULL, {values})")
        base.execute("CREATE TABLE IF NOT EXISTS clock (one INTEGER PRIMARY KEY, last REAL NOT NULL)")
        base.execute(f"PRAGMA user_version={VERSION}")
        base.execute("COMMIT")

    @contextlib.contextmanager
    def _faults(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.OperationalError as error:
            busy = "locked" in str(error)
            why = "another process has it open" if busy else str(error)
            raise MemoryFault(f"The memory {self.path} cannot be used: {why}.") from None
        except (sqlite3.DatabaseError, OSError) as error:
            raise MemoryFault(f"The memory {self.path} cannot be used: {error}.") from None

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
        with self._faults():
            self._base.execute("BEGIN")
            try:
                self._base.executemany(f"INSERT OR REPLACE INTO objects VALUES ({marks})", rows)
                self._base.executemany("DELETE FROM objects WHERE number = ?", [(int(n),) for n in removed])
                self._base.execute("INSERT OR REPLACE INTO clock VALUES (0, ?)", (last,))
                self._base.execute("COMMIT")
            except BaseException:
                with contextlib.suppress(sqlite3.Error):
                    self._base.execute("ROLLBACK")
                raise

    def close(self) -> None:
        """Close the file."""
        self._base.close()
