"""A memory whose process is killed while it writes has every look that it had acknowledged."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from golem.capabilities.memory.object_map import ObjectMap, ObjectMapConfig

WRITER = """
import sys
from golem.capabilities.memory.object_map import ObjectMap, ObjectMapConfig
from golem.evaluation.speed.memory_bench import NEAR, Room
room, memory, i = Room(100, 0), ObjectMap(ObjectMapConfig(file=sys.argv[1])), 0
while True:
    i += 1
    memory.observe(room.look(float(i), i * NEAR))
    print(i, flush=True)
"""


@pytest.mark.parametrize("seed", range(2))
def test_no_acknowledged_look_is_lost(seed: int, tmp_path: Path) -> None:
    path = tmp_path / "memory.sqlite"
    with subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        first = writer.stdout.readline()
        time.sleep(np.random.default_rng(seed).uniform(0.0, 0.05))
        writer.kill()
        told = [int(line) for line in (first, *writer.stdout) if line.endswith("\n")]
    memory = ObjectMap(ObjectMapConfig(file=str(path)))
    assert memory.last >= max(told)
    memory.close()
