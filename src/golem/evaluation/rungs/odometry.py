"""Rung `odometry`: odometries on the same recorded walks, against the simulator's truth."""

from __future__ import annotations

import time
from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from golem import registry
from golem.capabilities.odometry.base import LidarOdometry, OdometryEstimate
from golem.evaluation.base import DONE, Key, Rung, TrialOutcome, TrialSpec
from golem.evaluation.episodes import lidar_walk
from golem.evaluation.episodes.episode import legs_stack
from golem.evaluation.harness.arguments import new_module
from golem.interfaces import lidar_convert, public
from golem.interfaces.lidar import ExternalOdometry, LegOdometry, LidarImu, LidarScan
from golem.middleware.bags.base import BagMessage
from golem.middleware.bags.recorder import topic
from golem.middleware.ros import codec
from golem.provenance import stack_facts
from golem.runtime.contract_check import ContractCheck
from golem.types import Array

TRUTH = "/truth/odom"
"""Topic of the true pose of base_link in odom."""
ODOMETRY = "nav_msgs/msg/Odometry"
EVERY = 5
"""One report of the legs in so many is written: 100 per second."""
NO_COVARIANCE: Array = np.zeros((6, 6))


class WalkBag:
    """One bag. Times are the robot's: log times begin where the walk does."""

    def __init__(self, folder: Path, walk: lidar_walk.LidarWalk) -> None:
        """Begin the bag `folder` for `walk`. Raises MissingExtra, OutputError: there can be no such bag."""
        from golem.middleware.bags.writer import BagConfig, BagWriter  # the extra `record`: no other rung needs it

        kinds = {name: public.topic(name).type for name in public.LIDAR}
        self._topics = {name: topic(name, kind) for name, kind in {**kinds, "/odom": ODOMETRY, TRUTH: ODOMETRY}.items()}
        self._walk, self._legs = walk, 0
        about = {"seed": str(walk.seed), "profile": walk.profile, "lost": walk.lost}
        self._writer = BagWriter(folder, BagConfig(compression="zstd"), about)

    def write(self, reading: LidarImu | LegOdometry | LidarScan) -> None:
        """Write one reading; with the legs goes what is true. Raises OutputError: it cannot be written."""
        if isinstance(reading, LidarImu):
            self._write("/livox/imu", lidar_convert.imu(reading), reading.t)
        elif isinstance(reading, LidarScan):
            self._write("/livox/pointcloud", lidar_convert.cloud(reading), reading.t)
            self._write("/livox/lidar", lidar_convert.custom(reading), reading.t)
        else:
            self._legs += 1
            if self._legs % EVERY == 0:
                said = (reading.T_odom_base, reading.velocity, reading.rate)
                self._odometry("/odom", reading.t, *said)
                self._odometry(TRUTH, reading.t, self._walk.true_pose(reading.t), np.zeros(3), np.zeros(3))

    def close(self) -> None:
        """Finish the bag; closing twice does nothing."""
        self._writer.close()

    def _odometry(self, name: str, t: float, T: Array, velocity: Array, rate: Array) -> None:
        message = lidar_convert.odometry(ExternalOdometry(t, T, velocity, rate, NO_COVARIANCE, public.BASE_FRAME))
        message.header.frame_id = "odom"
        self._write(name, message, t)

    def _write(self, name: str, message: Any, t: float) -> None:
        at = round(1e9 * t)
        self._writer.write(BagMessage(self._topics[name], at, at, codec.serialize(message)))


SLOT = "odometry"
"""What the methods of this rung are."""
CaseName = Literal["hall-6m", "hall-60m", "corridor-20m", "people", "dropout", "mount", "gap"]
Reading = LidarImu | LegOdometry | LidarScan


@dataclass(frozen=True, slots=True)
class Condition:
    """What one case is.

    Attributes:
        route: where the robot walks.
        ate: absolute trajectory error up to which it is a success [m].
        end: error at the end up to which it is one [m].
        share: the same as a share of the way.
        dropout: share of the points that is lost; None: the profile's.
        mount: angle by which the LiDAR is turned on its mount [rad]; None: the profile's draw.
        gap: times between which no scan comes [s].
    """

    route: lidar_walk.Route
    ate: float = np.inf
    end: float = np.inf
    share: float = np.inf
    people: int = 0
    dropout: float | None = None
    mount: float | None = None
    gap: tuple[float, float] = (np.inf, np.inf)


