"""What an odometry promises: see `golem.capabilities.odometry.base`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from golem.capabilities.odometry.base import SOURCES, LidarOdometry, OdometryEstimate
from golem.evaluation.conformance.base import Candidate, check
from golem.evaluation.conformance.room import ROOM, MadeWalk, Reading
from golem.evaluation.conformance.samples import with_nan
from golem.evaluation.conformance.suite import Suite, check_fields
from golem.interfaces.lidar import ExternalOdometry, LegOdometry, LidarImu, LidarScan
from golem.runtime.contract_check import ContractCheck

SECONDS = 2.6
"""Length of the walk; the robot stands for 1.5 s of it."""
TENTH = 0.1
"""Time of one input [s]."""
STANDING = 15
"""Inputs during which it stands."""
OFF = 0.15
"""How far a robot that stands may seem to have moved [m] [own: ICP on the points of one scan]."""
LEVEL = 0.1
"""By how much its odom may be tilted [rad] [own]."""
OLD = 0.2
"""Age that an estimate may have [s]."""
Tenth = tuple[Reading, ...]


class OdometrySuite(Suite):
    """Inputs are what is said in a tenth of a second, answers where the robot is at its end, or nothing."""

    slot, contracts = "odometry", (LidarOdometry,)
    takes = TENTH

    def declared(self, contract: ContractCheck, module: Any) -> None:
        """Check what it goes by."""
        if not module.sources or set(module.sources) - set(SOURCES):
            raise contract.fault(f"sources is {module.sources!r}; it names some of {', '.join(SOURCES)}")

    def inputs(self) -> Sequence[Tenth]:
        """Return a robot that stands and sets out."""
        return list(_readings())

    def edges(self) -> Mapping[str, Sequence[Tenth]]:
        """Return a gap, scans without points, without end, of another clock, frozen ones, and none."""
        walk = self.inputs()
        return {
            "no scan for half a second": [_scans(x, lambda s: None) if 18 <= i < 23 else x for i, x in enumerate(walk)],
            "no scan at all": [_scans(x, lambda s: None) for x in walk],
            "scans without points": [
                _scans(x, lambda s: replace(s, points=s.points[:0], offsets=s.offsets[:0])) for x in walk
            ],
            "a scan of another clock": [_scans(x, lambda s: replace(s, t=s.t + 1e6)) for x in walk],
            "the same scan again and again": [(*x, *(r for r in walk[17] if isinstance(r, LidarScan))) for x in walk],
            "no IMU": [tuple(r for r in x if not isinstance(r, LidarImu)) for x in walk],
            "no legs": [tuple(r for r in x if not isinstance(r, LegOdometry)) for x in walk],
        }

    def spoiled(self) -> Mapping[str, Tenth]:
        tenth = self.inputs()[3]
        changes: dict[str, Any] = {
            "the gyro": lambda r: replace(r, gyro=with_nan(r.gyro)) if isinstance(r, LidarImu) else r,
            "the accelerometer": lambda r: replace(r, acc=with_nan(r.acc)) if isinstance(r, LidarImu) else r,
            "the legs' velocity": lambda r: (
                replace(r, velocity=with_nan(r.velocity)) if isinstance(r, LegOdometry) else r
            ),
            "the legs' pose": lambda r: (
                replace(r, T_odom_base=with_nan(r.T_odom_base)) if isinstance(r, LegOdometry) else r
            ),
            "a point": lambda r: (
                replace(r, points=with_nan(r.points.astype(np.float64)).astype(np.float32))
                if isinstance(r, LidarScan)
                else r
            ),
            "the odometry from outside": lambda r: (
                replace(r, T_frame_child=with_nan(r.T_frame_child)) if isinstance(r, ExternalOdometry) else r
            ),
        }
        return {where: tuple(map(change, tenth)) for where, change in changes.items()}

    def begin(self, module: LidarOdometry, first: Tenth) -> None:
        module.reset()

    def call(self, module: LidarOdometry, given: Tenth) -> OdometryEstimate | None:
        """Return what it says after a tenth of a second."""
        for reading in given:
            if isinstance(reading, LidarImu):
                module.add_imu(reading)
            elif isinstance(reading, LegOdometry):
                module.add_legs(reading)
            elif isinstance(reading, LidarScan):
                module.add_scan(reading)
            else:
                module.add_external(reading)
        return module.estimate()

    def judge(self, contract: ContractCheck, answer: Any) -> None:
        if answer is None:
            return
        contract.kind("the estimate", answer, OdometryEstimate)
        contract.number("t", answer.t)
        for name in ("T_odom_base", "T_base_lidar"):
            T = contract.array(name, getattr(answer, name), 4, 4)
            if np.abs(T[:3, :3] @ T[:3, :3].T - np.eye(3)).max() > 1e-3:
                raise contract.fault(f"{name} is not a rigid transform")
        check_fields(contract, answer, velocity=(3,), rate=(3,))
        P = answer.covariance
        if not isinstance(P, np.ndarray) or P.shape != (6, 6):
            raise contract.fault("covariance is no array of shape (6, 6)")
        if not np.isnan(P).all():
            contract.array("covariance", P, 6, 6)
            if np.linalg.eigvalsh(0.5 * (P + P.T)).min() < -1e-12:
                raise contract.fault("covariance is not positive")

    @check
    def stays_where_the_robot_stands(self, candidate: Candidate) -> None:
        """While the robot stands in an empty room it stays within 15 cm of where it began, and level."""
        answers = self.answers_of(candidate)[:STANDING]
        for answer in answers:
            if answer is not None and np.linalg.norm(answer.T_odom_base[:3, 3]) > OFF:
                raise candidate.fault(f"it is at {answer.T_odom_base[:3, 3].round(3)} m while the robot stands")
            if answer is not None and answer.T_odom_base[2, 2] < np.cos(LEVEL):
                raise candidate.fault("its odom is not level")

    @check
    def notices_that_the_robot_walks(self, candidate: Candidate) -> None:
        """It speaks of a robot that walks through an empty room, and moves with it."""
        last, before = self.answers_of(candidate)[-1], self.answers_of(candidate)[-6]
        if last is None or before is None:
            raise candidate.fault("it is silent in an empty room")
        if np.linalg.norm(last.T_odom_base[:3, 3] - before.T_odom_base[:3, 3]) < 1e-3:
            raise candidate.fault("it stays where it is while the robot walks")

    @check
    def begins_at_the_origin(self, candidate: Candidate) -> None:
        """Its first pose is that of odom: at the origin, heading along x."""
        first = next((answer for answer in self.answers_of(candidate) if answer is not None), None)
        if first is None:
            raise candidate.fault("it never says anything")
        T = first.T_odom_base
        if np.linalg.norm(T[:3, 3]) > OFF or abs(np.arctan2(T[1, 0], T[0, 0])) > 0.02:
            raise candidate.fault(f"it begins at {T[:3, 3].round(3)} m")

    @check
    def says_why_it_is_silent(self, candidate: Candidate) -> None:
        """While it says no pose, it says why."""
        module = candidate.make()
        module.reset()
        if module.estimate() is None and not candidate.contract.call(lambda: module.why):
            raise candidate.fault("it is silent and does not say why")

    @check
    def stamps_are_of_now(self, candidate: Candidate) -> None:
        """An estimate is never from the future, nor older than 0.2 s."""
        for i, answer in enumerate(self.answers_of(candidate)):
            now = TENTH * (i + 1)
            if answer is not None and not now - OLD <= answer.t <= now + 1e-6:
                raise candidate.fault(f"at {now:.1f} s its estimate is stamped {answer.t:.3f} s")


@lru_cache(maxsize=1)
def _readings() -> tuple[Tenth, ...]:
    return tuple(tuple(tenth) for tenth in MadeWalk(ROOM, every=5).tenths(SECONDS))


def _scans(tenth: Tenth, change: Any) -> Tenth:
    """Return a tenth in which every scan is another, or none."""
    changed = (change(r) if isinstance(r, LidarScan) else r for r in tenth)
    return tuple(r for r in changed if r is not None)
