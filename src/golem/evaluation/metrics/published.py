"""The published results that a rung's report compares with its own."""

from __future__ import annotations

from dataclasses import dataclass

from golem.package_data import load_data


@dataclass(frozen=True, slots=True)
class PaperFigure:
    """One success rate of the GOLEM paper.

    Attributes:
        label: task and environment, e.g. `"screw, real robot"`.
        successes, n: trials.
        time: published time in words, where there is one.
    """

    label: str
    successes: int
    n: int = 30
    time: str = ""


GGX_F = "{use: reranked, proposer: {use: graspgen}}"
"""The method that the paper calls GGX-F."""


def _paper() -> dict[tuple[str, str], tuple[PaperFigure, ...]]:
    found: dict[tuple[str, str], tuple[PaperFigure, ...]] = {}
    for row in load_data(__package__, "published.yaml"):
        rung, method = row.pop("rung"), row.pop("method")
        key = rung, GGX_F if method == "GGX-F" else method
        found[key] = (*found.get(key, ()), PaperFigure(**row))
    return found


PAPER = _paper()
"""(rung, method) -> published figures."""