ROOM = 0.005
"""Trajectory error up to which 6 m in a room are a success [m]."""
CONDITIONS: dict[CaseName, Condition] = {
    "hall-6m": Condition("line", ate=ROOM),
    "hall-60m": Condition("loop", share=0.002),
    "corridor-20m": Condition("corridor", end=0.1),
    "people": Condition("line", ate=ROOM, people=3),
    "dropout": Condition("line", ate=ROOM, dropout=0.3),
    "mount": Condition("line", ate=ROOM, mount=float(np.radians(1.0))),
    "gap": Condition("line", ate=ROOM, gap=(8.0, 9.0)),
}
"""Every case by name."""


@dataclass(frozen=True)
class OdometryOptions:
    """The walks."""

    case: tuple[CaseName, ...] = ("hall-6m",)
    """Where and under what the robot walks: 6 m or 60 m through the hall, 20 m along a corridor without features; or
    the 6 m with 3 people walking about, 3 of 10 points lost, the LiDAR turned by 1 deg, no scan for 1 s."""
    legs: str = "almi"
    """The lower body that walks."""
    bags: str = ""
    """Folder for a bag of every walk and case, to be replayed into any other odometry: LiDAR, legs, truth. A bag that
    is there already stays as it is."""


class OdometryRung(Rung[OdometryOptions]):
    """Follow a robot that walks 6, 20 or 60 m by LiDAR, its IMU and the legs: trajectory, end, honesty, CPU time.

    Every odometry hears the same scans, IMU samples and legs. It is anchored where it believes the robot to stand in
    the last second before the walk.
    """

    name = "odometry"
    varied = {"case": "case"}
    Options = OdometryOptions
    default_methods = ("lio", "legs")
    default_n = 20

    def methods(self) -> tuple[str, ...]:
        """Return the registered odometries of this stack's own."""
        return tuple(name for name in registry.names(SLOT) if name != "topic")

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        walking = legs_stack(self.options.legs, profile, overrides)
        new_module(SLOT, method)
        facts = stack_facts(walking.with_choice(SLOT, method))
        return {**facts, "cases": {name: _plain(CONDITIONS[name]) for name in self.options.case}}

    def together(self, spec: TrialSpec) -> Hashable:
        condition = _condition(spec)
        return spec.index, condition.route, condition.people

    def run_together(self, specs: Sequence[TrialSpec]) -> Sequence[TrialOutcome]:
        """Let the robot walk once, and odometries hear what its sensors said under each condition."""
        first, condition = specs[0], _condition(specs[0])
        walk = lidar_walk.record_walk(first, condition.route, condition.people, self.options.legs, self.onlooker)
        outcomes: dict[Key, TrialOutcome] = {}
        for name in dict.fromkeys(spec.case["case"] for spec in specs):
            group = [spec for spec in specs if spec.case["case"] == name]
            heard = readings(walk, group[0])
            folder = Path(self.options.bags) / f"{name}-{first.seed}-{first.index}"
            if self.options.bags and not folder.exists():
                heard = kept(heard, walk, folder)
            found = follow(walk, heard, [spec.method for spec in group])
            for spec in group:
                outcomes[spec.key] = judge(spec, walk, found[spec.method])
        return [outcomes[spec.key] for spec in specs]


@dataclass
class Followed:
    """What became of one odometry on one walk.

    Attributes:
        told: what it said after each scan, with what was true then.
        cpu: CPU time of each scan that came, with all that came since the one before [s].
        silent: number of scans after which it said nothing, though it had spoken before.
        why: why it was silent last.
    """

    told: list[tuple[OdometryEstimate, Array]]
    cpu: list[float]
    silent: int = 0
    why: str = ""


def readings(walk: lidar_walk.LidarWalk, spec: TrialSpec) -> Iterator[Reading]:
    """Yield what the sensors said on a walk under the condition of a trial, in the order of arrival."""
    condition = _condition(spec)
    mount = None
    if condition.mount is not None:
        axis = spec.rng("mount").standard_normal(3)
        mount = np.eye(4)
        mount[:3, :3] = Rotation.from_rotvec(condition.mount * axis / np.linalg.norm(axis)).as_matrix()
    begin, end = condition.gap
    for reading in walk.play(mount=mount, dropout=condition.dropout):
        if not (isinstance(reading, LidarScan) and begin <= reading.t < end):
            yield reading


