"""A stack in this process as the desk's body: in lock-step, as fast as it goes, or paced by the wall clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from golem.agent.answers import words
from golem.agent.body import Moment, Picture, drawn, map_text
from golem.capabilities.arms.hand_force import HandForce
from golem.errors import GolemError, RobotGone
from golem.hardware.safety.base import OperatorRequest
from golem.interfaces import topics
from golem.interfaces.payloads import Feedback
from golem.middleware.bus import News
from golem.robots.base import Robot
from golem.runtime.executor import FOREVER, when_stepped
from golem.runtime.lockstep import LockstepRunner
from golem.skills.base import SkillResult
from golem.skills.job_file import JobFile
from golem.skills.runner import SkillRun
from golem.types import SIDES, UPPER, PlanarPose

STEP = 0.05
"""Time between two looks at what is asked [s]: a cancellation waits for it."""
FRESH = 0.2
"""Age up to which what was found in a frame is shown [s]."""
MAX_PLACES = 100
"""Most places of the memory that are told."""


class StackBody:
    """See `Body`. Unpaced, time passes only while a skill runs."""

    def __init__(
        self, running: LockstepRunner, robot: Robot, paced: bool = False, watch: Callable[[], None] | None = None
    ) -> None:
        """Work with `running` and its `robot`; `watch` is called after every tick, see `LockstepRunner.execute`."""
        self.specs, self.paced = running.skills.specs, paced
        self._running, self._robot, self._watch = running, robot, watch
        self._run: SkillRun | None = None
        self._news = News(running.bus, topics.FEEDBACK)
        self._force = HandForce()

    @property
    def t(self) -> float:
        """Robot time [s]."""
        return self._running.executor.t

    @property
    def busy(self) -> bool:
        """Whether a skill runs."""
        return self._running.busy

    def begin(self, skill: str, fields: Mapping[str, Any]) -> None:
        """Begin a skill; see `Body`."""
        safety = self._running.safety
        if safety is not None and safety.stopped:
            raise GolemError(f"The safety gate has stopped the robot: {safety.why}.")
        self._run = self._running.start(skill, fields)

    def said(self) -> Feedback | None:
        """Return news of the skill; see `Body`."""
        return self._news.read()

    def result(self) -> SkillResult | None:
        """Return how the skill ended; see `Body`."""
        return None if self._run is None else self._run.result

    def cancel(self) -> None:
        """Cancel the skill; see `Body`."""
        self._running.cancel()

    def stop_motors(self) -> None:
        """Stop; see `Body`."""
        self._running.request(OperatorRequest.STOP)
        self._running.executor.run(self.t + STEP)

    def moment(self) -> Moment | None:
        """Return how the robot moves; see `Body`."""
        base, state = self._running.bus.latest(topics.BASE), self._running.bus.latest(topics.LOW_STATE)
        if base is None or state is None:
            return None
        forces = np.array([self._force.wrench(side, state.q[UPPER], state.tau[UPPER])[:3] for side in SIDES])
        x, y = base.T_odom_base[:2, 3].tolist()
        return Moment(x, y, (float(base.velocity[0]), float(base.velocity[1])), forces)

    def in_odom(self, frame: str, x: float, y: float) -> tuple[float, float] | None:
        """Return a place in odom; see `Body`."""
        bus, place = self._running.bus, PlanarPose(x, y, 0.0)
        base, there = bus.latest(topics.BASE), bus.latest(topics.MAP_POSE)
        if frame == "base_link":
            if base is None:
                return None
            place = PlanarPose.of(base.T_odom_base) @ place
        elif frame in ("map", "memory") and there is not None:
            place = there.T_odom_map @ place
        elif frame == "map":
            return None
        return place.x, place.y

    def read(self, resource: str) -> dict[str, Any]:
        """Return a resource; see `Body`."""
        return {"t": self.t, **getattr(self, f"_{resource}")()}

    def _state(self) -> dict[str, Any]:
        bus, moment = self._running.bus, self.moment()
        state, base = bus.latest(topics.LOW_STATE), bus.latest(topics.BASE)
        if moment is None or state is None or base is None:
            return {}
        hands = {side: bus.latest(topics.hand_status(side)) for side in SIDES}
        pose = PlanarPose.of(base.T_odom_base)
        return {
            "base": {"frame": "odom", "x": pose.x, "y": pose.y, "yaw": pose.yaw, "velocity": list(moment.velocity)},
            "joints": np.round(state.q, 4).tolist(),
            "hands": {
                side: {"state": hand.state.value, "gap": hand.gap, "force": moment.forces[k].round(1).tolist()}
                for k, (side, hand) in enumerate(hands.items())
                if hand is not None
            },
            "busy": self.busy,
        }

    def _safety(self) -> dict[str, Any]:
        status = self._running.safety
        return {} if status is None else {"state": status.state.value, "why": words(status.why, False)}

    def _map(self) -> dict[str, Any]:
        grid = self._running.bus.latest(topics.MAP)
        if grid is None:
            return {"map": None}
        grid = grid.in_map
        return {"frame": "map", "origin": asdict(grid.origin), "cell": grid.resolution, "map": map_text(grid.cells)}

    def _memory(self) -> dict[str, Any]:
        status = self._running.bus.latest(topics.MEMORY_STATUS)
        places = self._running.memory.places(MAX_PLACES)
        now = self.t + (0.0 if status is None else status.epoch)
        told = [
            {"label": words(p.label), "position": np.round(p.position, 3).tolist(), "evidence": p.evidence,
             "last_seen": max(0.0, now - p.last_seen)}
            for p in places
        ]  # fmt: skip
        return {"frame": "odom" if status is None else status.frame, "places": told}

    def _inventory(self) -> dict[str, Any]:
        choice = self._running.stack.all_skills.get("disassemble")
        return inventory(Path(str(choice.options.get("folder", "."))) if choice is not None else Path())

    def picture(self, camera: str) -> Picture | None:
        """Return what a camera shows; see `Body`."""
        frame = self._running.bus.latest(topics.rgbd_images(camera))
        if frame is None or self.t - frame.t > FRESH:
            return Picture(drawn(self._robot.capture(camera)[0], ()), ())
        seen = self._running.bus.latest(topics.detections(camera))
        found = () if seen is None or abs(seen.t - frame.t) > FRESH else seen.objects
        listed = tuple((o.label, float(o.detection.score), *map(float, o.position)) for o in found)
        return Picture(drawn(frame.rgb, [(o.label, o.detection.box.tolist()) for o in found]), listed)

    def step(self) -> None:
        """Let time pass, up to `STEP`, or the end of the skill; see `Body`."""
        run, running = self._run, self._running

        def over() -> bool:
            if self._watch is not None:
                self._watch()
            return run is not None and run.result is not None and not self.paced

        try:
            due = when_stepped if self._watch is None else None
            running.executor.run(min(self.t + STEP, FOREVER), over, self.paced and self._watch is None, due)
        except RobotGone as gone:
            if run is not None:
                run.end(SkillResult(False, "robot", "robot", str(gone)))
        safety = running.safety
        if run is not None and run.result is None and safety is not None and safety.stopped:
            run.end(SkillResult(False, "safety", "safety", f"Safety stop: {safety.why}."))


def inventory(folder: Path) -> dict[str, Any]:
    """Return what the jobs that are kept in a folder say of each fastener."""
    jobs: dict[str, Any] = {}
    for path in sorted(folder.glob("*.sqlite")):
        with suppress(GolemError):
            book = JobFile(path)
            jobs[path.stem] = [
                {"name": words(one.listed.name), "kind": words(one.listed.kind), "fate": one.fate.value,
                 "place": one.place.round(3).tolist(), "tray": words(one.tray), "reason": words(one.reason)}
                for one in book.fasteners
            ]  # fmt: skip
            book.close()
    return {"jobs": jobs}
