"""One figure of success by condition: scripts/sweeps_figure.py OUT.png RUN... with runs of `golem ladder --sweep`."""

from __future__ import annotations

import sys
from collections import defaultdict
from pathlib import Path

from golem.evaluation.harness.records import read_records
from golem.evaluation.report.svg_figure import draw_share
from golem.figures import blank_figure

COLUMNS = 3


def counts(run: Path) -> tuple[str, dict[str, list[bool]]]:
    """Return the condition that a run swept, and by its values whether each trial succeeded."""
    found: dict[str, list[bool]] = defaultdict(list)
    condition = ""
    for record in read_records(run / "trials.jsonl"):
        ((condition, value),) = record.case.items()
        found[f"{value:.3g}" if isinstance(value, float) else str(value)].append(record.success)
    return condition, found


def main(out: Path, runs: list[Path]) -> None:
    """Draw a panel per run: shares with Wilson's 95 % intervals."""
    rows = -(-len(runs) // COLUMNS)
    figure = blank_figure(900, 190 * rows, facecolor="white")
    panels = figure.subplots(rows, COLUMNS, sharey=True, squeeze=False).ravel()
    for panel in panels[len(runs) :]:
        panel.set_axis_off()
    for panel, run in zip(panels, runs, strict=False):
        panel.grid(axis="y", alpha=0.3)
        condition, found = counts(run)
        for x, trials in enumerate(found.values()):
            draw_share(panel, x, sum(trials), len(trials), "C0")
        labels = [f"{name}\nn = {len(trials)}" for name, trials in found.items()]
        panel.set_xticks(range(len(found)), [label.replace("_", " ") for label in labels], fontsize=7)
        panel.set(title=condition.replace("_", " "), ylim=(0, 104))
    for panel in panels[::COLUMNS]:
        panel.set_ylabel("success [%]")
    figure.savefig(out)


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(one) for one in sys.argv[2:]])
