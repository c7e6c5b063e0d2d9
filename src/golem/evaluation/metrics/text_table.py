"""One table of text, as terminal, page and document show it."""

from __future__ import annotations

import itertools
import re
import textwrap
from collections.abc import Iterable
from dataclasses import dataclass

NARROW = 10
"""No column of a terminal is made narrower [characters]."""
_LATEX = {c: rf"\{c}" for c in "&%$#_{}"} | {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\^{}"}
_LATEX |= {"<": r"$<$", ">": r"$>$", "\N{MINUS SIGN}": "$-$"}
_FIGURE = re.compile(r"-|([<>=]+ )?[\[+-]*\d.*")


@dataclass(frozen=True, slots=True)
class TextTable:
    """A table whose cells are words."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    @property
    def figures(self) -> tuple[bool, ...]:
        """Whether each column is of figures only, which are set flush right; without rows none is."""
        if not self.rows:
            return (False,) * len(self.columns)
        return tuple(all(_FIGURE.fullmatch(cell) for cell in column) for column in zip(*self.rows, strict=True))

    def markdown(self) -> str:
        """Return the table in Markdown, padded so that it can be read as it is."""
        lines = [tuple(c.replace("|", "\\|").replace("\n", " ") for c in row) for row in (self.columns, *self.rows)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        figures = self.figures
        rule = tuple("-" * (w + 1) + (":" if right else "-") for w, right in zip(widths, figures, strict=True))
        padded = [
            " | ".join(c.rjust(w) if figure else c.ljust(w) for c, w, figure in zip(line, widths, figures, strict=True))
            for line in lines
        ]
        body = [f"| {padded[0]} |", f"|{'|'.join(rule)}|", *(f"| {line} |" for line in padded[1:])]
        parts = [f"**{self.title}**" if self.title else "", "\n".join(body), self.note]
        return "\n\n".join(part for part in parts if part)

    def terminal(self, width: int = 100) -> str:
        """Return the table for a terminal of `width` characters: columns of words are broken into lines to fit."""
        lines = [self.columns, *self.rows]
        widths = [max(len(line[i]) for line in lines) for i in range(len(self.columns))]
        while sum(widths) + 2 * (len(widths) - 1) > width and max(widths) > NARROW:
            widths[widths.index(max(widths))] -= 1
        body = list[str]()
        for line in lines:
            cells = [textwrap.wrap(cell, w) or [""] for cell, w in zip(line, widths, strict=True)]
            for parts in itertools.zip_longest(*cells, fillvalue=""):
                aligned = zip(parts, widths, self.figures, strict=True)
                words = (part.rjust(w) if figure else part.ljust(w) for part, w, figure in aligned)
                body.append("  ".join(words).rstrip())
            if line is self.columns:
                body.append("  ".join("-" * w for w in widths))
        parts = [self.title, "\n".join(body), textwrap.fill(self.note, width)]
        return "\n".join(part for part in parts if part)

    def latex(self) -> str:
        """Return the table in LaTeX, for the package booktabs; title and note are its caption."""
        of = "".join("r" if figure else "l" for figure in self.figures)
        head, *rows = (" & ".join(map(_latex, line)) + r" \\" for line in (self.columns, *self.rows))
        caption = _latex(" ".join(filter(None, (self.title and f"{self.title}.", self.note))))
        lines = [
            r"\begin{table}",
            r"\centering",
            rf"\caption{{{caption}}}" if caption else "",
            rf"\begin{{tabular}}{{{of}}}",
        ]
        lines += [r"\toprule", head, r"\midrule", *rows, r"\bottomrule", r"\end{tabular}", r"\end{table}"]
        return "\n".join(line for line in lines if line)


def short_names(methods: Iterable[str]) -> dict[str, str]:
    """Return methods by short names: files without their folders, where that tells them apart."""
    short = {
        method: method if method.startswith("{") else ":".join(part.rpartition("/")[2] for part in method.split(":"))
        for method in methods
    }
    taken = list(short.values())
    return {method: name if taken.count(name) == 1 else method for method, name in short.items()}


def _latex(text: str) -> str:
    return "".join(_LATEX.get(c, c) for c in text)
