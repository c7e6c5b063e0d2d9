"""The node of the memory: what a localizer finds goes in, at places that stay."""

from __future__ import annotations

import math
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace

from golem.capabilities.memory.base import MemoryFault, Observation
from golem.errors import ModuleFault
from golem.interfaces import topics
from golem.interfaces.memory_payloads import MemoryStatus, RememberedPlace, RememberedPlaces
from golem.interfaces.payloads import Detections
from golem.middleware.bus import Bus, News
from golem.runtime.checked import CheckedMemory
from golem.types import TICK, Array, LocalizedObject

SIGMA = 0.02
"""Standard deviation of a frame's position where nobody says [m]: the memory's own default."""

SHOWN = 40
"""Most places that are shown to people, those seen last."""


class MemoryNode:
    """Gives a memory every look in which something was looked for; live, beside the clock, on a thread of its own.

    It asks for no look itself: skills do. Where the robot has a map, places are in the map's frame, and what is seen
    before the place in the map is known is not remembered. A look that the memory refuses ends nothing.
    """

    def __init__(
        self,
        bus: Bus,
        memory: CheckedMemory,
        cameras: Iterable[str],
        in_map: bool,
        epoch: float,
        pool: ThreadPoolExecutor | None = None,
    ) -> None:
        """Feed a memory.

        Args:
            bus: where detections are.
            memory: what is fed.
            cameras: whose looks.
            in_map: whether there is a map to wait for.
            epoch: what is added to times of the robot [s]; more where the memory knows later times already.
            pool: where the memory runs; None is here.
        """
        self._bus, self._memory, self._pool, self._in_map = bus, memory, pool, in_map
        self._epoch = epoch if math.isinf(memory.last) else max(epoch, memory.last)
        self.period = TICK if pool is not None else math.inf
        self.wakes = tuple(map(topics.detections, cameras))
        self._news = [News(bus, topic) for topic in self.wakes]
        self._last, self._looks, self._began = -math.inf, 0, False
        self._job: tuple[Future[str], float] | None = None

    def step(self, t: float) -> None:
        """Take in what came, and say how that went."""
        if not self._began:
            self._began = True
            self._tell(t, "", t, looks=0)
        if self._job is not None:
            job, of = self._job
            if not job.done():
                return
            self._job = None
            self._tell(of, job.result(), t)
        came = [found for news in self._news if (found := news.read()) is not None]
        for found in sorted(came, key=lambda found: found.t):
            # Of two cameras the later look may come first: the earlier one is left out.
            observation = self._observation(found) if found.t > self._last else None
            if observation is None:
                continue
            self._last = found.t
            if self._pool is None:
                self._tell(found.t, self._observe(observation), t)
            else:
                self._job = self._pool.submit(self._observe, observation), found.t
                return

    def _observe(self, observation: Observation) -> str:
        """Return why the memory did not take a look; empty where it did."""
        try:
            self._memory.observe(observation)
        except (MemoryFault, ModuleFault) as problem:
            return str(problem)
        return ""

    def _tell(self, of: float, problem: str, t: float, looks: int = 1) -> None:
        self._looks += 0 if problem else looks
        frame = "map" if self._in_map else "odom"
        if not problem:
            problem = self._show(frame, self._epoch + t, t)
        self._bus.publish(topics.MEMORY_STATUS, MemoryStatus(of, frame, self._epoch, self._looks, problem), t)

    def _show(self, frame: str, now: float, t: float) -> str:
        """Publish what is remembered at `now`, in the memory's time; return what was wrong with it."""
        try:
            known = self._memory.places(SHOWN)
        except ModuleFault as fault:
            return str(fault)
        places = tuple(
            RememberedPlace(
                p.label, float(p.position[0]), float(p.position[1]), now - p.last_seen, p.evidence == "seen"
            )
            for p in known
        )
        self._bus.publish(topics.MEMORY_PLACES, RememberedPlaces(frame, places), t)
        return ""

    def _observation(self, found: Detections) -> Observation | None:
        """Return a look with its places in the frame that stays; None while that is not known, or without a frame."""
        if found.frame is None:
            return None
        frame = replace(found.frame, t=self._epoch + found.t)
        if not self._in_map:
            return Observation(frame, found.objects, found.labels, SIGMA)
        place, odometry = self._bus.latest(topics.MAP_POSE), self._bus.latest(topics.ODOMETRY)
        if place is None:
            return None
        T = place.T_map_estimate.matrix()
        sigma = SIGMA
        if odometry is not None and odometry.covariance is not None:
            sigma = max(SIGMA, math.sqrt(float(odometry.covariance[:3, :3].trace()) / 3.0))
        frame = replace(frame, T_odom_optical=T @ frame.T_odom_optical)
        return Observation(frame, [_moved(one, T) for one in found.objects], found.labels, sigma)


def _moved(found: LocalizedObject, T: Array) -> LocalizedObject:
    R, p = T[:3, :3], T[:3, 3]
    return replace(found, position=R @ found.position + p, points=found.points @ R.T + p)
