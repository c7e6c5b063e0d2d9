"""The text form of USD (usda): prims with their schemas, properties and children."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from golem.types import Array

HEADER = """#usda 1.0
(
    defaultPrim = "{root}"
    kilogramsPerUnit = 1
    metersPerUnit = 1
    upAxis = "Z"
)

"""
"""What begins a layer: SI units, z up."""


@dataclass
class Prim:
    """One prim of a layer.

    Attributes:
        kind: its type, e.g. `Xform`.
        name: its name, unique among its siblings.
        schemas: names of the API schemas that are applied to it.
        properties: declaration, e.g. `float physics:mass` -> the value as text.
        children: the prims below it.
    """

    kind: str
    name: str
    schemas: Sequence[str] = ()
    properties: dict[str, str] = field(default_factory=dict[str, str])
    children: list[Prim] = field(default_factory=list["Prim"])

    def lines(self, indent: str = "") -> Iterator[str]:
        """Yield the lines of its text."""
        yield f'{indent}def {self.kind} "{self.name}"' + (" (" if self.schemas else "")
        if self.schemas:
            names = ", ".join(f'"{name}"' for name in self.schemas)
            yield f"{indent}    prepend apiSchemas = [{names}]"
            yield f"{indent})"
        yield indent + "{"
        for declaration, value in self.properties.items():
            yield f"{indent}    {declaration} = {value}"
        for child in self.children:
            yield from child.lines(indent + "    ")
        yield indent + "}"


def layer(root: Prim) -> str:
    """Return the text of a layer whose default prim is `root`."""
    return HEADER.format(root=root.name) + "\n".join(root.lines()) + "\n"


def numbers(values: Array) -> str:
    """Return a vector or a quaternion, wxyz, as a tuple of USD; every number survives the way."""
    return f"({', '.join(repr(float(v)) for v in np.asarray(values).ravel())})"


def placed(pos: Array, quat: Array, scale: Array | None = None) -> dict[str, str]:
    """Return the properties that put a prim at `pos` (3,) [m], turned by `quat` (4,) wxyz, in its parent's frame."""
    order = '["xformOp:translate", "xformOp:orient"' + ("" if scale is None else ', "xformOp:scale"') + "]"
    scaled = {} if scale is None else {"double3 xformOp:scale": numbers(scale)}
    return {
        "double3 xformOp:translate": numbers(pos),
        "quatd xformOp:orient": numbers(quat),
        **scaled,
        "uniform token[] xformOpOrder": order,
    }
