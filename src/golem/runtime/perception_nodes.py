"""The nodes of sight: a camera is exposed, its frame gets a pose, objects are located in it and remembered."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor, Future
from dataclasses import replace

import numpy as np

from golem.capabilities.memory.base import MemoryFault, Observation
from golem.capabilities.perception.base import Localizer
from golem.errors import ConfigError, MissingExtra, MissingSystemLibrary, ModuleFault
from golem.interfaces import topics
from golem.interfaces.memory_payloads import MemoryStatus, RememberedPlace, RememberedPlaces
from golem.interfaces.payloads import Detections, Exposure, ModuleFaultMsg
from golem.middleware.bus import Bus, News
from golem.robots.base import STAMP_TOLERANCE, Robot
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.sensors.calibration import OPTICAL_FRAMES
from golem.runtime.checked import CheckedMemory
from golem.runtime.contract_check import ContractCheck
from golem.runtime.executor import Node
from golem.types import TICK, Array, BaseEstimate, LocalizedObject, LowState, Mask, RgbdImage

LATENCY = 0.033
"""Time from exposure to the frame being available [s]: one frame period of a D400 at 30 Hz."""
MEMORY = 1.0
"""How old an exposure may be when its frame arrives [s]."""


class CameraNode(Node):
    """Exposes one camera at its frame rate while somebody wants its frames."""

    def __init__(self, bus: Bus, robot: Robot, name: str, wanted: Callable[[], bool], contract: ContractCheck) -> None:
        """Expose camera `name` whenever `wanted()` is true at its time."""
        self._bus, self._robot, self._info, self._contract = bus, robot, robot.cameras[name], contract
        self._wanted = wanted
        self.period = 1.0 / self._info.rate

    def step(self, t: float) -> None:
        if self._wanted():
            rgb, depth = self._contract.call(self._robot.capture, self._info.name)
            self._bus.publish(topics.exposures(self._info.name), Exposure(t, self._info, rgb, depth), t)


class ImagePoseNode(Node):
    """Gives each exposure the pose the robot believes the camera had when it was made."""

    def __init__(self, bus: Bus, calibration: Mapping[str, Array], latency: float) -> None:
        """Serve the cameras of `calibration` (see `Robot.calibration`); frames take another `latency` [s].

        Without a latency exposures come over a network, and are older than what is known here: the node then remembers
        every tick.
        """
        self._bus, self._calibration, self._latency = bus, calibration, latency
        self.period = TICK if latency == 0.0 else math.inf
        self.wakes = tuple(map(topics.exposures, calibration))
        self._exposures = {name: News(bus, topics.exposures(name)) for name in calibration}
        self._kinematics = Kinematics()
        self._moments: deque[tuple[LowState, BaseEstimate]] = deque()

    def step(self, t: float) -> None:
        state = self._bus.latest(topics.LOW_STATE)
        base = self._bus.latest(topics.BASE)
        if state is None or base is None:
            return
        moments = self._moments
        moments.append((state, base))
        while len(moments) > 1 and moments[0][0].t < t - MEMORY:
            moments.popleft()
        for name, news in self._exposures.items():
            exposure = news.read()
            if exposure is not None and moments[0][0].t <= exposure.t + STAMP_TOLERANCE:
                pose = self._pose(name, exposure.t)
                frame = RgbdImage(exposure.t, exposure.info, exposure.rgb, exposure.depth, pose)
                self._bus.publish(topics.rgbd_images(name), frame, t, self._latency)

    def _pose(self, name: str, t: float) -> Array:
        """Return the (4, 4) pose in odom of a camera's optical frame at time `t` [s]."""
        # Newest first: it is the newest unless the exposure came from afar.
        state, base = next(m for m in reversed(self._moments) if m[0].t <= t + STAMP_TOLERANCE)
        self._kinematics.update(state.q)
        T_base_optical = self._kinematics.pose(OPTICAL_FRAMES[name]) @ self._calibration[name]
        return base.T_odom_base @ T_base_optical


