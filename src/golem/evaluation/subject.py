"""What the leg benches test: one lower body on one plant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from golem.evaluation.base import TrialSpec
from golem.evaluation.episodes.episode import Episode, episode_seed, legs_stack
from golem.provenance import digest, user_files
from golem.stack import Stack


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
        use: slot -> implementation that replaces the standing stack's own, e.g. of the estimator.
        files: hash of the files that method and replacements name.
    """

    method: str
    profile: str
    robot: Mapping[str, Any] = field(default_factory=dict[str, Any])
    use: Mapping[str, str] = field(default_factory=dict[str, str])
    files: str = ""

    @classmethod
    def of(
        cls, method: str, profile: str, robot: Mapping[str, Any], use: Mapping[str, str] | None = None
    ) -> Subject:
        """Return the subject `method`, with the hash of its files.

        Raises:
            ConfigError: the standing stack cannot be read, or `use` replaces what the test itself brings.
        """
        subject = cls(method, profile, dict(robot), dict(use or {}))
        return replace(subject, files=digest(user_files(subject.stack())))

    def stack(self, **robot: object) -> Stack:
        """Return the standing stack with this lower body, and further options of the twin."""
        return legs_stack(self.method, self.profile, self.use, {**self.robot, **robot})

    def draw(self, seed: int, index: int) -> TrialSpec:
        """Return the trial whose noise streams trial `index` of every test draws from, whatever the method."""
        return TrialSpec("legs", self.method, self.profile, seed, index)

    def episode(self, seed: int, index: int, **robot: object) -> Episode:
        """Return the robot of trial `index`, with further options of the twin."""
        return Episode(self.stack(**robot), episode_seed(seed, index))
