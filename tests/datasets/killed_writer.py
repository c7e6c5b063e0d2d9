"""Writes episodes without end, and says on its output how many are finished; for `test_killed.py`."""

from __future__ import annotations

import sys
from pathlib import Path

from tests.datasets.conftest import PLAIN, SMALL, frames

from golem.datasets.episode_writer import DatasetWriter

recipe = SMALL if sys.argv[2] == "pictures" else PLAIN
writer = DatasetWriter(Path(sys.argv[1]), recipe)
rows = frames(12, 0, recipe)
print("open", flush=True)
while True:
    writer.begin("Take a screw.")
    for row in rows:
        writer.add(row)
    print(writer.finish(), flush=True)
