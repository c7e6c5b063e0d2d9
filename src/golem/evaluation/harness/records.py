"""Trial records: one JSON line per trial. It holds what the trial determined and nothing that depends on the machine.

The same seed gives the same bytes, but for a trial that outlasted its limit or whose process died.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from golem.errors import OutputError, shorten
from golem.evaluation.base import Case, Key, TrialOutcome, TrialSpec, case_name
from golem.provenance import digest

SCHEMA = 2
"""Version of the record's fields; raised when one changes its meaning."""
SORTED = ("overrides", "options", "versions", "timings", "series")
"""Fields whose names are written in alphabetical order."""
_JSON = {"int": (int,), "str": (str,), "bool": (bool,), "str | None": (str, type(None))}
"""Type of a field -> what JSON has for it; the others are mappings."""


@dataclass(frozen=True, slots=True)
class TrialRecord:
    """One line of `trials.jsonl`.

    Attributes:
        schema: `SCHEMA` of the software that wrote it.
        rung, method, profile, seed, index, overrides, options, case: the trial, see `TrialSpec`.
        config: hash of the resolved configuration.
        code: hash of the package's files.
        commit: git commit or version of the package.
        versions: package -> version.
        success, stage, module, detail, timings, series, trace: the outcome, see `TrialOutcome`.
        picture: path of the picture within the run folder, or None.
    """

    schema: int
    rung: str
    method: str
    profile: str
    seed: int
    index: int
    overrides: Mapping[str, str]
    options: Mapping[str, Any]
    case: Case
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
    trace: str | None

    @property
    def key(self) -> Key:
        return self.method, case_name(self.case), self.index

    @property
    def spec(self) -> TrialSpec:
        """The trial it is of."""
        return TrialSpec(
            self.rung, self.method, self.profile, self.seed, self.index, self.overrides, self.options, self.case
        )

    @property
    def outcome(self) -> TrialOutcome:
        """What became of it, without its picture."""
        return TrialOutcome(
            self.success, self.stage, self.module, self.detail, self.timings, self.series, trace=self.trace
        )

    def line(self) -> str:
        """Return the record as one line of JSON, newline included."""
        data = asdict(self)
        for name in SORTED:
            data[name] = dict(sorted(data[name].items()))
        return json.dumps(data, separators=(",", ":"), allow_nan=False) + "\n"

    @classmethod
    def parse(cls, line: str) -> TrialRecord:
        """Return the record of one line. Raises ValueError: the line is not a record of this schema."""
        data = json.loads(line)
        if not isinstance(data, dict) or "schema" not in data:
            raise ValueError("no trial record")
        if data["schema"] != SCHEMA:
            raise ValueError(
                f"a trial record of schema {data['schema']}, of another version of golem, which reads schema {SCHEMA}"
            )
        if set(data) != {f.name for f in fields(cls)}:
            raise ValueError("a trial record with missing or unknown fields")
        wrong = [f.name for f in fields(cls) if type(data[f.name]) not in _JSON.get(str(f.type), (dict,))]
        if wrong:
            raise ValueError(f"a trial record whose '{wrong[0]}' is {shorten(repr(data[wrong[0]]), 40)}")
        record = cls(**data)
        try:
            if record.index < 0:
                raise ValueError("its index is below 0")
            _ = record.key, record.outcome  # they refuse what no trial has
        except (TypeError, ValueError) as error:
            raise ValueError(f"a trial record that cannot be ({error})") from error
        return record


@dataclass(frozen=True, slots=True)
class Provenance:
    """What every record of a run shares, apart from the method.

    Attributes:
        facts: method -> its resolved configuration.
        files: file of the package -> hash of its content.
        commit, versions: see `TrialRecord`.
        configs, code: method -> hash of `facts`, and hash of `files`.
    """

    facts: Mapping[str, Mapping[str, Any]]
    files: Mapping[str, str]
    commit: str
    versions: Mapping[str, str]
    configs: Mapping[str, str] = field(init=False)
    code: str = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "configs", {method: digest(facts) for method, facts in self.facts.items()})
        object.__setattr__(self, "code", digest(self.files))

    def record(self, spec: TrialSpec, outcome: TrialOutcome) -> TrialRecord:
        """Return the record of one finished trial."""
        return TrialRecord(
            schema=SCHEMA, rung=spec.rung, method=spec.method, profile=spec.profile, seed=spec.seed, index=spec.index,
            overrides=dict(spec.overrides), options=dict(spec.options), case=dict(spec.case),
            config=self.configs[spec.method], code=self.code, commit=self.commit, versions=self.versions,
            success=bool(outcome.success), stage=outcome.stage, module=outcome.module, detail=outcome.detail,
            timings={name: float(value) for name, value in outcome.timings.items()},
            series={name: float(value) for name, value in outcome.series.items()},
            picture=None if outcome.picture is None else f"pictures/{trial_name(spec)}.png", trace=outcome.trace,
        )  # fmt: skip


def trial_name(trial: TrialSpec | TrialRecord) -> str:
    """Return the file name, without suffix, of what belongs to one trial."""
    # A method may be named `folder/file.py:Class`, and another `folder_file.py:Class`.
    plain = re.sub(r"[^A-Za-z0-9_.-]", "_", trial.method)
    if plain != trial.method:
        plain = f"{plain[-60:]}-{hashlib.sha256(trial.method.encode()).hexdigest()[:6]}"
    case = re.sub(r"[^A-Za-z0-9_.]+", "-", case_name(trial.case))
    return "-".join(part for part in (plain, case, f"{trial.index:05d}") if part)


def artefacts(folder: Path, trial: TrialSpec | TrialRecord) -> Path:
    """Return the folder within the run `folder` for what one trial keeps in addition to its record."""
    return folder / "artefacts" / trial_name(trial)


def read_records(path: Path) -> list[TrialRecord]:
    """Return the records of a `trials.jsonl`; a last line that a kill tore off is left out.

    Raises golem.errors.OutputError: another line is no trial record, or one that was there, or the file cannot be read.
    """
    try:
        text = path.read_bytes()
    except FileNotFoundError:
        return []
    except OSError as error:
        raise OutputError(f"Cannot read {path}: {error.strerror}.") from error
    records: dict[Key, TrialRecord] = {}
    for number, line in enumerate(text[: whole_lines(text)].splitlines(), start=1):
        try:
            record = TrialRecord.parse(line.decode())
            if record.key in records:
                raise ValueError(f"the second record of trial {record.index} of {record.method}")
            records[record.key] = record
        except (ValueError, RecursionError) as error:
            raise OutputError(f"Line {number} of {path} is {error}; choose another folder.") from error
    return list(records.values())


def whole_lines(text: bytes) -> int:
    """Return the length of `text` up to and with its last newline."""
    return text.rfind(b"\n") + 1
