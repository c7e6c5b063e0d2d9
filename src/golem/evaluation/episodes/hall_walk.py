"""A walk through the hall, seen from outside: the way it took, what the navigator did, and whom it took for walkers."""

from __future__ import annotations

import numpy as np

from golem.capabilities.navigation.movers import BODY
from golem.evaluation.episodes.episode import Episode
from golem.interfaces import topics
from golem.interfaces.nav_payloads import NavStep
from golem.types import Array, PlanarPose, Twist

EVERY = 0.2
"""Time between two places of the track [s]."""
SOMEBODY = BODY + 0.4
"""Distance from somebody up to which a walker that the navigator names is that person [m]: both radii, and the gate."""
WALKING = ("follow", "approach")
"""Notes of a navigator that is on its way."""


class HallWalk:
    """Collects what happens on a walk; call it after every tick from the beginning of the walk on.

    Attributes:
        track: true places on the floor, in odom [m].
        stopped: true pose when the legs were last told to stand; None while they never were.
        recoveries: how often the navigator began to recover.
        stood: time for which it was neither following nor approaching [s].
        walkers: those it took to walk about, counted at every step.
        nobody: those of them where nobody was.
    """

    def __init__(self) -> None:
        """Wait for the first step."""
        self.track: list[tuple[float, float]] = []
        self.stopped: PlanarPose | None = None
        self.recoveries = self.walkers = self.nobody = 0
        self.stood = 0.0
        self._step: NavStep | None = None
        self._since = self._drawn = -np.inf

    def __call__(self, episode: Episode) -> None:
        """Look at the newest step of the navigator, and at the robot."""
        step, before, t = episode.running.bus.latest(topics.NAV_STEP), self._step, episode.t
        if step is None:
            return
        if t >= self._drawn + EVERY:
            self._drawn = t
            pose = episode.robot.truth.pose()
            self.track.append((pose.x, pose.y))
        if step is before:
            return
        if before is not None:
            if before.twist != Twist() and step.twist == Twist():
                self.stopped = episode.robot.truth.pose()
            self.recoveries += step.note == "recover" != before.note
            self.stood += (t - self._since) * (before.note not in WALKING)
        self._step, self._since = step, t
        if len(step.people):
            off = step.people[:, None, :2] - _people(episode)
            self.walkers += len(step.people)
            self.nobody += int((np.hypot(off[..., 0], off[..., 1]) > SOMEBODY).all(axis=1).sum())

    def series(self) -> dict[str, float]:
        """Return the figures of it; see `Metric`."""
        found = {"recoveries": float(self.recoveries), "stood": self.stood}
        if self.walkers:
            found["nobody"] = self.nobody / self.walkers
        return found


def _people(episode: Episode) -> Array:
    """Return (k, 2) where everybody really is in odom, which is also the frame of the survey's map [m]."""
    T, t = np.linalg.inv(episode.robot.truth.T_world_odom), episode.t
    places = [T[:2, :3] @ person.position(t) + T[:2, 3] for person in episode.robot.scene.people]
    return np.array(places).reshape(-1, 2)
