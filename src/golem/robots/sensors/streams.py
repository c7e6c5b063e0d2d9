"""Random streams that cannot disturb each other: one generator per (seed, name).

A trial's seed fans out by name, e.g. `stream(7, "camera/head")`. The name is hashed into the key of a counter-based
generator (Philox), so adding a stream, or drawing more from one, changes no other: two methods that run on the same
seed meet the same scene and the same noise.
"""

from __future__ import annotations

import hashlib

import numpy as np


def stream(seed: int, name: str) -> np.random.Generator:
    """Return the generator of one named stream of one seed; the same arguments give the same draws on any machine.

    Args:
        seed: the trial's seed, 0 or more.
        name: what the numbers are for, by convention `"concept/instance"`.

    Raises:
        ValueError: `seed` is negative.
    """
    if seed < 0:
        raise ValueError(f"a seed is 0 or more, got {seed}")
    digest = hashlib.sha256(f"{seed}/{name}".encode()).digest()
    # Through a SeedSequence, so that the generator can spawn children.
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(int.from_bytes(digest, "little"))))
