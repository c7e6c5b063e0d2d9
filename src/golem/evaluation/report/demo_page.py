"""The one-page report of a demonstration."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.evaluation.report.margin_plot import margin_plot
from golem.evaluation.report.svg_figure import render_page, styled
from golem.robots.mujoco.balance import BalanceTrace


@dataclass(frozen=True)
class PickRecord:
    """One pick of a demonstration.

    Attributes:
        success: whether a further screw lies in the tray, by the simulator's truth.
        screw: the screw that came into the tray, or None.
        start, seconds: when it began and how long it took, in robot time [s].
        stages: each stage with its duration [s].
    """

    success: bool
    screw: str | None
    stage: str
    reason: str
    start: float
    seconds: float
    stages: list[tuple[str, float]] = field(default_factory=list)


def demo_page(
    lead: str,
    picks: Sequence[PickRecord],
    picture: NDArray[np.uint8] | None,
    films: Sequence[str],
    poster: NDArray[np.uint8] | None,
    facts: Mapping[str, str],
    balance: Sequence[tuple[str, str, str]],
) -> str:
    """Return the report as HTML that needs no other file but the films.

    Args:
        lead: what happened, in a sentence.
        picks: one row each.
        picture: (height, width, 3) RGB, or None.
        films: names of the films in the folder of the report.
        poster: (height, width, 3) RGB that stands for the film until it is played, or None.
        facts: provenance, the command among it.
        balance: see `balance_section`; empty for a robot that hung.

    Raises:
        golem.errors.MissingExtra: what draws it is not installed.
    """
    stages = list(dict.fromkeys(name for pick in picks for name, _ in pick.stages if name != "done"))
    return render_page(
        "demo.html",
        dict(facts),
        lead=lead,
        stages=stages,
        picks=[_row(pick, stages) for pick in picks],
        picture=_jpeg(picture),
        films=films,
        video=next((name for name in films if name.endswith(".mp4")), None),
        webp=next((name for name in films if name.endswith(".webp")), None),
        poster=_jpeg(poster),
        balance=balance,
    )


def _row(pick: PickRecord, stages: Sequence[str]) -> dict[str, object]:
    spent = [sum(seconds for stage, seconds in pick.stages if stage == name) for name in stages]
    return {
        "success": pick.success,
        "says": f"{pick.screw} in the tray" if pick.success else f"lost in {pick.stage}",
        "reason": pick.reason,
        "spent": [f"{seconds:.1f}" if seconds else "-" for seconds in spent],
        "total": f"{pick.seconds:.1f}",
    }


def _jpeg(picture: NDArray[np.uint8] | None) -> str | None:
    if picture is None:
        return None
    jpeg = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 90])[1]
    return base64.b64encode(jpeg.tobytes()).decode()


def balance_figures(trace: BalanceTrace, pushed_at: float | None) -> dict[str, float]:
    """Return how the robot balanced at work, and after the push that began at `pushed_at` [s] if there was one.

    Returns:
        SI units: minimum CoM margin, horizontal range of the base and steps; with the prefix `push_` after the push.
    """
    work = trace.window(-math.inf, math.inf if pushed_at is None else pushed_at)
    figures = {"margin_min": float(work.margin.min()), "base_range": work.base_range, "steps": work.steps}
    if pushed_at is not None:
        after = trace.window(pushed_at)
        figures |= {
            "push_margin_min": float(after.margin.min()),
            "push_margin_final": after.final_margin,
            "push_steps": after.steps,
        }
    return {name: round(value, 4) for name, value in figures.items()}


def balance_section(
    trace: BalanceTrace, pushed_at: float | None, figures: Mapping[str, float]
) -> list[tuple[str, str, str]]:
    """Return title, words and plot of each part of the section on balance, with the `figures` of `balance_figures`.

    Raises golem.errors.MissingExtra: what draws it is not installed.
    """
    work = trace.window(-math.inf, math.inf if pushed_at is None else pushed_at)
    steps = f"{figures['steps']:.0f} step{'' if figures['steps'] == 1 else 's'}"
    words = (
        f"At work the projected centre of mass stayed {1e3 * figures['margin_min']:.0f} mm or more inside the edge of "
        f"the support polygon; the pelvis moved within {1e3 * figures['base_range']:.0f} mm; {steps}."
    )
    with styled():
        parts = [("", words, margin_plot([(work, True)], 0))]
        if pushed_at is not None:
            words = (
                f"Minimum margin {1e3 * figures['push_margin_min']:.0f} mm: during a step the polygon is one foot. "
                f"{figures['push_steps']:.0f} steps; {1e3 * figures['push_margin_final']:.0f} mm at the end."
            )
            after = trace.window(pushed_at - 1.0)
            parts.append(("A push at the end", words, margin_plot([(after, True)], 1)))
    return parts
