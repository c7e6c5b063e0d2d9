"""One table of text, as terminal, page and document show it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

_FIGURE = re.compile(r"-|([<>=]+ )?[\[+-]*\d.*")


@dataclass(frozen=True, slots=True)
class TextTable:
    """A table whose cells are words.

    Attributes:
        title: one line above it.
        columns: heads.
        rows: cells, as many as columns.
        note: one sentence below it.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    @property
    def figures(self) -> tuple[bool, ...]:
        """Whether each column is of figures only, which are set flush right; without rows none is."""
        if not self.rows:
            return (False,) * len(self.columns)
        return tuple(
            all(_FIGURE.fullmatch(cell) for cell in column) for column in zip(*self.rows, strict=True)
        )

    def markdown(self) -> str:
        """Return the table in Markdown, padded so that it can be read as it is."""
        lines = [tuple(_cell(cell) for cell in line) for line in (self.columns, *self.rows)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        figures = self.figures
        rule = tuple(
            "-" * (width + 1) + (":" if figure else "-")
            for width, figure in zip(widths, figures, strict=True)
        )
        padded = [
            " | ".join(
                cell.rjust(width) if figure else cell.ljust(width)
                for cell, width, figure in zip(line, widths, figures, strict=True)
            )
            for line in lines
        ]
        body = [f"| {padded[0]} |", f"|{'|'.join(rule)}|", *(f"| {line} |" for line in padded[1:])]
        parts = [f"**{self.title}**" if self.title else "", "\n".join(body), self.note]
        return "\n\n".join(part for part in parts if part)


def short_names(methods: Iterable[str]) -> dict[str, str]:
    """Return methods by short names: files without their folders, where that tells them apart."""
    short = {
        method: method
        if method.startswith("{")
        else ":".join(part.rpartition("/")[2] for part in method.split(":"))
        for method in methods
    }
    taken = list(short.values())
    return {method: name if taken.count(name) == 1 else method for method, name in short.items()}


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
