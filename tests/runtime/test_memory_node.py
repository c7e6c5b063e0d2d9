"""Looks go into the memory at places that stay, with times that go on."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from golem.capabilities.memory.base import MemoryFault, Observation
from golem.capabilities.memory.object_map import ObjectMap, ObjectMapConfig
from golem.evaluation.conformance.memory_suite import look
from golem.interfaces import topics
from golem.interfaces.memory_payloads import MemoryStatus
from golem.interfaces.nav_payloads import MapPlace
from golem.interfaces.payloads import Detections, Odometry
from golem.middleware.bus import Bus
from golem.runtime.checked import CheckedMemory
from golem.runtime.contract_check import ContractCheck
from golem.runtime.perception_nodes import MemoryNode
from golem.types import PlanarPose


class Rig:
    """A memory, its node, and a localizer that finds a mug in every frame."""

    def __init__(
        self,
        in_map: bool = False,
        epoch: float = 0.0,
        memory: ObjectMap | None = None,
        pool: ThreadPoolExecutor | None = None,
    ) -> None:
        self.bus = Bus()
        self.module = ObjectMap() if memory is None else memory
        self.memory = CheckedMemory(self.module, ContractCheck("memory", "object_map"))
        self.node = MemoryNode(self.bus, self.memory, ("head", "right_hand"), in_map, epoch, pool)

    def see(self, t: float, camera: str = "head", at: float = 0.0) -> Observation:
        seen = look(t, at=np.array([at, 0.0, 0.0]))
        found = Detections(t, camera, tuple(seen.objects), tuple(seen.labels), seen.frame)
        self.bus.publish(topics.detections(camera), found, t)
        return seen

    @property
    def status(self) -> MemoryStatus:
        status = self.bus.latest(topics.MEMORY_STATUS)
        assert status is not None
        return status


def test_it_tells_of_itself_before_the_first_look() -> None:
    rig = Rig()
    rig.node.step(0.5)
    assert rig.status == MemoryStatus(0.5, "odom", 0.0, 0)


def test_what_was_looked_for_is_remembered_where_it_is() -> None:
    rig = Rig()
    seen = rig.see(1.0)
    rig.node.step(1.05)
    (place,) = rig.memory.query("mug")
    assert place.position == pytest.approx(seen.objects[0].position, abs=0.001) and place.last_seen == 1.0
    assert rig.status == MemoryStatus(1.0, "odom", 0.0, 1)
    rig.node.step(1.1)
    assert rig.status.looks == 1  # one look counts once


def test_what_is_remembered_is_shown_with_its_age() -> None:
    rig = Rig(epoch=1000.0)
    for t in (1.0, 2.0):
        rig.see(t)
        rig.node.step(t)
    rig.see(4.0, at=5.0)  # elsewhere: the first one is looked through, or not in view
    rig.node.step(4.5)
    shown = rig.bus.latest(topics.MEMORY_PLACES)
    assert shown is not None and shown.frame == "odom"
    ages = {round(place.age, 3) for place in shown.places}
    assert ages <= {0.5, 2.5} and len(shown.places) >= 1


def test_a_day_passes_for_the_memory_alone() -> None:
    rig = Rig()
    seen = rig.see(1.0)
    rig.node.step(1.05)
    rig.node.sleep(86_400.0, 1.1)
    assert rig.status.epoch == 86_400.0 and rig.status.looks == 1
    rig.see(2.0, at=0.5)
    rig.node.step(2.05)
    (then,) = rig.memory.query("mug", "at", 10.0)
    assert then.position == pytest.approx(seen.objects[0].position, abs=0.001)
    assert rig.memory.query("mug")[0].last_seen == 86_402.0


def test_what_was_looked_for_and_is_not_there_is_doubted() -> None:
    rig = Rig()
    rig.see(1.0)
    rig.node.step(1.0)
    empty = look(2.0)
    # The floor is seen through where the mug stood: the whole picture is two metres away.
    frame = replace(empty.frame, depth=np.full_like(empty.frame.depth, 2.0))
    for labels, evidence in (((), "seen"), (("bowl",), "seen"), (("mug",), "moved")):
        t = rig.status.t + 1.0
        found = Detections(t, "head", (), labels, replace(frame, t=t))
        rig.bus.publish(topics.detections("head"), found, t)
        rig.node.step(t)
        assert rig.memory.query("mug")[0].evidence == evidence


def test_places_are_the_maps_and_wait_for_it() -> None:
    rig = Rig(in_map=True)
    rig.see(1.0)
    rig.node.step(1.0)
    assert rig.memory.query("mug") == [] and rig.status == MemoryStatus(1.0, "map", 0.0, 0)
    T_map_estimate = PlanarPose(3.0, -1.0, np.pi / 2)
    rig.bus.publish(topics.MAP_POSE, MapPlace(1.5, PlanarPose(0.0, 0.0, 0.0), T_map_estimate), 1.5)
    rig.bus.publish(topics.ODOMETRY, Odometry(1.5, np.eye(4), None, 0.01 * np.eye(6)), 1.5)
    x, y, z = rig.see(2.0).objects[0].position
    rig.node.step(2.0)
    (place,) = rig.memory.query("mug")
    assert place.position == pytest.approx((3.0 - y, -1.0 + x, z), abs=0.001)
    assert place.facts["sigma"] >= 0.1  # the odometry's own doubt


def test_the_earlier_of_two_cameras_looks_is_left_out_when_it_comes_later() -> None:
    rig = Rig()
    rig.see(2.0)
    rig.node.step(2.0)
    rig.see(1.9, "right_hand")
    rig.node.step(2.1)
    assert rig.status == MemoryStatus(2.0, "odom", 0.0, 1)
    rig.see(2.2, "right_hand")
    rig.see(2.3)
    rig.node.step(2.4)
    assert rig.status.looks == 3 and not rig.status.problem


def test_times_go_on_where_a_file_ends(tmp_path: Path) -> None:
    def opened() -> ObjectMap:
        return ObjectMap(ObjectMapConfig(file=str(tmp_path / "memory.sqlite")))

    rig = Rig(memory=opened())
    rig.see(50.0)
    rig.node.step(50.0)
    rig.memory.close()
    again = Rig(memory=opened())  # of a robot whose clock begins anew
    again.see(1.0, at=4.0)
    again.node.step(1.0)
    assert [place.last_seen for place in again.memory.query("mug")] == [51.0, 50.0]
    assert again.status.epoch == 50.0
    again.memory.close()
    live = Rig(memory=opened(), epoch=1.8e9)
    live.node.step(0.0)
    assert live.status.epoch == 1.8e9


def test_a_look_that_is_refused_ends_nothing() -> None:
    rig = Rig()
    seen = rig.see(1.0)
    nowhere = replace(seen.objects[0], position=np.full(3, np.nan))
    bad = Detections(2.0, "head", (nowhere,), ("mug",), seen.frame)
    rig.node.step(1.0)
    rig.bus.publish(topics.detections("head"), bad, 2.0)
    rig.node.step(2.0)
    assert "position of a mug" in rig.status.problem and rig.status.looks == 1
    rig.see(3.0)
    rig.node.step(3.0)
    assert not rig.status.problem and rig.status.looks == 2


def test_a_module_that_raises_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig()

    def broken(observation: Observation) -> None:
        raise ZeroDivisionError("my bug")

    monkeypatch.setattr(rig.module, "observe", broken)
    rig.see(1.0)
    rig.node.step(1.0)
    assert "object_map" in rig.status.problem and "my bug" in rig.status.problem


def test_live_it_thinks_beside_the_clock() -> None:
    with ThreadPoolExecutor(1) as pool:
        rig = Rig(pool=pool)
        rig.see(1.0)
        rig.node.step(1.0)
        pool.submit(lambda: None).result()  # after the look
        rig.node.step(1.1)
        assert rig.status == MemoryStatus(1.0, "odom", 0.0, 1)


def test_what_a_memory_refuses_goes_further_as_it_is() -> None:
    with pytest.raises(MemoryFault, match="empty"):
        Rig().memory.query(" ")
