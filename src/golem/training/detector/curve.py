"""Draws the training curve."""

from __future__ import annotations

import csv
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from golem.capabilities.perception.classes import CLASSES

SIZE = (900, 420)
MARGIN = (60, 30, 150, 45)
"""Left, top, right, bottom [px]."""
COLOURS = ("#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee")


def draw_curve(curve: Path, out: Path) -> None:
    """Draw average precision over crops seen, per class; head camera solid, palm cameras dashed.

    Args:
        curve: the CSV file that `train` writes.
        out: the PNG file.
    """
    with curve.open() as file:
        rows = list(csv.DictReader(file))
    last = max(int(row["images"]) for row in rows)
    left, top, right, bottom = MARGIN
    width, height = SIZE[0] - left - right, SIZE[1] - top - bottom
    image = Image.new("RGB", SIZE, "white")
    pen = ImageDraw.Draw(image)
    font = ImageFont.load_default(13)
    for k in range(6):
        y = top + height * (1 - k / 5)
        pen.line([(left, y), (left + width, y)], fill="#dddddd")
        pen.text((left - 8, y), f"{k / 5:.1f}", fill="black", font=font, anchor="rm")
    for k in range(5):
        x = left + width * k / 4
        pen.text((x, top + height + 8), f"{last * k / 4 / 1000:.0f}k", fill="black", font=font, anchor="ma")
    pen.text((left + width / 2, SIZE[1] - 6), "training crops", fill="black", font=font, anchor="mb")
    pen.text((left, 8), "AP on part of the held-out images: head solid, palm dashed", fill="black", font=font)
    for k, (label, colour) in enumerate(zip(CLASSES, COLOURS, strict=True)):
        for camera in ("head", "palm"):
            points = [
                (
                    left + width * int(row["images"]) / last,
                    top + height * (1 - float(row[f"ap_{camera}_{label}"])),
                )
                for row in rows
            ]
            for i, pair in enumerate(zip(points, points[1:], strict=False)):
                if camera == "head" or i % 2 == 0:
                    pen.line(pair, fill=colour, width=2)
        y = top + 10 + 20 * k
        pen.line([(left + width + 15, y), (left + width + 35, y)], fill=colour, width=3)
        pen.text((left + width + 42, y), label, fill="black", font=font, anchor="lm")
    image.save(out)
