"""What the leg benches test: one lower body on one plant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from golem.evaluation.base import TrialSpec
from golem.evaluation.episode import Episode, episode_seed, legs_stack
from golem.evaluation.provenance import digest, user_files


def labels(methods: Sequence[str]) -> dict[str, str]:
    """Return short names of lower bodies, file names without folders where that tells them apart."""
    short = {method: method if method.startswith("{") else Path(method).name for method in methods}
    taken = list(short.values())
    return {method: name if taken.count(name) == 1 else method for method, name in short.items()}


@dataclass(frozen=True, slots=True)
class Subject:
    """One lower body on one plant; JSON-like.

    Attributes:
        method: lower body, see `episode.lower_body`.
        profile: realism profile.
        robot: options of the twin that differ from the standing stack's, e.g. `{"latency": 0.02}`.
        files: hash of the files the method names.
    """

    method: str
    profile: str
    robot: Mapping[str, Any] = field(default_factory=dict[str, Any])
    files: str = ""

    @classmethod
    def of(cls, method: str, profile: str, robot: Mapping[str, Any]) -> Subject:
        """Return the subject `method`, with the hash of its files.

        Raises:
            ConfigError: the standing stack cannot be read.
        """
        return cls(method, profile, dict(robot), digest(user_files(legs_stack(method, profile, robot=robot))))

    def draw(self, seed: int, index: int) -> TrialSpec:
        """Return the trial whose noise streams trial `index` of every test draws from, whatever the method."""
        return TrialSpec("legs", self.method, self.profile, seed, index)

    def episode(self, seed: int, index: int, **robot: object) -> Episode:
        """Return the robot of trial `index`, with further options of the twin."""
        stack = legs_stack(self.method, self.profile, robot={**self.robot, **robot})
        return Episode(stack, episode_seed(seed, index))
