"""A study file: which rungs, methods, profiles, layouts, engines and seeds are measured, as YAML."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Literal, cast

import yaml

from golem.errors import ConfigError, check_known
from golem.evaluation.base import rung_class
from golem.evaluation.harness.ladder import LadderConfig
from golem.options import fill, read_yaml

AXES = ("rung", "profile", "layout", "engine", "seed")
"""What an entry may give several values of, each with each."""


@dataclass(frozen=True)
class StudyEntry:
    """One entry of `cells`: a ladder, or one for each combination of the values of its `AXES`.

    Attributes:
        rung, profile, layout, engine, seed: a value, or a list of values.
        method: what is compared on the same scenes.
        name: what the cell is called, and its folder; by default its rung.
        n: trials per method.
        best_n: so many trials for the two best methods, after `n` of all.
        options: the rung's own.
        use: replaced modules, `slot=implementation`.
    """

    rung: Any
    method: tuple[Any, ...] = ()
    name: str = ""
    n: int | None = None
    best_n: int | None = None
    profile: Any = None
    layout: Any = None
    engine: Any = None
    seed: Any = None
    options: Any = field(default_factory=dict[str, Any])
    use: tuple[str, ...] = ()


@dataclass(frozen=True)
class StudyFile:
    """The content of a study file.

    Attributes:
        title: one line.
        about: what it is for.
        by_construction: which differences the profile puts in, said beside the tables.
        cells: what is measured.
        compare: pairs of cells, compared method by method: scene by scene where their seeds are the same.
        n, best_n, profile, seed: for entries that do not say.
        stop, margin, score: see `golem ladder`.
    """

    title: str
    cells: tuple[StudyEntry, ...]
    about: str = ""
    by_construction: str = ""
    compare: tuple[tuple[str, str], ...] = ()
    n: int | None = None
    best_n: int | None = None
    profile: Any = None
    seed: Any = 0
    stop: Literal["never", "decided"] = "never"
    margin: float = 0.1
    score: str = ""


@dataclass(frozen=True, slots=True)
class Cell:
    """One ladder of a study, named as its folder; `config` is whole but for folder and processes."""

    name: str
    config: LadderConfig
    best_n: int | None = None


def read_study_file(path: Path) -> tuple[StudyFile, tuple[Cell, ...]]:
    """Return a study file and its named cells. Raises ConfigError: it cannot be read or cannot be; names the file."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise ConfigError(f"Cannot read the study {path}: {why}; see the folder studies for examples.") from error
    data = read_yaml(text, str(path))
    if not isinstance(data, Mapping):
        raise ConfigError(
            f"{path} is no study: it must be a mapping with {', '.join(f.name for f in fields(StudyFile))}."
        )
    try:
        study = fill("key of the study", StudyFile, cast("Mapping[str, object]", data))
        cells = tuple(cell for entry in study.cells for cell in _expand(study, entry))
        _check_names(study, [cell.name for cell in cells])
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from error
    return study, cells


def _expand(study: StudyFile, entry: StudyEntry) -> list[Cell]:
    defaults = {"profile": study.profile, "seed": study.seed}
    values = [_several(defaults.get(name) if (given := getattr(entry, name)) is None else given) for name in AXES]
    found: list[Cell] = []
    for chosen in itertools.product(*values):
        rung, profile, layout, engine, seed = chosen
        parts = [entry.name or str(rung)] + [
            str(value)
            for name, value, all_ in zip(AXES, chosen, values, strict=True)
            if len(all_) > 1 and (name != "rung" or entry.name)
        ]
        config = _ladder(study, entry, rung, profile, layout, engine, seed)
        found.append(Cell("-".join(parts), config, entry.best_n or study.best_n))
    return found


def _ladder(
    study: StudyFile, entry: StudyEntry, rung: Any, profile: Any, layout: Any, engine: Any, seed: Any
) -> LadderConfig:
    kind = rung_class(str(rung))
    if not isinstance(entry.options, Mapping):
        raise ConfigError("The options of a cell are a mapping of names to values.")
    options, use = dict(cast("Mapping[str, Any]", entry.options)), entry.use
    if layout is not None:
        options["layout"] = layout
    if engine is not None and "engine" in {f.name for f in fields(kind.Options)}:
        options["engine"] = [engine]
    elif engine not in (None, "mujoco"):
        use = (*use, f"robot={engine}")
    if isinstance(seed, bool) or not isinstance(seed, int):
        raise ConfigError(f"The seed of a cell is a whole number, not {seed!r}.")
    return LadderConfig(
        str(rung),
        tuple(_method(method) for method in entry.method),
        entry.n or study.n,
        None if profile is None else str(profile),
        seed,
        use=use,
        stop="never" if kind.adaptive else study.stop,
        margin=study.margin,
        score=study.score,
        options=fill(f"option of rung {rung}", kind.Options, options),
    ).whole()


def _method(value: Any) -> str:
    """Return a method as `golem ladder` takes it: options may stand in the file as a mapping, as in a stack file."""
    if isinstance(value, Mapping):
        return yaml.safe_dump(value, default_flow_style=True, sort_keys=False, width=10_000).strip()
    if not isinstance(value, str):
        raise ConfigError(f"A method is a name, file.py:Class, or {{use: NAME, option: value}}; not {value!r}.")
    return value


def _several(value: Any) -> list[Any]:
    return cast("list[Any]", value) if isinstance(value, list) and value else [value]


def _check_names(study: StudyFile, names: Sequence[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f"Two cells are called '{name}'; give one of them a `name`.")
        if not name or any(not (c.isalnum() or c in "-_.") for c in name) or name.startswith("."):
            raise ConfigError(f"'{name}' names a folder: letters, digits, '-', '_' and '.' only.")
    check_known("cell", names, *itertools.chain(*study.compare))
    if not names:
        raise ConfigError("A study needs at least one cell.")