class LocalizerNode(Node):
    """Runs the localizer on every new frame of one camera; live, beside the clock, on a thread of its own.

    A fault of it ends the skill that looks, and nothing else: no robot falls over a label that nobody knows.
    """

    def __init__(
        self, bus: Bus, localizer: Localizer, camera: str, contract: ContractCheck, pool: Executor | None = None
    ) -> None:
        """Run a localizer in `pool`; None is here, at the price of the latency that it declares."""
        self._bus, self._localizer, self._camera, self._contract = bus, localizer, camera, contract
        self._latency = contract.number("latency", localizer.latency, minimum=0.0) if pool is None else 0.0
        contract.times.allowed = math.inf if pool is not None else max(self._latency, TICK)
        self.period = TICK if pool is not None else math.inf
        self.wakes = (topics.rgbd_images(camera),)
        self._frames = News(bus, topics.rgbd_images(camera))
        self._pool = pool
        self._job: tuple[Future[Detections], tuple[str, ...]] | None = None

    def step(self, t: float) -> None:
        if self._job is not None:
            job, labels = self._job
            if not job.done():
                return
            self._job = None
            self._tell(job.result, labels, t)
        frame, labels = self._frames.read(), self._wanted()
        if frame is None or not labels:
            return
        if self._pool is not None:
            self._job = self._pool.submit(self._locate, frame, labels), labels
            return
        self._tell(lambda: self._locate(frame, labels), labels, t)

    def _wanted(self) -> tuple[str, ...]:
        request = self._bus.latest(topics.detection_request(self._camera))
        return () if request is None else request.labels

    def _tell(self, found: Callable[[], Detections], labels: tuple[str, ...], t: float) -> None:
        """Publish what was found, or, if `labels` are still looked for, that the localizer failed."""
        try:
            self._bus.publish(topics.detections(self._camera), found(), t, self._latency)
        except ModuleFault as fault:
            if labels == self._wanted():
                self._bus.publish(topics.MODULE_FAULT, _message(fault), t)
        except (MissingExtra, MissingSystemLibrary) as lack:
            if self._pool is None:
                raise
            self._bus.publish(topics.MODULE_FAULT, ModuleFaultMsg(self._contract.slot, str(lack)), t)

    def _locate(self, frame: RgbdImage, labels: tuple[str, ...]) -> Detections:
        objects = self._contract.call(lambda: tuple(self._localizer.locate(frame, labels)))
        for o in objects:
            self._contract.kind("a located object", o, LocalizedObject)
            self._contract.array("position", o.position, 3)
            self._contract.array("points", o.points, None, 3)
            if o.mask is not None:
                self._check_mask(self._contract.kind("mask", o.mask, Mask), len(o.points))
        return Detections(frame.t, self._camera, objects, labels, frame)

    def _check_mask(self, mask: Mask, points: int) -> None:
        count = self._contract.call(np.count_nonzero, mask.pixels)
        if count != points:
            raise self._contract.fault(f"mask has {count} pixels, the contract asks for one per point: {points}")


def _message(fault: ModuleFault) -> ModuleFaultMsg:
    """Return what a localizer did; a label that it does not know is the user's error, by the contract."""
    if isinstance(fault.__cause__, ConfigError):
        return ModuleFaultMsg(None, str(fault.__cause__), "refused")
    return ModuleFaultMsg(fault.slot, str(fault), trace=fault.trace)


def detection_requested(bus: Bus, camera: str) -> Callable[[], bool]:
    """Return whether a skill, or who records, wants the frames of a camera of its own process."""

    def wanted() -> bool:
        request = bus.latest(topics.detection_request(camera))
        return (request is not None and bool(request.labels)) or camera in (bus.latest(topics.CAMERAS_WANTED) or ())

    return wanted


SIGMA = 0.02
"""Standard deviation of a frame's position where nobody says [m]: the memory's own default."""

SHOWN = 40
"""Most places that are shown to people, those seen last."""


class MemoryNode(Node):
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
        pool: Executor | None = None,
    ) -> None:
        """Feed a memory.

        Args:
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

    def sleep(self, seconds: float, t: float) -> None:
        """Let time pass by the memory's clock alone, at time `t` [s], as if the robot had been off."""
        self._epoch += seconds
        self._tell(t, "", t, looks=0)

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
