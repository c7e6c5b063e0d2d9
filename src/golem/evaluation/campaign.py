"""Many jobs in parallel, each kept as one line of JSON when it is done, so that an interrupted command continues."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

from tqdm import tqdm

from golem.errors import ConfigError, GolemError, OutputError
from golem.evaluation.harness.pool import Workers
from golem.evaluation.harness.records import RunFolder, append_line, whole_lines
from golem.provenance import Unchanged, code_digest, commit, digest, versions

Result = dict[str, Any]
"""What a job found: JSON-like."""


class Job(Protocol):
    """A frozen dataclass of JSON-like values that says all about one piece of work, and does it."""

    def run(self) -> Result:
        """Return what was found; depends on the job alone."""
        ...


@dataclass(frozen=True, slots=True)
class Done:
    """A finished job and its result."""

    job: Job
    result: Result


class CampaignInterrupted(KeyboardInterrupt):
    """The user pressed Ctrl-C; the message says how to go on. What had finished is kept."""


def run_campaign(
    out: Path,
    jobs: Iterable[Job],
    processes: int,
    then: Callable[[Job, Result], Iterable[Job]] = lambda job, result: (),
) -> list[Done]:
    """Run jobs that `out` does not hold yet, and those that follow from them.

    Args:
        out: folder for `jobs.jsonl`.
        jobs: the first jobs.
        processes: how many to run at the same time; results do not depend on it.
        then: the jobs that follow from a finished one.

    Returns:
        The finished jobs, those that were asked for first; their order does not depend on `processes`.

    Raises:
        golem.errors.OutputError: the folder cannot be written, or holds results of other code or packages.
        golem.errors.GolemError: a job cannot run, or a process died.
        CampaignInterrupted: Ctrl-C.
    """
    if processes < 1:
        raise ConfigError(f"-j is {processes}; it must be 1 or more.")
    # The commit of the beginning: somebody may commit while this runs.
    code = Unchanged()
    run, made = {"code": code_digest(), "versions": versions()}, commit()
    with RunFolder(out) as folder:
        path = folder.path / "jobs.jsonl"
        with _written(out):
            held = _held(path, run)
        found: dict[str, Done] = {}
        workers: Workers[Job, Result] = Workers(processes)
        with workers, tqdm(unit="job", disable=None) as progress:

            def ask(new: Iterable[Job]) -> None:
                for job in new:
                    if _key(job) in held:
                        take(job, held[_key(job)])
                    else:
                        workers.submit(job, _run, job)

            def take(job: Job, result: Result) -> None:
                found[_key(job)] = Done(job, result)
                progress.update()
                ask(then(job, result))

            try:
                ask(jobs)
                for job, result in workers.finished():
                    if _REFUSED in result:
                        raise GolemError(result[_REFUSED])
                    code.check(out)
                    line = {"job": _named(job), "result": result, "commit": made, **run}
                    with _written(out):
                        append_line(path, json.dumps(line, separators=(",", ":"), allow_nan=False) + "\n")
                    take(job, result)
            except KeyboardInterrupt:
                raise CampaignInterrupted(
                    f"Stopped with {len(found)} jobs kept in {out}; give the same command again to continue."
                ) from None
    return [found[key] for key in sorted(found)]


def write_files(out: Path, files: Mapping[str, str]) -> None:
    """Write text files into `out`, each whole or not at all.

    Raises:
        golem.errors.OutputError: the folder cannot be written.
    """
    with RunFolder(out) as folder:
        for name, text in files.items():
            folder.write_text(name, text)


@contextmanager
def _written(out: Path) -> Generator[None, None, None]:
    """Say in one sentence that `out` cannot be read or written."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"Cannot write to {out}: {error.strerror}.") from error


_REFUSED = "refused"


def _run(job: Job) -> Result:
    try:
        return job.run()
    except GolemError as error:
        return {_REFUSED: str(error)}


def _named(job: Job) -> dict[str, Any]:
    return {"kind": type(job).__name__, **asdict(job)}  # type: ignore[call-overload]


def _key(job: Job) -> str:
    return json.dumps(_named(job), sort_keys=True)


def _held(path: Path, run: Mapping[str, Any]) -> dict[str, Result]:
    """Return the results that `path` holds, by key, and cut off a torn last line."""
    if not path.exists():
        return {}
    text = path.read_bytes()
    os.truncate(path, whole_lines(text))
    held: dict[str, Result] = {}
    for number, line in enumerate(text[: whole_lines(text)].splitlines(), start=1):
        try:
            entry = json.loads(line)
            same = digest({name: entry[name] for name in run}) == digest(run)
            held[json.dumps(entry["job"], sort_keys=True)] = entry["result"]
        except (ValueError, KeyError, TypeError) as error:
            raise OutputError(f"Line {number} of {path} is no finished job; choose another --out.") from error
        if not same:
            raise OutputError(
                f"{path} holds results of other code or packages, which cannot be mixed; choose another --out."
            )
    return held
