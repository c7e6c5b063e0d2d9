"""A stack in this process as the desk's body: in lock-step, as fast as it goes, or paced by the wall clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from golem.agent.answers import words
from golem.agent.body import Body, Picture, drawn
from golem.errors import GolemError, RobotGone
from golem.hardware.safety.base import OperatorRequest
from golem.interfaces import topics
from golem.interfaces.payloads import Feedback
from golem.middleware.bus import News
from golem.robots.base import Robot
from golem.runtime.executor import when_stepped
from golem.runtime.lockstep import LockstepRunner
from golem.skills.base import SkillResult
from golem.skills.runner import SkillRun

STEP = 0.05
"""Time between two looks at what is asked [s]: a cancellation waits for it."""
FRESH = 0.2
"""Age up to which what was found in a frame is shown [s]."""
MAX_PLACES = 100
"""Most places of the memory that are told."""


class StackBody(Body):
    """See `Body`. Unpaced, time passes only while a skill runs."""

    def __init__(
        self, running: LockstepRunner, robot: Robot, paced: bool = False, watch: Callable[[], None] | None = None
    ) -> None:
        """Work with `running` and its `robot`; `watch` is called after every tick, see `LockstepRunner.execute`."""
        job = running.stack.all_skills.get("disassemble")
        super().__init__(running.bus, Path("." if job is None else str(job.options.get("folder", "."))))
        self.specs, self.paced = running.skills.specs, paced
        self._running, self._robot, self._watch = running, robot, watch
        self._run: SkillRun | None = None
        self._news = News(running.bus, topics.FEEDBACK)

    @property
    def t(self) -> float:
        """Robot time [s]."""
        return self._running.executor.t

    @property
    def busy(self) -> bool:
        """Whether a skill runs."""
        return self._running.busy

    def begin(self, skill: str, fields: Mapping[str, Any]) -> None:
        safety = self._running.safety
        if safety is not None and safety.stopped:
            raise GolemError(f"The safety gate has stopped the robot: {safety.why}.")
        self._run = self._running.start(skill, fields)

    def said(self) -> Feedback | None:
        return self._news.read()

    def result(self) -> SkillResult | None:
        return None if self._run is None else self._run.result

    def cancel(self) -> None:
        self._running.cancel()

    def stop_motors(self) -> None:
        self._running.request(OperatorRequest.STOP)
        self.step()

    def _memory(self) -> dict[str, Any]:
        status = self._bus.latest(topics.MEMORY_STATUS)
        frame, now = ("odom", self.t) if status is None else (status.frame, self.t + status.epoch)
        told = [
            {"label": words(p.label), "position": np.round(p.position, 3).tolist(), "last_seen": now - p.last_seen,
             "evidence": p.evidence}
            for p in self._running.memory.places(MAX_PLACES)
        ]  # fmt: skip
        return {"frame": frame, "places": told}

    def picture(self, camera: str) -> Picture | None:
        frame = self._bus.latest(topics.rgbd_images(camera))
        if frame is None or self.t - frame.t > FRESH:
            return Picture(drawn(self._robot.capture(camera)[0]), ())
        seen = self._bus.latest(topics.detections(camera))
        found = () if seen is None or abs(seen.t - frame.t) > FRESH else seen.objects
        places = [(o, *o.position.tolist()) for o in found]
        listed = tuple((o.label, float(o.detection.score), x, y, z) for o, x, y, z in places)
        return Picture(drawn(frame.rgb, [(o.label, o.detection.box.tolist()) for o in found]), listed)

    def step(self) -> None:
        run, running = self._run, self._running

        def over() -> bool:
            if self._watch is not None:
                self._watch()
            return run is not None and run.result is not None and not self.paced

        due = when_stepped if self._watch is None else getattr(self._watch, "due", None)
        try:
            running.executor.run(self.t + STEP, over, self.paced, due)
        except RobotGone as gone:
            if run is not None:
                run.end(SkillResult(False, "robot", "robot", str(gone)))
        safety = running.safety
        if run is not None and run.result is None and safety is not None and safety.stopped:
            run.end(SkillResult(False, "safety", "safety", f"Safety stop: {safety.why}."))
