"""The file of a job: every fastener of a pack, and all that happened to it, told before and after every try."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, field
from enum import StrEnum
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.capabilities.memory.memory_file import SqliteFile
from golem.errors import ConfigError
from golem.skills.fastener_list import KINDS, Listed
from golem.types import Array, PlanarPose, Side


class Fate(StrEnum):
    """What became of a fastener."""

    OPEN = "open"
    """It is to be taken, or to be tried again."""
    TRYING = "trying"
    """A hand is at it; where the job ended so, nobody knows."""
    UNSETTLED = "unsettled"
    """It was let go or lost, and was not seen in the tray: a look at its place decides."""
    IN_TRAY = "in_tray"
    TIGHT = "tight"
    JAMMED = "jammed"
    MISSING = "missing"
    """Others are seen, and none at its place."""
    NOT_FOUND = "not_found"
    """A hand was there and found nothing."""
    OUT_OF_REACH = "out_of_reach"
    BLOCKED = "blocked"
    LOST = "lost"
    """Its place is empty, and it was not seen in the tray."""
    FAILED = "failed"


TO_DO = (Fate.OPEN, Fate.TRYING, Fate.UNSETTLED)
"""Fates that are not the last."""


class JobFault(ConfigError):
    """The file of a job cannot be used."""


@dataclass
class PackFastener:
    """A fastener, and what was told of it last.

    Attributes:
        number: its place in the list.
        listed: what the list says.
        fate: what became of it.
        reason: one sentence.
        side: hand that tried it.
        tray: name of the container that it is in, or its class where none is listed.
        stance: of base_link in the pack frame.
        t, when: robot time [s], and the date, in UTC.
        picture: path of a picture, from the folder of the job.
        tries: how often it was tried.
        barred: stances and hands from which it was not taken.
    """

    number: int
    listed: Listed
    fate: Fate = Fate.OPEN
    reason: str = ""
    side: str = ""
    tray: str = ""
    stance: PlanarPose | None = None
    t: float = 0.0
    when: str = ""
    picture: str = ""
    tries: int = 0
    barred: list[tuple[PlanarPose, str]] = field(default_factory=list["tuple[PlanarPose, str]"])

    @property
    def place(self) -> Array:
        """(3,) in the pack frame [m]."""
        return np.array([self.listed.x, self.listed.y, self.listed.z])

    @property
    def label(self) -> str:
        """What the localizer calls it."""
        return KINDS[self.listed.kind]


class JobFile(SqliteFile):
    """The open file of a job; what `tell` has returned from is kept whatever happens.

    Attributes:
        fasteners: all, in the order of the list.
        containers: what else was listed.
        loosened: names of the fasteners that a gantry is done with.
    """

    fault, what, version, synchronous = JobFault, "job", 2, "FULL"
    tables = (
        "listed (number INTEGER PRIMARY KEY, name TEXT NOT NULL, kind TEXT NOT NULL, x REAL NOT NULL, y REAL NOT NULL,"
        " z REAL NOT NULL, loose INTEGER, takes TEXT NOT NULL)",
        "events (id INTEGER PRIMARY KEY, number INTEGER NOT NULL REFERENCES listed, fate TEXT NOT NULL,"
        " reason TEXT NOT NULL, side TEXT NOT NULL, tray TEXT NOT NULL, x REAL, y REAL, yaw REAL, t REAL NOT NULL,"
        " happened TEXT NOT NULL DEFAULT CURRENT_TIMESTAMP, picture TEXT NOT NULL)",
        "loosened (name TEXT PRIMARY KEY)",
    )
    fasteners: list[PackFastener]
    containers: list[Listed]
    loosened: set[str]

    def __init__(self, path: Path, listed: Sequence[Listed] = ()) -> None:
        """Open or make the job at `path`; a new one is of what is `listed`, an old one of nothing else.

        Raises JobFault: there is no such job and no list, the job is of another list, or the file cannot be used.
        """
        if not listed and not path.exists():
            raise JobFault(f"There is no job {path}; name a list to begin one.")
        super().__init__(path)
        try:
            with self._faults():
                self._read(listed)
        except (KeyError, TypeError, ValueError) as error:
            self.close()
            raise JobFault(f"The job {path} is damaged, {error!r}; name another file.") from error
        except BaseException:
            self.close()
            raise

    def _read(self, listed: Sequence[Listed]) -> None:
        rows = self._base.execute("SELECT name, kind, x, y, z, loose, takes FROM listed ORDER BY number").fetchall()
        if not rows:
            with self._writing() as base:
                values = [(k, *astuple(one)) for k, one in enumerate(listed)]
                base.executemany("INSERT INTO listed VALUES (?, ?, ?, ?, ?, ?, ?, ?)", values)
        kept = [
            Listed(a, b, float(x), float(y), float(z), None if s is None else bool(s), t)
            for a, b, x, y, z, s, t in rows
        ] or list(listed)
        if listed and kept != list(listed):
            raise JobFault(f"The job {self.path} is of another list; name another job, or no list to go on with it.")
        self.fasteners = [PackFastener(k, one) for k, one in enumerate(kept) if one.kind in KINDS]
        self.containers = [one for one in kept if one.kind not in KINDS]
        if not self.fasteners:
            raise JobFault(f"The job {self.path} has no fasteners; name another file.")
        by_number = {one.number: one for one in self.fasteners}
        told = "SELECT number, fate, reason, side, tray, x, y, yaw, t, happened, picture FROM events ORDER BY id"
        for number, fate, reason, side, tray, x, y, yaw, t, when, picture in self._base.execute(told):
            stance = None if x is None else PlanarPose(float(x), float(y), float(yaw))
            _take(by_number[number], Fate(fate), reason, side, tray, stance, t, when, picture)
        self.loosened = {name for (name,) in self._base.execute("SELECT name FROM loosened")}

    def loosen(self, name: str) -> None:
        """Note that a gantry is done with a fastener; `keep_loosened`, and the next `tell`, keep that for good."""
        self.loosened.add(name)

    def keep_loosened(self) -> None:
        """Write what a gantry is done with. Raises JobFault: the disk is full or cannot be written."""
        with self._faults():
            rows = [(name,) for name in list(self.loosened)]
            self._base.executemany("INSERT OR IGNORE INTO loosened VALUES (?)", rows)

    def tell(
        self,
        one: PackFastener,
        fate: Fate,
        t: float,
        reason: str = "",
        side: Side | str = "",
        tray: str = "",
        stance: PlanarPose | None = None,
        picture: str = "",
    ) -> None:
        """Keep what happened to a fastener, for good, and then change it.

        Raises JobFault: the disk is full or cannot be written.
        """
        self.keep_loosened()
        pose = (None,) * 3 if stance is None else (stance.x, stance.y, stance.yaw)
        names = "number, fate, reason, side, tray, x, y, yaw, t, picture"
        values = (one.number, fate.value, reason, side, tray, *pose, t, picture)
        with self._faults():
            question = f"INSERT INTO events ({names}) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?) RETURNING happened"
            [(happened,)] = self._base.execute(question, values).fetchall()
        _take(one, fate, reason, side, tray, stance, t, happened, picture)

    def keep(self, one: PackFastener, rgb: NDArray[np.uint8]) -> str:
        """Write a picture of a fastener's place beside the file; return its path from there, empty if that fails."""
        path = self.path.with_name(f"{self.path.stem}_pictures") / f"{one.number:03d}_{one.tries}.jpg"
        path.parent.mkdir(exist_ok=True)
        return f"{path.parent.name}/{path.name}" if cv2.imwrite(str(path), rgb[:, :, ::-1]) else ""


def _take(
    one: PackFastener, fate: Fate, reason: str, side: str, tray: str, stance: PlanarPose | None, t: float, when: str,
    picture: str,
) -> None:  # fmt: skip
    one.fate, one.reason, one.side, one.tray, one.t, one.when = fate, reason, side, tray, t, when
    one.picture, one.stance = picture or one.picture, stance or one.stance
    one.tries += fate is Fate.TRYING
    if fate is Fate.OPEN and stance is not None:
        one.barred.append((stance, side))
