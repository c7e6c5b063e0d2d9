"""What an object memory knows of each object, as columns: a look at all of them is one vector operation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.types import Array

COLUMNS: tuple[str, ...] = (
    "x", "y", "z", "variance", "size", "belief", "first_seen", "last_seen", "gone_at", "looks", "evidence",
)  # fmt: skip
"""Position [m], variance of each of its coordinates [m^2], radius [m], log odds that it is there, times [s] with
`gone_at` infinite while it may be there, how many looks showed it, and the log odds that it ever was there, of
the looks that found and missed it until it was gone."""
PLACE = slice(0, 3)
VARIANCE, SIZE, BELIEF, FIRST, LAST, GONE, LOOKS, EVIDENCE = range(3, len(COLUMNS))


@dataclass(slots=True)
class ObjectRow:
    """One object: its number, its label and its values of `COLUMNS`."""

    number: int
    label: str
    values: Array


class ObjectRecords:
    """Objects by number, in rows that move when one is removed."""

    def __init__(self) -> None:
        """Begin with none."""
        self._values: Array = np.empty((16, len(COLUMNS)), order="F")
        self._numbers: NDArray[np.int64] = np.empty(16, np.int64)
        self._labels: list[str] = []
        self._by_label: dict[str, list[int]] = {}
        self._row: dict[int, int] = {}
        self._next = 0

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._labels)

    @property
    def labels(self) -> list[str]:
        """Labels of which there is an object."""
        return [label for label, numbers in self._by_label.items() if numbers]

    @property
    def values(self) -> Array:
        """(n, 11) view of all rows, columns as in `COLUMNS`."""
        return self._values[: len(self._labels)]

    @property
    def numbers(self) -> NDArray[np.int64]:
        """(n,) view of the numbers of the rows."""
        return self._numbers[: len(self._labels)]

    def rows(self, label: str) -> NDArray[np.intp]:
        """Return the rows of all objects with this label, in the order of their numbers."""
        return np.array([self._row[number] for number in self._by_label.get(label, ())], np.intp)

    def label(self, row: int) -> str:
        """Return what a row is."""
        return self._labels[row]

    def add(self, label: str, values: Array, number: int | None = None) -> int:
        """Add an object, with the next number unless it has one, and return its number."""
        number = self._next if number is None else number
        self._next = max(self._next, number + 1)
        row = len(self._labels)
        if row == len(self._values):
            self._values = np.concatenate([self._values, np.empty_like(self._values)])
            self._numbers = np.concatenate([self._numbers, np.empty_like(self._numbers)])
        self._values[row], self._numbers[row] = values, number
        self._labels.append(label)
        self._by_label.setdefault(label, []).append(number)
        self._row[number] = row
        return number

    def remove(self, number: int) -> None:
        """Remove an object; the last row takes its place."""
        row, last = self._row.pop(number), len(self._labels) - 1
        self._by_label[self._labels[row]].remove(number)
        if row != last:
            self._values[row], self._numbers[row] = self._values[last], self._numbers[last]
            self._labels[row] = self._labels[last]
            self._row[int(self._numbers[row])] = row
        self._labels.pop()

    def row(self, number: int) -> ObjectRow:
        """Return a copy of an object."""
        at = self._row[number]
        return ObjectRow(number, self._labels[at], self._values[at].copy())
