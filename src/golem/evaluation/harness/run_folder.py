"""The folder of one run, which survives being interrupted.

`trials.jsonl` holds the records, `timings.jsonl` what depends on the machine: wall and CPU seconds, and what a rung
timed. `run.json` says by which command, code and configuration they came to be. During a run records and timings grow
in the order in which trials finish; `RunFolder.finish` puts the records into canonical order: by case, by index, then
by the order of the methods.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from golem.errors import ConfigError, OutputError, check_known
from golem.evaluation.base import RUNGS, TrialOutcome, TrialSpec, case_name
from golem.evaluation.harness.records import Provenance, TrialRecord, artefacts, read_records, whole_lines
from golem.output_file import write_file
from golem.provenance import changes

FACTS = "run.json"
SHOWN = 3
"""So many differences are named, and the others counted."""


@dataclass(frozen=True, slots=True)
class Finished:
    """A trial that came to an outcome.

    Attributes:
        wall, cpu: what it cost on its machine [s].
        active: robot time in which its gate let commands through [s]; None where that was not counted.
        stops: stops of that gate by reason, without those that were asked for.
        files: what it keeps in addition to its record, by file name.
    """

    outcome: TrialOutcome
    wall: float
    cpu: float
    files: Mapping[str, bytes] = field(default_factory=dict[str, bytes])
    active: float | None = None
    stops: Mapping[str, int] = field(default_factory=dict[str, int])


class RunFolder(AbstractContextManager["RunFolder", None]):
    """The folder of one run, held against a second writer while it is open.

    Opening makes the folder and writes nothing else; the files appear with the first trial. A folder that was made
    here and is still empty when it is closed is taken away again.
    """

    def __init__(self, path: Path) -> None:
        """Make the folder at `path` where needed, and lock it. Raises OutputError: another run has it, or no access."""
        self.path = path
        self._made = not path.exists()
        self._trials = path / "trials.jsonl"
        self._costs = path / "timings.jsonl"
        make_folder(path)
        self._lock = os.open(path, os.O_RDONLY)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(self._lock)
            raise OutputError(f"Another run is writing to {path}; wait for it or choose another --out.") from error

    def __exit__(self, *_: object) -> None:
        """Release the folder, and remove it if it is empty and was made here."""
        os.close(self._lock)
        if self._made and not any(self.path.iterdir()):
            self.path.rmdir()

    def resume(self, example: TrialSpec, provenance: Provenance) -> list[TrialRecord]:
        """Return the trials the folder already holds and cut off torn last lines.

        Args:
            example: any trial of the run that shall continue.
            provenance: of the present configuration and code.

        Raises:
            golem.errors.OutputError: they are of another experiment, configuration, code or package version, so
                that continuing would mix what cannot be compared; says what differs.
        """
        records = read_records(self._trials)
        for record in records:
            for what, old, new in (
                ("rung", record.rung, example.rung),
                ("profile", record.profile, example.profile),
                ("seed", record.seed, example.seed),
                ("overrides", dict(record.overrides), dict(example.overrides)),
                ("options", dict(record.options), dict(example.options)),
                ("package versions", dict(record.versions), dict(provenance.versions)),
            ):
                if old != new:
                    raise self._mixed(what, changes(what, old, new))
            facts = read_facts(self.path)
            if record.code != provenance.code:
                raise self._mixed("code", changes("", facts.get("files", {}), provenance.files))
            method = record.method
            if provenance.configs.get(method, record.config) != record.config:
                then = facts.get("configs", {}).get(method, {})
                raise self._mixed("configuration", changes("", then, provenance.facts[method]))
        for path in (self._trials, self._costs):
            if path.exists():
                os.truncate(path, whole_lines(path.read_bytes()))
        return records

    def _mixed(self, what: str, differences: Sequence[str]) -> OutputError:
        named = "; ".join(differences[:SHOWN]).replace("config.user_files.", "the content of your file for ")
        more = f"; and {len(differences) - SHOWN} more" if len(differences) > SHOWN else ""
        return OutputError(
            f"{self.path} holds trials that differ in {what} and cannot be mixed; choose another --out. "
            f"What differs: {named or 'unknown, run.json is missing'}{more}."
        )

    def state(self, command: str, provenance: Provenance) -> None:
        """Write by which command, code and configurations the trials came to be; methods of earlier runs stay."""
        facts = {
            "command": command,
            "commit": provenance.commit,
            "versions": dict(provenance.versions),
            "configs": {**read_facts(self.path).get("configs", {}), **provenance.facts},
            "files": dict(provenance.files),
        }
        self.write_text(FACTS, json.dumps(facts, indent=1) + "\n")

    def append(self, record: TrialRecord, finished: Finished) -> None:
        """Keep one finished trial, its record last, so that its files exist. Raises OutputError: the disk refuses."""
        cost = {"method": record.method, "case": dict(record.case), "index": record.index}
        cost |= {"wall": finished.wall, "cpu": finished.cpu, **finished.outcome.costs}
        if finished.active is not None:
            cost |= {"active": round(finished.active, 3), "stops": dict(finished.stops)}
        try:
            for name, content in finished.files.items():
                file = artefacts(self.path, record) / name
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(content)
            if record.picture is not None and finished.outcome.picture is not None:
                picture = self.path / record.picture
                picture.parent.mkdir(exist_ok=True)
                picture.write_bytes(finished.outcome.picture)
            append_line(self._trials, record.line())
            append_line(self._costs, json.dumps(cost) + "\n")
        except OSError as error:
            raise OutputError(f"Cannot write to {self.path}: {error.strerror}.") from error

    def finish(
        self, records: Sequence[TrialRecord], methods: Sequence[str], cases: Sequence[str] = ()
    ) -> list[TrialRecord]:
        """Rewrite `trials.jsonl` in canonical order, whole or not at all, and return the records so ordered.

        Cases and methods that are not named (of an adaptive rung, or from an earlier run) follow by their values.
        """
        by_case, by_method = ({name: i for i, name in enumerate(names)} for names in (cases, methods))

        def order(r: TrialRecord) -> tuple[Any, ...]:
            case, method = case_name(r.case), by_method.get(r.method, len(methods))
            return by_case.get(case, len(cases)), tuple(r.case.values()), r.index, method, r.method

        ordered = sorted(records, key=order)
        self.write_text(self._trials.name, "".join(record.line() for record in ordered))
        return ordered

    def write_text(self, name: str, text: str) -> Path:
        """Write a file of the folder, whole or not at all, and return its path."""
        return write_file(self.path / name, text)


def make_folder(folder: Path) -> None:
    """Make the folder of an --out where needed. Raises OutputError: it cannot be made, read or written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"Cannot write to --out {folder}: {error.strerror}; choose another.") from error
    if not os.access(folder, os.R_OK | os.W_OK | os.X_OK):
        raise OutputError(f"Cannot write to --out {folder}: Permission denied; choose another.")


