"""Which labels a query names: the label itself, a common word for it, or a phrase that holds one of these."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache

from golem.package_data import load_data

SYNONYMS: dict[str, list[str]] = load_data(__package__, "synonyms.yaml")
"""Label -> other words for it."""
SAME, SYNONYM, WITHIN = 1.0, 0.9, 0.7
"""Scores of a query that is the label, another word for it, or a phrase with one of both in it."""


@lru_cache(maxsize=4096)
def _normal(text: str) -> str:
    words = re.findall(r"[^\W_]+", text.casefold())
    return " ".join(word[:-1] if len(word) > 3 and word.endswith("s") and word[-2] != "s" else word for word in words)


def label_scores(text: str, labels: Iterable[str]) -> dict[str, float]:
    """Return how well each of `labels` answers to `text`, above 0 only.

    A phrase is answered by the longest of the words in it that any label knows: "screw hole" is no screw.
    """
    asked = _normal(text)
    found: dict[str, tuple[float, int]] = {}
    for label in labels:
        for score, word in ((SAME, label), *((SYNONYM, other) for other in SYNONYMS.get(label, ()))):
            known = _normal(word)
            if not known:
                continue
            if known == asked:
                found[label] = max(found.get(label, (0.0, 0)), (score, len(known)))
            elif f" {known} " in f" {asked} ":
                found[label] = max(found.get(label, (0.0, 0)), (WITHIN * score, len(known)))
    if not found:
        return {}
    longest = max(length for _, length in found.values())
    return {label: score for label, (score, length) in found.items() if length == longest}
