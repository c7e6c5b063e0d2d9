"""`golem publish`: a static site from study folders; each page opens from its file, without network or script."""

from __future__ import annotations

import io
import json
import re
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from tyro.conf import Positional

from golem.errors import ConfigError, OutputError
from golem.evaluation.base import case_name
from golem.evaluation.harness.records import TrialRecord, artefacts, trial_name
from golem.evaluation.harness.run_folder import read_facts
from golem.evaluation.metrics.results import trials_csv
from golem.evaluation.metrics.summary import NO_MODULE, metric, summarise
from golem.evaluation.metrics.tables import losses, metrics, number
from golem.evaluation.metrics.text_table import short_names
from golem.evaluation.report.svg_figure import render_page, style
from golem.evaluation.study.study_folder import CellResult, Study, read_study, refuse_mixed
from golem.output_file import write_file

PICTURES = (".png", ".jpg", ".jpeg")
FILMS = (".webp", ".gif")
SITE = "golem-site.json"
"""What tells a site from any other folder: only such a one, or an empty one, is written over."""


@dataclass(frozen=True)
class PublishConfig:
    """Write a static site that needs no server: leaderboards per cell, a page per method and per trial, the data."""

    folders: Positional[tuple[Path, ...]]
    """Folders of golem study, or of golem ladder, all of one state of the code."""
    out: Path = Path("site")
    """Folder for the site; a site that is there is replaced."""


def run_publish(config: PublishConfig) -> Path:
    """Write the site and return its first page.

    Raises:
        ConfigError: no folder is given, one holds no finished trials, or they are of different code.
        OutputError: a file is no trial record, a run writes to a folder, or the site cannot be written.
        MissingExtra: what makes pages is not installed.
    """
    if not config.folders:
        raise ConfigError("Name at least one folder of golem study or golem ladder.")
    studies = [read_study(folder) for folder in config.folders]
    refuse_mixed(studies)
    names = [study.name for study in studies]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ConfigError(f"Two of these studies are called '{twice}'; rename one of the folders.")
    _clear(config.out)
    write_file(config.out / "style.css", style())
    files = _data(studies, config.out)
    for study in studies:
        for cell in study.cells:
            for method in cell.methods:
                _method_page(study, cell, method, config.out)
    index = write_file(
        config.out / "index.html", _page(studies, lambda s, c, m: f"{s.name}/{c.name}/{_slug(c, m)}.html", files, "")
    )
    trials = sum(len(cell.records) for study in studies for cell in study.cells)
    print(f"Site: {index}, {trials} trials.")
    return index


def study_page(study: Study) -> str:
    """Return the report of a study as one page, which links to the reports of its ladders."""
    return _page([study], lambda _, cell, __: f"{cell.name}/report.html", {"trials.csv": "trials.csv"}, None)


def _page(studies: Sequence[Study], link: Any, files: dict[str, str], root: str | None) -> str:
    shown = [
        {
            "title": s.title,
            "about": s.about,
            "caption": s.caption().replace("`", ""),
            "command": s.command,
            "rates": s.rates(),
            "comparisons": s.comparisons(),
            "cells": [_board(s, cell, link) for cell in s.cells],
        }
        for s in studies
    ]
    first = studies[0].cells[0].records[0]
    facts = {
        "commit": first.commit,
        "code": first.code,
        "versions": ", ".join(f"{k} {v}" for k, v in first.versions.items()),
    }
    return render_page("study.html", facts, studies=shown, files=files, root=root)


def _board(study: Study, cell: CellResult, link: Any) -> dict[str, Any]:
    first, short, rows = cell.records[0], short_names(cell.methods), list[dict[str, Any]]()
    for method in cell.methods:
        won = [r.success for r in cell.of(method)]
        rate, interval = study.success(cell, method)
        lost = study.stages(cell, method)
        rows.append(
            {
                "name": short[method],
                "link": link(study, cell, method),
                "rate": round(100 * rate, 1),
                "low": round(100 * interval.low, 1),
                "width": round(100 * (interval.high - interval.low), 1),
                "text": f"{sum(won)} of {len(won)}",
                "lost": f"lost in {', '.join(f'{stage} {n}' for stage, n in lost.items())}" if lost else "",
            }
        )
    options = ", ".join(f"{k} {v}" for k, v in first.options.items() if v)
    search = " The next case follows from results, so the share of the trials says nothing." if cell.adaptive else ""
    says = f"Rung {first.rung}, profile {first.profile}, seed {first.seed}{', ' + options if options else ''}.{search}"
    return {"name": cell.name, "says": says, "methods": sorted(rows, key=lambda row: -row["rate"])}


def _slug(cell: CellResult, method: str) -> str:
    plain = re.sub(r"[^A-Za-z0-9_.-]", "_", short_names(cell.methods)[method])
    return f"{cell.methods.index(method)}-{plain[:40]}"


