"""The parts of a battery pack that the shipped detector knows."""

from __future__ import annotations

CLASSES: tuple[str, ...] = ("screw", "screw_hole", "nut", "bus_bar", "tray")
"""Class names, in the order of the network's heatmaps."""
