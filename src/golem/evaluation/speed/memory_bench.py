"""`golem bench memory`: a memory of objects with a file, at scale."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from golem.capabilities.memory.base import Observation
from golem.capabilities.memory.object_map import ObjectMap, ObjectMapConfig
from golem.capabilities.memory.words import SYNONYMS
from golem.errors import ConfigError
from golem.evaluation.speed.bench import BenchOutput, Figure, figure, print_figures, timed
from golem.robots.sensors.cameras import HEAD
from golem.types import Array, Detection, LocalizedObject, RgbdImage

LABELS = tuple(SYNONYMS)
NEAR, VIEW = 6, 0.4
"""Objects in a look, and height of the camera above their middle [m]."""
QUESTIONS = 2000


@dataclass(frozen=True)
class MemoryBenchConfig(BenchOutput):
    """Print figures of a memory of objects at scale."""

    observations: int = 100_000
    """Looks that are taken in, each written to the file."""
    objects: int = 10_000
    """Objects in the room."""


class Room:
    """Objects on a square of the floor, 1 m apart, and looks from above at some of them."""

    def __init__(self, count: int, seed: int) -> None:
        # A look is at one part of a row: both are multiples of its length.
        self._side, self._count = NEAR * max(1, round(np.sqrt(count) / NEAR)), count - count % NEAR
        self._rng = np.random.default_rng(seed)
        self._depth = np.full((HEAD.height, HEAD.width), 5.0, np.float32)
        self._rgb = np.zeros((HEAD.height, HEAD.width, 3), np.uint8)
        self._box = np.array([310.0, 230.0, 330.0, 250.0])
        self._cloud = self._rng.uniform(-0.03, 0.03, (64, 3))

    def _place(self, number: int) -> Array:
        return np.array([number % self._side, number // self._side, 0.0], float)

    def look(self, t: float, first: int) -> Observation:
        """Return a look at `NEAR` objects in a row, the rest being out of view, the first object `first`."""
        T = np.diag([1.0, -1.0, -1.0, 1.0])
        T[:3, 3] = self._place(first % self._count) + (0.5 * (NEAR - 1), 0.0, VIEW)
        found: list[LocalizedObject] = []
        for i in range(NEAR):
            number = (first + i) % self._count
            place = self._place(number) + self._rng.normal(0.0, 0.003, 3)
            detection = Detection(LABELS[number % len(LABELS)], 0.9, self._box, self._box[:2])
            found.append(LocalizedObject(detection, t, place, place + self._cloud))
        return Observation(RgbdImage(t, HEAD, self._rgb, self._depth, T), found, ())


def run_memory_bench(config: MemoryBenchConfig) -> list[Figure]:
    """Measure and print. Raises ConfigError: a number is negative, or there is nothing to see."""
    if min(config.observations, config.seed) < 0 or config.objects < NEAR:
        raise ConfigError(f"--observations and --seed are at least 0, --objects at least {NEAR}.")
    with TemporaryDirectory() as folder:
        figures = _scale(config, Path(folder) / "memory.sqlite")
    print_figures(figures, "object_map with a file")
    return config.told(figures)


def _scale(config: MemoryBenchConfig, path: Path) -> list[Figure]:
    room, options = (Room(config.objects, config.seed), ObjectMapConfig(file=str(path), most=config.objects * 2))
    memory = ObjectMap(options)
    looks = timed(lambda i: memory.observe(room.look(0.1 * i, i * NEAR)), max(config.observations, 1))
    made = timed(lambda i: room.look(0.1 * i, i * NEAR), min(1000, max(config.observations, 1)))
    before = _resident()
    asked = timed(lambda i: memory.query(LABELS[i % len(LABELS)]), QUESTIONS)
    history = timed(lambda i: memory.query("screw", "anywhere", None, 100), QUESTIONS // 10)
    count = len(memory)
    memory.close()
    started = time.perf_counter()
    again = ObjectMap(options)
    loaded = time.perf_counter() - started
    if len(again) != count:
        raise AssertionError(f"{count} objects were kept, {len(again)} came back")
    again.close()
    of = f"{config.observations} looks, {count} objects"
    size = path.stat().st_size / 1e6
    return [
        figure(f"one look, {of} (making it takes {1e3 * np.median(made):.2g} ms of it)", looks, 1e3, "ms", "5"),
        figure("a question for the present", asked, 1e3, "ms", "5 (p99), 1 (median)"),
        figure("a question for 100 places of any time", history, 1e3, "ms", "5 (p99)"),
        Figure("the file", size, size, "MB", ""),
        Figure("reading the file, by the wall clock", loaded, loaded, "s", ""),
        Figure("resident memory of the process", before, before, "MB", ""),
    ]


def _resident() -> float:
    """Return the resident memory of this process [MB]; 0 where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
