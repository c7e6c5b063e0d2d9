"""The one-page report of a demonstration."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from importlib import resources

import cv2
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class PickRecord:
    """One pick of a demonstration.

    Attributes:
        success: whether a further screw lies in the tray, by the simulator's truth.
        screw: the screw that came into the tray, or None.
        stage: where the skill ended.
        reason: what the skill said at its end.
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


def render_page(
    lead: str, picks: Sequence[PickRecord], picture: NDArray[np.uint8] | None, films: Sequence[str],
    facts: dict[str, str], balance: str = "",
) -> str:  # fmt: skip
    """Return the report as HTML that needs no other file but the films.

    Args:
        lead: what happened, in a sentence.
        picks: one row each.
        picture: (height, width, 3) RGB, or None.
        films: names of the films beside the report.
        facts: provenance.
        balance: HTML of the section on how the robot balanced; empty for one that hung.
    """
    body = [
        f'<header><p class="kicker">GOLEM demonstration</p><h1>Loosened screws, pulled from the pack</h1>'
        f'<p class="lead">{escape(lead)}</p></header>'
    ]
    if picture is not None:
        jpeg = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 90])[1]
        data = base64.b64encode(jpeg.tobytes()).decode()
        body.append(
            f'<figure><img alt="The robot pulls a screw." src="data:image/jpeg;base64,{data}"></figure>'
        )
    body.append(f'<h2>Picks</h2><section class="card"><div class="scroll">{_table(picks)}</div></section>')
    body.append(balance)
    if films:
        shown = next((name for name in films if name.endswith(".mp4")), None)
        still = next((name for name in films if name.endswith(".gif")), None)
        inner = f'<img alt="film" src="{escape(still)}">' if still else ""
        if shown:
            inner = f'<video controls muted loop style="width:100%" src="{escape(shown)}">{inner}</video>'
        links = ", ".join(f'<a href="{escape(name)}">{escape(name)}</a>' for name in films)
        body.append(f"<h2>Film</h2><figure>{inner}<figcaption>{links}</figcaption></figure>")
    rows = "".join(f"<dt>{escape(k)}</dt><dd>{escape(v)}</dd>" for k, v in facts.items())
    body.append(f"<h2>Provenance</h2><dl>{rows}</dl>")
    css = resources.files("golem.evaluation.report").joinpath("report.css").read_text(encoding="utf-8")
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f"<title>GOLEM demonstration</title>\n<style>\n{css}</style></head>\n"
        f"<body><main>\n{chr(10).join(body)}\n</main></body></html>\n"
    )


def _table(picks: Sequence[PickRecord]) -> str:
    names = list(dict.fromkeys(name for pick in picks for name, _ in pick.stages if name != "done"))
    head = "".join(f'<th class="num">{escape(name)}</th>' for name in names)
    rows = []
    for i, pick in enumerate(picks, 1):
        spent = {name: sum(s for stage, s in pick.stages if stage == name) for name in names}
        cells = "".join(
            f'<td class="num">{spent[name]:.1f}</td>' if spent[name] else '<td class="num">-</td>'
            for name in names
        )
        mark = "key-won" if pick.success else "key-lost"
        says = f"{pick.screw} in the tray" if pick.success else f"lost in {pick.stage}"
        rows.append(
            f'<tr><td>{i}</td><td><span class="swatch {mark}"></span>{escape(says)}'
            f"<small>{escape(pick.reason)}</small></td>{cells}"
            f'<td class="num"><b>{pick.seconds:.1f}</b></td></tr>'
        )
    return (
        f'<table><tr><th>pick</th><th>what happened</th>{head}<th class="num">total</th></tr>{"".join(rows)}</table>'
        '<p class="note">Seconds of robot time per stage.</p>'
    )
