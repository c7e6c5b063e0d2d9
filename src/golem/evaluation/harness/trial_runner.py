"""Runs every trial that a rung asks for, on whichever executor, and keeps each as it finishes."""

from __future__ import annotations

import itertools
import os
import sys
import time
from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, replace
from typing import Any

from tqdm import tqdm

from golem.errors import GolemError
from golem.evaluation.base import Case, Key, Rung, TrialOutcome, TrialSpec, case_name
from golem.evaluation.harness.records import Provenance, TrialRecord
from golem.evaluation.harness.run_folder import Finished, RunFolder
from golem.evaluation.harness.trial_executor import TrialExecutor
from golem.evaluation.harness.trials import Batch, Died, Ending, Refused
from golem.evaluation.metrics.sequential import StopRule
from golem.provenance import Unchanged

PERIOD = 30.0
"""Time between two lines [s]."""


class Progress(AbstractContextManager["Progress", None]):
    """Shows on stderr how many trials are done."""

    def __init__(self, kept: int) -> None:
        """Begin with `kept` trials of an earlier run."""
        self._terminal = _has_width()
        self._bar: Any = tqdm(initial=kept, unit="trial", disable=not self._terminal)
        self._done, self._lost, self._began, self._here = kept, 0, time.monotonic(), 0
        self._next = self._began

    def expect(self, total: int) -> None:
        """Say how many trials there will be, as far as is known."""
        self._bar.total = total
        self._bar.refresh()

    def step(self, success: bool) -> None:
        """Count one more finished trial."""
        self._done, self._here, self._lost = self._done + 1, self._here + 1, self._lost + (not success)
        self._bar.update()
        self._bar.set_postfix(lost=self._lost, refresh=False)
        now, total = time.monotonic(), int(self._bar.total or 0)
        if not self._terminal and (now >= self._next or self._done == total):
            self._next = now + PERIOD
            left = (now - self._began) / self._here * (total - self._done)
            self.say(f"{self._done} of {total} trials, {self._lost} lost, about {left:.0f} s left")

    def say(self, text: str) -> None:
        """Print lines without tearing the bar apart."""
        tqdm.write(text, file=sys.stderr)
        sys.stderr.flush()

    def __exit__(self, *_: object) -> None:
        self._bar.close()


def _has_width() -> bool:
    """Return whether stderr is a terminal with room for a bar; one of `script` or of a container may have none."""
    with suppress(OSError):
        return os.get_terminal_size(2).columns > 0
    return False


ATTEMPTS = 3
"""A trial is lost when its process has died so often."""
CRASH = "crash"
"""Stage of a trial whose process died."""
TIMEOUT = "timeout"
"""Stage of a trial that outlasted its limit."""


@dataclass(frozen=True, slots=True)
class Request:
    """What a run is of.

    Attributes:
        rung: made with its options.
        target: its `module:Class`.
        n: trials per method and case.
        example: a trial, of which method, index and case are to be replaced.
        limit: time that a batch may take, see `LadderConfig` [s].
        stop: by which comparisons are ended that are decided; None runs all `n`.
        ahead: trials of a method that are asked for at once where the next may not be needed.
        only: the trials that are wanted; None is all.
    """

    rung: Rung[Any]
    target: str
    methods: tuple[str, ...]
    n: int
    example: TrialSpec
    limit: float
    stop: StopRule | None = None
    ahead: int = 8
    only: frozenset[Key] | None = None

    def spec(self, method: str, index: int, case: Case) -> TrialSpec:
        """Return one trial."""
        return replace(self.example, method=method, index=index, case=case)

    def results(self, method: str, case: Case, found: Mapping[Key, TrialOutcome]) -> list[TrialOutcome] | None:
        """Return the outcomes of one case in the order of indices; None until all are among `found`."""
        keys = [(method, case_name(case), index) for index in range(self.n)]
        return [found[key] for key in keys] if all(key in found for key in keys) else None

    def complete(self, specs: Sequence[TrialSpec], found: Mapping[Key, TrialOutcome]) -> bool:
        """Return whether the case of any of `specs` is."""
        return any(self.results(spec.method, spec.case, found) is not None for spec in specs)

    def wanted(self, found: Mapping[Key, TrialOutcome]) -> list[TrialSpec]:
        """Return every trial that the rung asks for, given what was `found` so far, in the order to run them."""
        asked = {
            method: self.rung.cases(lambda case, method=method: self.results(method, case, found))
            for method in self.methods
        }
        ends = {} if self.stop is None else self._ends(self.stop, asked, found)
        specs = [
            self.spec(method, index, cases[number])
            for index in range(self.n)
            for number in range(max(len(cases) for cases in asked.values()))
            for method, cases in asked.items()
            if number < len(cases) and index < ends.get((method, case_name(cases[number])), self.n)
        ]
        return [spec for spec in specs if self.only is None or spec.key in self.only]

    def _ends(
        self, stop: StopRule, asked: Mapping[str, Sequence[Case]], found: Mapping[Key, TrialOutcome]
    ) -> dict[tuple[str, str], int]:
        """Return how many trials each method is to have under each case, by its trials 0, 1, ... without a gap.

        So it does not depend on the order in which trials finish.
        """
        ends: dict[tuple[str, str], int] = {}
        for name in dict.fromkeys(case_name(case) for cases in asked.values() for case in cases):
            there: dict[str, list[TrialOutcome]] = {}
            for method, cases in asked.items():
                if any(case_name(case) == name for case in cases):
                    keys = itertools.takewhile(found.__contains__, ((method, name, i) for i in range(self.n)))
                    there[method] = [found[key] for key in keys]
            wanted = stop.ends({method: stop.values(trials) for method, trials in there.items()}, self.n, self.ahead)
            ends |= {(method, name): end for method, end in wanted.items()}
        return ends


