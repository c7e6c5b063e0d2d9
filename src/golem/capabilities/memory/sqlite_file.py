"""A file of SQLite that one process has open, written ahead, so that what was kept survives the process."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator, Sequence
from pathlib import Path

from golem.errors import GolemError

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
        """Open or make the file.

        Raises:
            GolemError: a `fault`: it cannot be opened or written, another process has it, or it is none of ours.
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