def records_of_runs(folders: Iterable[Path]) -> list[TrialRecord]:
    """Return the trials of run folders, see `finished_records`. Raises ConfigError, too: a trial is in two of them."""
    found: dict[tuple[object, ...], tuple[Path, TrialRecord]] = {}
    for folder in folders:
        for record in finished_records(folder):
            trial = (record.rung, record.profile, record.seed, record.key, record.config, record.code)
            if trial in found:
                both = f"{found[trial][0]} and {folder}"
                raise ConfigError(f"Trial {record.index} of '{record.method}' is in {both}: give each run once.")
            found[trial] = folder, record
    return [record for _, record in found.values()]


def finished_records(folder: Path) -> list[TrialRecord]:
    """Return the trials of a run folder that nobody writes to, at least one.

    Raises:
        golem.errors.OutputError: a run writes to it, or ended while it wrote, or a line is no trial record.
        ConfigError: it holds no trials.
    """
    trials, absent = folder / "trials.jsonl", "" if folder.is_dir() else ": no such folder"
    none = f"{folder} holds no trials{absent}; give the --out folder of a golem ladder or a golem study."
    if not trials.is_file():
        raise ConfigError(none)
    held = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(held, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError as error:
        raise OutputError(f"Another run is writing to {folder}; wait for it.") from error
    finally:
        os.close(held)
    text = trials.read_bytes()
    if whole_lines(text) < len(text):
        raise OutputError(f"The last line of {trials} is half-written; give its command again to continue the run.")
    records = read_records(trials)
    if not records:
        raise ConfigError(none)
    check_known(f"rung of {trials}", RUNGS, records[0].rung)
    return records


def read_facts(folder: Path) -> dict[str, Any]:
    """Return what `run.json` of a run folder says; nothing where there is none."""
    try:
        return {**json.loads((folder / FACTS).read_text(encoding="utf-8"))}
    except (OSError, ValueError, TypeError):
        return {}


def read_costs(folder: Path) -> list[dict[str, Any]]:
    """Return the lines of a run folder's `timings.jsonl`; a torn last one is left out."""
    path = folder / "timings.jsonl"
    if not path.is_file():
        return []
    text, found = path.read_bytes(), list[dict[str, Any]]()
    for number, line in enumerate(text[: whole_lines(text)].splitlines(), start=1):
        try:
            cost = json.loads(line)
            found.append({**cost, "wall": float(cost["wall"]), "cpu": float(cost["cpu"])})
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            raise OutputError(f"Line {number} of {path} says no times of a trial; choose another folder.") from error
    return found


def append_line(path: Path, line: str) -> None:
    """Append one line in one write, and wait until the disk has it."""
    handle = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    try:
        if os.write(handle, line.encode()) < len(line.encode()):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        os.fsync(handle)
    finally:
        os.close(handle)
