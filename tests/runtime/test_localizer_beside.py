"""A localizer beside the clock: it holds nobody up, its faults arrive, and it finds the same."""

from __future__ import annotations

import re
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from golem.errors import MissingExtra, unknown_name
from golem.interfaces import topics
from golem.interfaces.payloads import DetectionRequest, ModuleFaultMsg
from golem.middleware.bus import Bus
from golem.robots.sensors.cameras import HEAD
from golem.runtime.contract_check import ContractCheck
from golem.runtime.perception_nodes import LocalizerNode
from golem.types import Detection, LocalizedObject, Mask, RgbdImage


class Eyes:
    """Finds one thing, once it is let."""

    latency = 0.5

    def __init__(self) -> None:
        self.let = threading.Event()
        self.calls = 0

    def locate(self, frame: RgbdImage, labels: Sequence[str]) -> list[LocalizedObject]:
        self.calls += 1
        assert self.let.wait(5.0)
        if labels[0] == "trouble":
            raise RuntimeError("gone")
        detection = Detection(labels[0], 1.0, np.zeros(4), np.zeros(2))
        return [LocalizedObject(detection, frame.t, np.zeros(3), np.zeros((1, 3)))]


def frame(t: float) -> RgbdImage:
    return RgbdImage(t, HEAD, np.zeros((2, 2, 3), np.uint8), np.zeros((2, 2), np.float32), np.eye(4))


def test_the_clock_goes_on_while_it_looks() -> None:
    bus, eyes = Bus(), Eyes()
    bus.publish(topics.detection_request("head"), DetectionRequest(("screw",)), 0.0)
    with ThreadPoolExecutor(1) as pool:
        node = LocalizerNode(bus, eyes, "head", ContractCheck("localizer", "eyes"), pool)
        bus.publish(topics.rgbd_images("head"), frame(1.0), 1.0)
        for tick in range(20):
            bus.publish(topics.rgbd_images("head"), frame(1.0 + 0.002 * tick), 1.0)
            node.step(1.0 + 0.002 * tick)
        assert bus.latest(topics.detections("head")) is None
        eyes.let.set()
        pool.submit(lambda: None).result()
        node.step(1.1)
        found = bus.latest(topics.detections("head"))
        assert found is not None and found.t == 1.0 and found.objects[0].label == "screw"
        pool.submit(lambda: None).result()
    assert eyes.calls == 2  # of what came meanwhile, the newest frame only


@pytest.mark.parametrize("still", [True, False], ids=["looked for", "given up"])
def test_its_fault_arrives_while_a_skill_looks(still: bool) -> None:
    bus, eyes = Bus(), Eyes()
    eyes.let.set()
    bus.publish(topics.detection_request("head"), DetectionRequest(("trouble",)), 0.0)
    with ThreadPoolExecutor(1) as pool:
        node = LocalizerNode(bus, eyes, "head", ContractCheck("localizer", "eyes"), pool)
        bus.publish(topics.rgbd_images("head"), frame(1.0), 1.0)
        node.step(1.0)
        if not still:
            bus.publish(topics.detection_request("head"), DetectionRequest(()), 1.001)
        pool.submit(lambda: None).result()
        node.step(1.002)
        fault = bus.latest(topics.MODULE_FAULT)
        assert (fault is not None) is still
        if fault is not None:
            assert re.fullmatch(
                r"Module localizer: eyes failed: RuntimeError: gone \(test_localizer_beside.py:\d+\)", fault.reason
            )
            assert fault.slot == "localizer" and 'raise RuntimeError("gone")' in (fault.trace or "")
        assert bus.latest(topics.detections("head")) is None


@pytest.mark.parametrize(
    ("mask", "said"),
    [
        (Mask(np.ones((1, 1), np.bool_), 0, 0), None),
        (Mask(np.ones((1, 2), np.bool_), 0, 0), "mask has 2 pixels, the contract asks for one per point: 1"),
        (np.ones((1, 1), np.bool_), "mask is a ndarray, the contract asks for a Mask"),
    ],
    ids=["one pixel", "two pixels", "no mask"],
)
def test_a_mask_that_does_not_fit_its_points_is_a_fault(mask: Any, said: str | None) -> None:
    class Masking(Eyes):
        def locate(self, frame: RgbdImage, labels: Sequence[str]) -> list[LocalizedObject]:
            return [replace(found, mask=mask) for found in super().locate(frame, labels)]

    bus, eyes = Bus(), Masking()
    eyes.let.set()
    bus.publish(topics.detection_request("head"), DetectionRequest(("screw",)), 0.0)
    node = LocalizerNode(bus, eyes, "head", ContractCheck("localizer", "eyes"))
    bus.publish(topics.rgbd_images("head"), frame(1.0), 1.0)
    node.step(1.0)
    fault = bus.latest(topics.MODULE_FAULT)
    assert (fault is None) if said is None else (fault is not None and said in fault.reason)


def test_what_this_machine_lacks_ends_the_look_and_not_the_process() -> None:
    class Lacking(Eyes):
        def locate(self, frame: RgbdImage, labels: Sequence[str]) -> list[LocalizedObject]:
            raise MissingExtra("torch", "train")

    bus = Bus()
    bus.publish(topics.detection_request("head"), DetectionRequest(("screw",)), 0.0)
    with ThreadPoolExecutor(1) as pool:
        node = LocalizerNode(bus, Lacking(), "head", ContractCheck("localizer", "eyes"), pool)
        bus.publish(topics.rgbd_images("head"), frame(1.0), 1.0)
        node.step(1.0)
        pool.submit(lambda: None).result()
        node.step(1.002)
    fault = bus.latest(topics.MODULE_FAULT)
    assert fault is not None and fault.slot == "localizer" and "torch" in fault.reason


def test_a_label_that_it_does_not_know_is_the_users_error() -> None:
    class Picky(Eyes):
        def locate(self, frame: RgbdImage, labels: Sequence[str]) -> list[LocalizedObject]:
            raise unknown_name("label", labels[0], ["screw"])

    bus = Bus()
    bus.publish(topics.detection_request("head"), DetectionRequest(("screws",)), 0.0)
    node = LocalizerNode(bus, Picky(), "head", ContractCheck("localizer", "eyes"))
    bus.publish(topics.rgbd_images("head"), frame(1.0), 1.0)
    node.step(1.0)
    said = "Unknown label 'screws'; valid: screw. Did you mean 'screw'?"
    assert bus.latest(topics.MODULE_FAULT) == ModuleFaultMsg(None, said, "refused")
