"""Figures by matplotlib, which the extra `report` brings; without the global state of its pyplot."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem.errors import needs

DPI = 96.0
"""Pixels per inch: matplotlib's points are then three quarters of a pixel."""


def blank_figure(width: float, height: float, **options: Any) -> Any:
    """Return an empty `matplotlib.figure.Figure`.

    Args:
        width: size [px].
        height: size [px].
        options: of the figure, e.g. `facecolor`.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    with needs("matplotlib", "report"):
        from matplotlib.figure import Figure
    return Figure(figsize=(width / DPI, height / DPI), dpi=DPI, **{"layout": "constrained", **options})


def pixels(figure: Any) -> NDArray[np.uint8]:
    """Return a figure as (height, width, 3) RGB."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()
