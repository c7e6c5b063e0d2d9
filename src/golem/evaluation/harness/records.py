"""Trial records: one JSON line per trial, in a folder that survives being interrupted.

`trials.jsonl` holds what a trial determined and nothing that depends on the machine, so that the same seed gives the
same bytes. `timings.jsonl` holds wall and CPU seconds. During a run both grow in the order in which trials finish;
`RunFolder.finish` puts the records into canonical order: by index, then by the order of the methods.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from types import TracebackType

from golem.errors import OutputError
from golem.evaluation.base import TrialOutcome, TrialSpec
from golem.evaluation.harness.trials import Finished

SCHEMA = 1
"""Version of the record's fields; raised when one changes its meaning."""


@dataclass(frozen=True, slots=True)
class TrialRecord:
    """One line of `trials.jsonl`.

    Attributes:
        schema: `SCHEMA` of the software that wrote it.
        rung, method, profile, seed, index, overrides: the trial, see `TrialSpec`.
        config: hash of the resolved configuration.
        code: hash of the package's files.
        commit: git commit or version of the package.
        versions: package -> version.
        success, stage, module, detail, timings, series: the outcome, see `TrialOutcome`.
        picture: path of the picture within the run folder, or None.
    """

    schema: int
    rung: str
    method: str
    profile: str
    seed: int
    index: int
    overrides: Mapping[str, str]
    config: str
    code: str
    commit: str
    versions: Mapping[str, str]
    success: bool
    stage: str
    module: str | None
    detail: str
    timings: Mapping[str, float]
    series: Mapping[str, float]
    picture: str | None

    @property
    def key(self) -> tuple[str, int]:
        """What tells a trial from the others of its run: method and index."""
        return self.method, self.index

    def line(self) -> str:
        """Return the record as one line of JSON, newline included."""
        data = asdict(self)
        for name in ("overrides", "versions", "timings", "series"):
            data[name] = dict(sorted(data[name].items()))
        return json.dumps(data, separators=(",", ":"), allow_nan=False) + "\n"

    @classmethod
    def parse(cls, line: str) -> TrialRecord:
        """Return the record of one line.

        Raises:
            ValueError: the line is not a record of this schema.
        """
        data = json.loads(line)
        if not isinstance(data, dict) or data.get("schema") != SCHEMA:
            raise ValueError(f"not a trial record of schema {SCHEMA}")
        if set(data) != {f.name for f in fields(cls)}:
            raise ValueError("a trial record with missing or unknown fields")
        return cls(**data)


@dataclass(frozen=True, slots=True)
class Provenance:
    """What every record of a run shares, apart from the method.

    Attributes:
        configs: method -> hash of its resolved configuration.
        code, commit, versions: see `TrialRecord`.
    """

    configs: Mapping[str, str]
    code: str
    commit: str
    versions: Mapping[str, str]

    def record(self, spec: TrialSpec, outcome: TrialOutcome) -> TrialRecord:
        """Return the record of one finished trial."""
        return TrialRecord(
            schema=SCHEMA,
            rung=spec.rung,
            method=spec.method,
            profile=spec.profile,
            seed=spec.seed,
            index=spec.index,
            overrides=dict(spec.overrides),
            config=self.configs[spec.method],
            code=self.code,
            commit=self.commit,
            versions=self.versions,
            success=bool(outcome.success),
            stage=outcome.stage,
            module=outcome.module,
            detail=outcome.detail,
            timings={name: float(value) for name, value in outcome.timings.items()},
            series={name: float(value) for name, value in outcome.series.items()},
            picture=None if outcome.picture is None else f"pictures/{trial_name(spec)}.png",
        )


def trial_name(trial: TrialSpec | TrialRecord) -> str:
    """Return the file name, without suffix, of what belongs to one trial."""
    # A method may be named `folder/file.py:Class`, and another `folder_file.py:Class`.
    plain = re.sub(r"[^A-Za-z0-9_.-]", "_", trial.method)
    if plain != trial.method:
        plain = f"{plain[-60:]}-{hashlib.sha256(trial.method.encode()).hexdigest()[:6]}"
    return f"{plain}-{trial.index:05d}"


def artefacts(folder: Path, trial: TrialSpec | TrialRecord) -> Path:
    """Return the folder within the run `folder` for what one trial keeps beside its record."""
    return folder / "artefacts" / trial_name(trial)


def read_records(path: Path) -> list[TrialRecord]:
    """Return the records of a `trials.jsonl`; a last line that a kill tore off is left out.

    Raises:
        golem.errors.OutputError: another line is no trial record, or the file cannot be read.
    """
    try:
        text = path.read_bytes()
    except FileNotFoundError:
        return []
    except OSError as error:
        raise OutputError(f"Cannot read {path}: {error.strerror}.") from error
    records = []
    for number, line in enumerate(text[: whole_lines(text)].splitlines(), start=1):
        try:
            records.append(TrialRecord.parse(line.decode()))
        except ValueError as error:
            raise OutputError(f"Line {number} of {path} is {error}; choose another --out.") from error
    return records