class Runner:
    """Runs one request into one folder."""

    def __init__(
        self, request: Request, provenance: Provenance, folder: RunFolder, executor: TrialExecutor, command: str
    ) -> None:
        """Prepare; nothing is run and nothing written before `run`. `command` is the one that continues the run."""
        self._request, self._provenance, self._folder = request, provenance, folder
        self._executor, self._command = executor, command
        self._code = Unchanged()
        self.records: list[TrialRecord] = []
        self._found: dict[Key, TrialOutcome] = {}
        self._asked: set[Key] = set()
        self._deaths: Counter[Key] = Counter()
        self._explained: set[tuple[str | None, str]] = set()

    def run(self, held: Sequence[TrialRecord]) -> list[TrialRecord]:
        """Run what is wanted and not among `held`; return the records of all.

        Raises golem.errors.GolemError: the rung refuses, or nothing can run any more; finished trials are kept.
        """
        records = self.records = list(held)
        self._found = {record.key: record.outcome for record in held}
        wanted = self._request.wanted(self._found)
        with Progress(sum(spec.key in self._found for spec in wanted)) as progress:
            progress.expect(len(wanted))
            self._submit(wanted)
            for batch, ending in self._executor.results():
                for spec, finished in self._settled(batch, ending):
                    self._code.check(self._folder.path)
                    record = self._provenance.record(spec, finished.outcome)
                    if not records:
                        self._folder.state(self._command, self._provenance)
                    self._folder.append(record, finished)
                    records.append(record)
                    self._found[record.key] = record.outcome
                    progress.step(record.success)
                    self._explain(record, progress)
                stop = self._request.stop is not None
                if stop or self._request.rung.adaptive and self._request.complete(batch.specs, self._found):
                    wanted = self._request.wanted(self._found)
                    progress.expect(len(wanted))
                    if stop and all(spec.key in self._found for spec in wanted):
                        break  # what still runs is beyond the decision
                    self._submit(wanted)
        return records

    def _submit(self, wanted: Sequence[TrialSpec]) -> None:
        """Submit what is neither found nor asked for yet, trials that belong together in one batch."""
        groups: dict[Hashable, list[TrialSpec]] = {}
        for spec in wanted:
            if spec.key not in self._found and spec.key not in self._asked:
                self._asked.add(spec.key)
                groups.setdefault(self._request.rung.together(spec), []).append(spec)
        p, request = self._provenance, self._request
        for specs in groups.values():
            self._executor.submit(Batch(request.target, tuple(specs), request.limit, p.configs, p.code, p.versions))

    def _settled(self, batch: Batch, ending: Ending) -> Iterable[tuple[TrialSpec, Finished]]:
        """Return the trials of a batch that came to an outcome; what did not is run again, each by itself."""
        if isinstance(ending, Refused):
            raise _refusal(ending)
        if isinstance(ending, tuple):
            return zip(batch.specs, ending, strict=True)
        spec, *others = batch.specs
        if others:
            for single in batch.split():
                self._executor.submit(single)
            return ()
        if isinstance(ending, Died):
            self._deaths[spec.key] += 1
            if ending.again and self._deaths[spec.key] < ATTEMPTS:
                self._executor.submit(batch)
                return ()
            detail = f"Its process died {ATTEMPTS if ending.again else 'several'} times: {ending.how}."
            outcome = TrialOutcome(False, CRASH, None, detail, trace=ending.trace)
        else:
            place = f", in {ending.place}" if ending.place else ""
            detail = f"It took longer than {batch.limit:g} s of computing and sleeping (--limit){place}."
            outcome = TrialOutcome(False, TIMEOUT, ending.module, detail, trace=ending.trace)
        return ((spec, Finished(outcome, batch.limit, 0.0)),)

    def _explain(self, record: TrialRecord, progress: Progress) -> None:
        """Print where a module failed, once per module and way of failing."""
        what = record.module, record.stage
        if record.trace is None or what in self._explained:
            return
        self._explained.add(what)
        who = record.module or "no module to blame"
        progress.say(
            f"\nTrial {record.index} of {record.method}: {record.stage}, {who}: {record.detail}\n{record.trace}"
        )


def _refusal(ending: Refused) -> Exception:
    if ending.trace is None:
        return GolemError(ending.message)
    return RuntimeError(f"The rung itself failed, which is a fault of its code, not of a module.\n{ending.trace}")