def _method_page(study: Study, cell: CellResult, method: str, out: Path) -> None:
    folder, rows = out / study.name / cell.name, cell.of(method)
    name, back, cases = short_names(cell.methods)[method], f"{_slug(cell, method)}.html", dict[str, list[Any]]()
    for r in rows:
        says = f"trial {r.index}: {'success' if r.success else f'lost in {r.stage}'}"
        square = {"link": f"trials/{trial_name(r)}.html", "won": r.success, "says": says}
        cases.setdefault(case_name(r.case), []).append(square)
    tables = [t for t in (losses(rows), metrics(summarise(rows, [method], compared=False), brief=True)) if t]
    common = {"study": study.title, "cell": cell.name}
    rate, interval = study.success(cell, method)
    says = f"{sum(r.success for r in rows)} of {len(rows)} trials won, {100 * rate:.1f} % {interval.text(100.0)}."
    page = render_page("method.html", {}, root="../../", name=name, says=says, cases=cases, tables=tables, **common)
    write_file(folder / back, page)
    around = [None, *(f"{trial_name(r)}.html" for r in rows), None]
    for i, r in enumerate(rows):
        seen = _trial(r, cell, folder / "trials")
        page = render_page(
            "trial.html", {"commit": r.commit, "configuration": r.config}, root="../../../", method=name, back=back,
            before=around[i], after=around[i + 2], **common, **seen,
        )  # fmt: skip
        write_file(folder / "trials" / f"{trial_name(r)}.html", page)


def _trial(r: TrialRecord, cell: CellResult, folder: Path) -> dict[str, Any]:
    """Return what is shown of a trial; its pictures and films are copied into `folder`."""
    kept = [path for path in sorted(artefacts(cell.folder, r).glob("*")) if path.suffix in (*PICTURES, *FILMS)]
    kept += [cell.folder / r.picture] if r.picture and (cell.folder / r.picture).is_file() else []
    names = [f"{trial_name(r)}-{path.name}" for path in kept]
    folder.mkdir(parents=True, exist_ok=True)
    for path, name in zip(kept, names, strict=True):
        shutil.copyfile(path, folder / name)
    longest = max(r.timings.values(), default=1.0) or 1.0
    case = case_name(r.case)
    return {
        "name": trial_name(r),
        "title": f"Trial {r.index}{', ' + case if case else ''}",
        "won": r.success,
        "stage": r.stage,
        "module": r.module or NO_MODULE,
        "detail": r.detail,
        "trace": r.trace,
        "films": [name for name in names if name.endswith(FILMS)],
        "pictures": [name for name in names if name.endswith(PICTURES)],
        "times": [
            {"name": metric(name).label, "share": round(100 * t / longest, 1), "text": f"{t:.1f} s"}
            for name, t in sorted(r.timings.items(), key=lambda item: item[1])
        ],
        "figures": {metric(k).label: f"{number(value, metric(k))} {metric(k).unit}" for k, value in r.series.items()},
        "command": f"{read_facts(cell.folder).get('command', '')} --show {trial_name(r)}",
    }


def _data(studies: Sequence[Study], out: Path) -> dict[str, str]:
    """Write the data of every trial, the tables for a paper and what to cite; return them by name."""
    text = trials_csv([r for study in studies for cell in study.cells for r in cell.records])
    write_file(out / "data" / "trials.csv", text)
    files = {"trials.csv": "data/trials.csv"}
    try:
        from pyarrow import csv, parquet  # pyright: ignore[reportMissingImports]

        lines = csv.ParseOptions(newlines_in_values=True)  # a module's reason may have several
        table = csv.read_csv(io.BytesIO(text.encode()), parse_options=lines)
        parquet.write_table(table, out / "data" / "trials.parquet")
        files["trials.parquet"] = "data/trials.parquet"
    except ImportError:
        print("The site has no Parquet file: pyarrow is not installed; pip install pyarrow.")
    tex = "\n\n".join(f"% {s.title}. {s.caption()}\n% {s.command}\n{s.rates().latex()}" for s in studies)
    write_file(out / "data" / "tables.tex", tex + "\n")
    bib = resources.files("golem.evaluation.report").joinpath("golem.bib").read_text(encoding="utf-8")
    write_file(out / "data" / "golem.bib", bib.replace("COMMIT", studies[0].commit))
    return {**files, "tables.tex": "data/tables.tex", "golem.bib": "data/golem.bib"}


def _clear(out: Path) -> None:
    """Take an earlier site away; refuse any other folder that is not empty."""
    try:
        if out.is_dir() and any(out.iterdir()):
            if not (out / SITE).is_file():
                raise OutputError(f"{out} holds something else than a site of golem publish; choose another --out.")
            shutil.rmtree(out)
        write_file(out / SITE, json.dumps({"made by": "golem publish"}) + "\n")
    except OSError as error:
        raise OutputError(f"Cannot write to --out {out}: {error.strerror}; choose another.") from error
