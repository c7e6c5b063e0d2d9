"""Held-out figures: average precision by centre match and centre error, per class and camera."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from golem.evaluation.metrics.coco import average_precision
from golem.figures import blank_figure
from golem.training.detector.dataset import CONDITIONS, Labelled
from golem.training.detector.labels import CLASSES
from golem.types import Array, Detection

SIZE = (1000, 420)
"""Width and height [px]."""


def draw_curve(curve: Path, out: Path) -> None:
    """Draw average precision over crops seen, per class and camera. Raises MissingExtra: without matplotlib."""
    rows = np.genfromtxt(curve, delimiter=",", names=True, deletechars="")
    columns = [name.split("_", 2)[1:] for name in rows.dtype.names or () if name.startswith("ap_")]
    cameras = list(dict.fromkeys(camera for camera, _ in columns))
    figure = blank_figure(*SIZE)
    panels = figure.subplots(1, len(cameras), sharey=True, squeeze=False)[0]
    for camera, axes in zip(cameras, panels, strict=True):
        for label in (label for one, label in columns if one == camera):
            axes.plot(rows["images"] / 1000, rows[f"ap_{camera}_{label}"], ".-", label=label)
        axes.set(ylim=(0.0, 1.0), xlabel="training crops [thousands]", title=camera)
        axes.grid(color="#dddddd")
    panels[0].set(ylabel="AP on images that are set apart")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper", frameon=False)
    figure.savefig(out)


MATCH_FLOOR = 4.0
"""A centre matches within half the shorter side of the true box, or within this [px], whichever is more."""
THRESHOLD, WORKING = 0.05, 0.3
"""Least score of a detection at all, and of those whose recall, precision and error are told."""
BY_CONDITION = (("head", "screw"), ("palm", "screw"), ("head", "tray"))
"""Camera and class of the figures that are told for each condition."""

Detector = Callable[[NDArray[np.uint8]], list[Detection]]


@dataclass(frozen=True, slots=True)
class Score:
    """Figures of one class in one camera.

    Attributes:
        count: labelled parts.
        ap: average precision (area under the precision-recall curve, all points).
        recall: share found at a score of `WORKING` or more.
        precision: share of those detections that are right.
        error: median distance of the matched centres at that score [px].
        error_p95: 95th percentile of it [px].
    """

    count: int
    ap: float
    recall: float
    precision: float
    error: float
    error_p95: float


def evaluate(
    data: Sequence[Labelled], detect: Detector, classes: Sequence[str] = CLASSES
) -> dict[tuple[str, str], Score]:
    """Return the figures by (camera, class).

    Args:
        data: held-out images.
        detect: image RGB to detections of all classes at scores from `THRESHOLD`.
        classes: of the labels, in their order.
    """
    hits: dict[tuple[str, str], list[tuple[float, bool, float]]] = {}
    counts: dict[tuple[str, str], int] = {}
    for image, labels, camera, _ in data:
        found = detect(image)
        for kind, label in enumerate(classes):
            key = (camera, label)
            truth = labels[labels[:, 0] == kind]
            counts[key] = counts.get(key, 0) + int((truth[:, 7] == 0).sum())
            hits.setdefault(key, []).extend(_match([d for d in found if d.label == label], truth))
    return {key: _score(hits[key], counts[key]) for key in sorted(counts)}


def false_alarms(data: Sequence[Labelled], detect: Detector, classes: Sequence[str]) -> float:
    """Return how many detections of `classes` an image has on average where there are no such things."""
    count = sum(d.label in classes and d.score >= WORKING for one in data for d in detect(one.image))
    return count / max(len(data), 1)


def _match(found: list[Detection], truth: Array) -> list[tuple[float, bool, float]]:
    """Assign each detection, best first, to the nearest free label; those on ignored labels do not count."""
    taken = np.zeros(len(truth), bool)
    out: list[tuple[float, bool, float]] = []
    ignored = truth[truth[:, 7] == 1]
    sides = (truth[:, 5:7] - truth[:, 3:5]).min(axis=1) if len(truth) else np.zeros(0)
    reach = np.maximum(sides / 2, MATCH_FLOOR)
    for detection in found:
        distance = np.linalg.norm(truth[:, 1:3] - detection.center, axis=1)
        near = distance <= reach
        free = near & ~taken & (truth[:, 7] == 0)
        if free.any():
            best = int(np.argmin(np.where(free, distance, np.inf)))
            taken[best] = True
            out.append((detection.score, True, float(distance[best])))
        elif not _lies_on(detection.center, ignored):
            out.append((detection.score, False, 0.0))
    return out


def _lies_on(center: Array, labels: Array) -> bool:
    return bool(((labels[:, 3:5] - MATCH_FLOOR <= center) & (center <= labels[:, 5:7] + MATCH_FLOOR)).all(axis=1).any())


def _score(hits: list[tuple[float, bool, float]], count: int) -> Score:
    hits = sorted(hits, reverse=True)
    working = [h for h in hits if h[0] >= WORKING]
    right = [h[2] for h in working if h[1]]
    return Score(
        count=count,
        ap=average_precision([h[1] for h in hits], count),
        recall=len(right) / max(count, 1),
        precision=len(right) / max(len(working), 1),
        error=float(np.median(right)) if right else float("nan"),
        error_p95=float(np.percentile(right, 95)) if right else float("nan"),
    )


def condition_table(data: Sequence[Labelled], detect: Detector) -> str:
    """Return the mean AP of classes and cameras, and that of `BY_CONDITION`, for each value of each condition."""
    columns = " | ".join(f"{label}, {camera}" for camera, label in BY_CONDITION)
    lines = [f"| condition | value | images | mean AP | {columns} |", "|---" * (4 + len(BY_CONDITION)) + "|"]
    for name in CONDITIONS:
        for value in sorted({one.conditions[name] for one in data}):
            chosen = [one for one in data if one.conditions[name] == value]
            scores = evaluate(chosen, detect)
            found = {key: s.ap for key, s in scores.items() if s.count}
            mean = f"{np.mean(list(found.values())):.3f}"
            single = " | ".join(f"{found[key]:.3f}" if key in found else "none" for key in BY_CONDITION)
            lines.append(f"| {name} | {value} | {len(chosen)} | {mean} | {single} |")
    return "\n".join(lines)


def table(scores: dict[tuple[str, str], Score], classes: Sequence[str] | None = None) -> str:
    """Return the figures as a Markdown table; those of all classes if `classes` is absent."""
    lines = [
        "| camera | class | parts | AP | recall | precision | median error px | p95 error px |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for (camera, label), s in scores.items():
        if classes is None or label in classes:
            lines.append(
                f"| {camera} | {label} | {s.count} | {s.ap:.3f} | {s.recall:.3f} | {s.precision:.3f} "
                f"| {s.error:.2f} | {s.error_p95:.2f} |"
            )
    return "\n".join(lines)
