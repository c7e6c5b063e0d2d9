"""Compares what a module returned with what it returned before, whatever it is made of."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, cast

import numpy as np


def difference(a: Any, b: Any, where: str = "the answer") -> str:
    """Return where `a` and `b` differ, the first place that does; empty where they are equal bit for bit.

    Dataclasses, mappings, lists, tuples and arrays are compared by what they hold; two NaN are equal.
    """
    if type(a) is not type(b):
        return f"{where} is a {type(a).__name__}, then a {type(b).__name__}"
    if isinstance(a, np.ndarray):
        equal = a.shape == b.shape and a.dtype == b.dtype and a.tobytes() == b.tobytes()
        return "" if equal else f"{where} is {_short(a)}, then {_short(b)}"
    if dataclasses.is_dataclass(a):
        names = [field.name for field in dataclasses.fields(a)]
        return _first((getattr(a, name), getattr(b, name), f"{where}.{name}") for name in names)
    if isinstance(a, Mapping):
        left, right = cast("Mapping[Any, Any]", a), cast("Mapping[Any, Any]", b)
        if left.keys() != right.keys():
            return f"{where} has the keys {list(left)}, then {list(right)}"
        return _first((left[key], right[key], f"{where}[{key!r}]") for key in left)
    if isinstance(a, list | tuple):
        left, right = cast("list[Any]", a), cast("list[Any]", b)
        if len(left) != len(right):
            return f"{where} has {len(left)} members, then {len(right)}"
        return _first((x, y, f"{where}[{i}]") for i, (x, y) in enumerate(zip(left, right, strict=True)))
    if a == b or (a != a and b != b):
        return ""
    if type(a).__eq__ is object.__eq__:  # nothing tells two of them apart but where they are
        return difference(vars(a), vars(b), where) if hasattr(a, "__dict__") else ""
    return f"{where} is {a!r}, then {b!r}"


def _first(pairs: Any) -> str:
    return next(filter(None, (difference(*pair) for pair in pairs)), "")


def _short(values: Any) -> str:
    return np.array2string(values.ravel()[:4], precision=6, threshold=4) if values.size else "empty"