def kept(heard: Iterator[Reading], walk: lidar_walk.LidarWalk, folder: Path) -> Iterator[Reading]:
    """Yield what was `heard`, and write it to a bag. Raises MissingExtra, OutputError: there can be no bag."""
    with closing(WalkBag(folder, walk)) as bag:
        for reading in heard:
            bag.write(reading)
            yield reading


def follow(walk: lidar_walk.LidarWalk, heard: Iterator[Reading], methods: Sequence[str]) -> dict[str, Followed]:
    """Let new odometries follow a walk by what was `heard`, all at once; return what became of each."""
    contracts = {method: ContractCheck(SLOT, method) for method in methods}
    modules: dict[str, LidarOdometry] = {method: new_module(SLOT, method) for method in methods}
    found = {method: Followed([], []) for method in methods}
    spent = dict.fromkeys(methods, 0.0)
    for reading in heard:
        for method, module in modules.items():
            call, one = contracts[method].call, found[method]
            start = time.thread_time_ns()
            if isinstance(reading, LidarImu):
                call(module.add_imu, reading)
            elif isinstance(reading, LegOdometry):
                call(module.add_legs, reading)
            else:
                call(module.add_scan, reading)
                estimate = call(module.estimate)
                if estimate is not None:
                    contracts[method].array("T_odom_base", estimate.T_odom_base, 4, 4)
                    one.told.append((estimate, walk.true_pose(estimate.t)))
                    one.why = ""
                elif one.told:
                    one.silent, one.why = one.silent + 1, module.why
            spent[method] += 1e-9 * (time.thread_time_ns() - start)
            if isinstance(reading, LidarScan):
                one.cpu.append(spent[method])
                spent[method] = 0.0
    return found


def judge(spec: TrialSpec, walk: lidar_walk.LidarWalk, found: Followed) -> TrialOutcome:
    """Return how well an odometry followed."""
    module = f"{SLOT}: {spec.method}"
    cpu = found.cpu or [0.0]
    costs = {"frame": float(np.median(cpu)), "frame_p99": float(np.quantile(cpu, 0.99))}
    if not found.told:
        detail = found.why or "It never said anything."
        return TrialOutcome(False, "silent", module, detail, costs=costs)
    condition, track = _condition(spec), lidar_walk.PoseTrack.of(found.told).anchored(lidar_walk.START)
    end, height, heading = lidar_walk.end_error(track)
    series = {
        "ate": lidar_walk.ate(track),
        "end_error": end,
        "end_height": height,
        "end_heading": heading,
        "distance": walk.distance,
        "drift": end / max(walk.distance, 1e-9),
        "frames_lost": float(found.silent),
    }
    split = lidar_walk.range_and_bearing(track)
    if split is not None:
        series["end_range"], series["end_bearing"] = split
    honest = lidar_walk.nees(track, lidar_walk.START)
    if honest is not None:
        series["nees_place"], series["nees_heading"] = honest
    note = f"; the walk ended early: {walk.lost}" if walk.lost else ""
    if found.silent:
        note += f"; silent after {found.silent} of {len(found.cpu)} scans: {found.why or 'it spoke again'}"
    said = f"trajectory off by {100 * series['ate']:.2f} cm, end by {100 * end:.1f} cm{note}"
    if series["ate"] <= condition.ate and end <= condition.end and series["drift"] <= condition.share:
        return TrialOutcome(True, DONE, detail=said, series=series, costs=costs)
    lost = found.why and found.told[-1][0].t < walk.t[-1] - 1.0
    stage = "silent" if lost else "drift"
    return TrialOutcome(False, stage, module, f"{said[0].upper()}{said[1:]}.", series=series, costs=costs)


def _condition(spec: TrialSpec) -> Condition:
    return CONDITIONS[spec.case["case"]]  # pyright: ignore[reportArgumentType]


def _plain(condition: Condition) -> dict[str, Any]:
    """Return a condition as JSON has it, which knows no infinity."""
    return {k: str(v) if v in (np.inf, (np.inf, np.inf)) else v for k, v in asdict(condition).items()}
