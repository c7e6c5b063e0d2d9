"""What a detector learns to find: the parts of a battery pack, and what stands in a kitchen."""

from __future__ import annotations

PACK: tuple[str, ...] = ("screw", "screw_hole", "nut", "bus_bar", "tray")
"""Classes of a pack's parts."""
KITCHEN: tuple[str, ...] = ("handle", "mug", "bowl", "can", "bottle")
"""Classes of a kitchen: the bar of a fridge, and tableware."""
CLASSES: tuple[str, ...] = PACK + KITCHEN
"""All class names, those of the shipped weights, in the order of their heatmaps."""
