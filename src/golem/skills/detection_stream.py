"""What a camera sees, as a skill follows it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from golem.interfaces import topics
from golem.interfaces.payloads import DetectionRequest, Detections

if TYPE_CHECKING:
    from golem.skills.context import Context

SURE = 0.3
"""Score from which on a sighting is believed without anything else that speaks for it."""


class DetectionStream:
    """A camera that streams sightings while it is open (a context manager)."""

    def __init__(self, context: Context, camera: str, labels: tuple[str, ...], doubtful: tuple[str, ...]) -> None:
        """Watch `camera` for `labels`; of those in `doubtful`, sightings below `SURE` are passed on, too."""
        self._context = context
        self._camera = camera
        self._labels, self._doubtful = labels, doubtful
        self._seen = 0
        self._since = 0.0

    def __enter__(self) -> DetectionStream:
        self._seen = self._context.bus.count(topics.detections(self._camera))
        self._since = self._context.t
        self._context.publish(topics.detection_request(self._camera), DetectionRequest(self._labels))
        return self

    def __exit__(self, *_: object) -> None:
        """Stop the stream, so that nothing is rendered or inferred unasked."""
        self._context.publish(topics.detection_request(self._camera), DetectionRequest())

    def fresh(self) -> Detections | None:
        """Return the sightings of a frame exposed since the eye opened that was not returned before, or None."""
        topic = topics.detections(self._camera)
        count = self._context.bus.count(topic)
        if count == self._seen:
            return None
        self._seen = count
        newest = self._context.bus.latest(topic)
        if newest is None or newest.t < self._since:
            return None
        believed = (o for o in newest.objects if o.detection.score >= SURE or o.label in self._doubtful)
        return replace(newest, objects=tuple(believed))

    async def look(self, timeout: float) -> Detections | None:
        """Wait for the next fresh sightings, at most `timeout` [s]; None when no frame came."""
        end = self._context.t + timeout
        while True:
            sightings = self.fresh()
            if sightings is not None or self._context.t >= end:
                return sightings
            await self._context.tick()