def whole_lines(text: bytes) -> int:
    """Return the length of `text` up to and with its last newline."""
    return text.rfind(b"\n") + 1


class RunFolder:
    """The folder of one run, held against a second writer while it is open.

    Opening makes the folder and writes nothing else; the files appear with the first trial. A folder that was made
    here and is still empty when it is closed is taken away again.
    """

    def __init__(self, path: Path) -> None:
        """Make the folder at `path` where needed and take its lock.

        Raises:
            golem.errors.OutputError: it cannot be written, or another run holds it.
        """
        self.path = path
        self._made = not path.exists()
        self._trials = path / "trials.jsonl"
        self._costs = path / "timings.jsonl"
        try:
            path.mkdir(parents=True, exist_ok=True)
            self._lock = os.open(path, os.O_RDONLY)
        except OSError as error:
            raise OutputError(f"Cannot write to --out {path}: {error.strerror}; choose another.") from error
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(self._lock)
            raise OutputError(
                f"Another run is writing to {path}; wait for it or choose another --out."
            ) from error
        if not os.access(path, os.W_OK | os.X_OK):
            os.close(self._lock)
            raise OutputError(f"Cannot write to --out {path}: Permission denied; choose another.")

    def __enter__(self) -> RunFolder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Release the folder, and remove it if it is empty and was made here."""
        os.close(self._lock)
        if self._made and not any(self.path.iterdir()):
            self.path.rmdir()

    def resume(
        self, rung: str, profile: str, seed: int, overrides: Mapping[str, str], provenance: Provenance
    ) -> list[TrialRecord]:
        """Return the trials the folder already holds and cut off torn last lines.

        Raises:
            golem.errors.OutputError: they are of another experiment, configuration, code or package version, so
                that continuing would mix what cannot be compared.
        """
        records = read_records(self._trials)
        for record in records:
            now = (
                ("rung", record.rung, rung),
                ("profile", record.profile, profile),
                ("seed", record.seed, seed),
                ("overrides", dict(record.overrides), dict(overrides)),
                ("configuration", record.config, provenance.configs.get(record.method, record.config)),
                ("code", record.code, provenance.code),
                ("package versions", dict(record.versions), dict(provenance.versions)),
            )
            for what, old, new in now:
                if old != new:
                    raise OutputError(
                        f"{self.path} holds trials with another {what} ({old}, now {new}), which cannot be mixed; "
                        f"choose another --out."
                    )
        for path in (self._trials, self._costs):
            if path.exists():
                os.truncate(path, whole_lines(path.read_bytes()))
        return records

    def append(self, record: TrialRecord, finished: Finished) -> None:
        """Keep one finished trial: its picture first, then its record, so that a record's picture exists.

        Raises:
            golem.errors.OutputError: the disk refuses.
        """
        cost = {"method": record.method, "index": record.index, "wall": finished.wall, "cpu": finished.cpu}
        try:
            if record.picture is not None and finished.outcome.picture is not None:
                picture = self.path / record.picture
                picture.parent.mkdir(exist_ok=True)
                picture.write_bytes(finished.outcome.picture)
            append_line(self._trials, record.line())
            append_line(self._costs, json.dumps(cost) + "\n")
        except OSError as error:
            raise OutputError(f"Cannot write to {self.path}: {error.strerror}.") from error

    def finish(self, records: Sequence[TrialRecord], methods: Sequence[str]) -> list[TrialRecord]:
        """Rewrite `trials.jsonl` in canonical order, whole or not at all, and return the records so ordered.

        Methods that are not in `methods` (from an earlier run in the same folder) follow by name.
        """
        place = {method: i for i, method in enumerate(methods)}
        ordered = sorted(records, key=lambda r: (r.index, place.get(r.method, len(place)), r.method))
        self.write_text(self._trials.name, "".join(record.line() for record in ordered))
        return ordered

    def write_text(self, name: str, text: str) -> Path:
        """Write a file of the folder, whole or not at all, and return its path."""
        path = self.path / name
        part = path.with_name(name + ".part")
        try:
            part.write_text(text, encoding="utf-8")
            os.replace(part, path)
        except OSError as error:
            raise OutputError(f"Cannot write {path}: {error.strerror}.") from error
        return path


def append_line(path: Path, line: str) -> None:
    """Append one line in one write, and wait until the disk has it."""
    handle = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    try:
        if os.write(handle, line.encode()) < len(line.encode()):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        os.fsync(handle)
    finally:
        os.close(handle)
