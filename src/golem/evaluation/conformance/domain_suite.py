"""The suite of a robot on a domain: what it says, what every robot is measured by, and what stops it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from golem.evaluation.conformance.base import Candidate, check, gate
from golem.evaluation.conformance.domain_rig import DomainRig
from golem.evaluation.conformance.domain_stops import DomainStops, judge
from golem.evaluation.conformance.robot_measures import RobotMeasures
from golem.evaluation.conformance.robot_rig import RobotRig
from golem.interfaces import public
from golem.interfaces.ros_convert import seconds
from golem.interfaces.rows import TopicRow
from golem.middleware.dds import discovery
from golem.middleware.ros import names
from golem.middleware.ros.codec import dds_name
from golem.runtime.bringup.base import Workbench
from golem.runtime.bringup.listening_checks import check_domain, check_state
from golem.runtime.bringup.sensor_checks import check_sensors

OWN_COMPUTER = ("/onboard/lowcmd", "/api/loco/response", "/api/sport/response")
"""What a robot offers only where its own legs are used."""
DISCOVERY = 30.0
"""How long topics are waited for [s]: a simulation starts its cameras after its motors."""
STALE, EARLY = 0.5, 0.05
"""How old a stamp may be when its message comes, and how far ahead of the robot's time it may be [s]."""
STAMPED = ("/livox/imu", "/left/gripper/state", "/right/gripper/state", "/realsense/head/color/camera_info")


class DomainListening:
    """What a robot on a domain promises to whoever only listens."""

    def __init__(self, session: DomainRig) -> None:
        """Ask the robot of `session`."""
        self.session = session

    @property
    def bench(self) -> Workbench:
        """What the checks of a bring-up work with."""
        return self.session.bench

    @gate
    def is_alone(self, candidate: Candidate) -> None:
        """One robot is on the domain, and neither gate nor stack commands it."""
        judge(candidate, check_domain(self.bench))

    @gate
    def offers_its_topics(self, candidate: Candidate) -> None:
        """Every topic that a gate or a stack reads of it is offered, with the type of the table."""
        without = self.bench.config.without
        rows = [r for r in public.TOPICS if r.by == "robot" and _needed(r) and not _absent(r.name, without)]
        candidate.figures["topics [1]"] = float(len(rows))
        offered: dict[str, set[str]] = {}

        def complete() -> bool:
            offered.clear()
            for writer in discovery.writers(self.session.participant):
                offered.setdefault(writer.topic, set()).add(writer.type_name)
            return all(names.topic(row.name) in offered for row in rows)

        self.bench.link.spin(DISCOVERY, complete)
        for row in rows:
            kinds = offered.get(names.topic(row.name))
            if kinds is None:
                raise candidate.fault(f"{row.name} is not offered; is its driver running?")
            if dds_name(row.type) not in kinds:
                raise candidate.fault(f"{row.name} is {min(kinds)}, the table says {dds_name(row.type)}")

    @check
    def reports_its_state(self, candidate: Candidate) -> None:
        """Its state comes at 500 Hz with sound checksums, says what can be true, and its stamps rise by 2 ms."""
        link = self.bench.link
        link.states.clear()
        link.spin(
            DISCOVERY, lambda: len(link.states) > 100
        )  # a simulation stands still while its cameras start
        judge(candidate, check_state(self.bench))
        steps = np.diff([state.t for _, state in link.states])
        candidate.figures["longest step of the stamps [s]"] = float(steps.max())
        if steps.min() < 0.0015:
            raise candidate.fault(f"stamps of the state rise by {1e3 * steps.min():.1f} ms")

    @check
    def devices_deliver(self, candidate: Candidate) -> None:
        """Cameras, LiDAR and hands deliver images, points and openings of their size and at their rate."""
        judge(candidate, check_sensors(self.bench))

    @check
    def stamps_by_its_own_time(self, candidate: Candidate) -> None:
        """Messages of its devices are stamped with the time of its state."""
        link = self.bench.link
        for name in STAMPED:
            if _absent(name, self.bench.config.without):
                continue
            row, ages = public.topic(name, by="robot"), list[float]()

            def add(message: object, ages: list[float] = ages) -> None:
                ages.append(link.states[-1][1].t - seconds(message.header.stamp))  # type: ignore[attr-defined]

            subscription = link.node.subscription(row.name, row.type, add, row.qos)
            link.spin(10.0, lambda ages=ages: len(ages) >= 5)  # type: ignore[misc]
            subscription.close()
            if not ages:
                raise candidate.fault(f"{name} is silent")
            candidate.figures[f"{name} age [s]"] = float(np.median(ages))
            if not -EARLY <= np.median(ages) <= STALE:
                raise candidate.fault(f"{name} is stamped {np.median(ages):+.3f} s before the robot's time")


class DomainSuite(DomainStops, RobotMeasures, DomainListening):
    """The promises of a robot on a domain. The last ones end its gate."""

    @contextmanager
    def rig(self, candidate: Candidate) -> Iterator[RobotRig]:
        """Return the robot; it moves where somebody confirms that it may."""
        yield self.session


def _needed(row: TopicRow) -> bool:
    return bool({"stack", "safety"} & set(row.to)) and row.name not in OWN_COMPUTER


def _absent(topic: str, without: tuple[str, ...]) -> bool:
    """Return whether a topic is of a device that was declared absent."""
    parts = topic.strip("/").split("/")
    device = {"realsense": f"{parts[1] if len(parts) > 1 else ''} camera", "livox": "lidar"}
    return device.get(parts[0], f"{parts[0]} hand") in without
