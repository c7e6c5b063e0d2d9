"""What a hand's error at one object says of the container."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from golem.capabilities.perception.open_box import OpenBox
from golem.interfaces.payloads import Detections
from golem.skills.container import Container
from golem.skills.hand_offset import shift_of
from golem.skills.pick_config import PickConfig, PickReport, Sight
from golem.skills.pick_place import look_after
from golem.skills.pick_targets import Attempt, PickChoice
from golem.types import Array, Detection, LocalizedObject

ROW = np.array([[0.43, y, -0.03] for y in (-0.2, -0.1, 0.0)])


@pytest.mark.parametrize(
    ("off", "shift"),
    [
        ((0.03, 0.019, 0.01), (0.03, 0.019, 0.01)),
        ((0.03, -0.04, 0.01), (0.03, 0.0, 0.01)),
        ((-0.02, 0.045, 0.0), (-0.02, 0.0, 0.0)),
    ],
)
def test_only_what_cannot_be_a_neighbour_counts(off: tuple[float, ...], shift: tuple[float, ...]) -> None:
    np.testing.assert_allclose(shift_of(ROW[1] + off, ROW[1], ROW), shift, atol=1e-12)


def test_a_single_object_has_no_neighbour() -> None:
    np.testing.assert_allclose(shift_of(ROW[0] + 0.05, ROW[0], ROW[:1]), [0.05] * 3)


BOX = OpenBox(np.array([0.5, -0.3]), 0.3, np.array([0.18, 0.24]), 0.058, 0.016)

AXES = np.array([[np.cos(BOX.yaw), -np.sin(BOX.yaw)], [np.sin(BOX.yaw), np.cos(BOX.yaw)]])


def view(seed: int, screw: bool = False, share: float = 1.0) -> Array:
    """Return (n, 3) what a camera shows of the box, off by 1.5 mm, with a screw on its floor or without."""
    rng = np.random.default_rng(seed)
    flat = rng.uniform(-0.12, 0.12, (int(20000 * share), 2))
    flat = flat[flat[:, 0] < 0.12 - 0.24 * (1.0 - share)]
    inside = (np.abs(flat @ AXES) < 0.5 * BOX.size - 0.004).all(axis=1)
    z = np.where(inside, 0.016, 0.056) + 0.010 * (
        screw & (np.abs(flat[:, 0] + 0.02) < 0.012) & (np.abs(flat[:, 1] - 0.01) < 0.012)
    )
    return np.column_stack([flat + BOX.center, z + rng.normal(0.0, 0.0015, len(flat))])


@pytest.fixture
def tray() -> Container:
    detection = Detection("tray", 0.9, np.zeros(4), np.zeros(2))
    return Container(LocalizedObject(detection, 0.0, np.array([*BOX.center, 0.016]), view(0)), BOX, 0.15)


def test_a_screw_that_was_dropped_rises_from_the_floor(tray: Container) -> None:
    assert tray.gained(view(1, screw=True)) is True
    assert tray.gained(view(1)) is False
    higher = view(1) + (0.0, 0.0, 0.02)
    assert tray.gained(higher) is False, "the whole view is off"


@pytest.mark.parametrize("off", [(0.008, 0.0, 0.0), (-0.006, 0.006, 0.0), (0.0, -0.012, 0.0)])
def test_a_wall_that_seems_to_have_moved_is_nothing_new(tray: Container, off: tuple[float, ...]) -> None:
    too_large = replace(tray, box=replace(BOX, size=BOX.size + 0.04))
    assert too_large.gained(view(1) + off) is False
    assert too_large.gained(view(1, screw=True) + off) is True


def test_what_is_not_in_view_is_not_known(tray: Container) -> None:
    assert tray.gained(view(1, share=0.4)) is None
    assert Container(tray.sighting, None, 0.15).gained(view(1)) is None


def test_what_a_wall_hides_where_the_hand_let_go_is_not_known(tray: Container) -> None:
    points = view(1)
    near = (points[:, :2] - BOX.center) @ AXES
    hidden = points[near[:, 0] > -0.03]
    corner = (BOX.center + AXES @ (-0.06, 0.0)).tolist()
    middle = BOX.center.tolist()
    assert tray.gained(hidden, middle) is False
    assert tray.gained(hidden, corner) is None
    assert tray.gained(points, middle) is False, "all of it is in view"
    assert tray.gained(view(1, screw=True), corner) is True


KNOWN, NEW, ELSEWHERE = (0.48, -0.31, 0.02), (0.51, -0.3, 0.02), (0.53, -0.22, 0.02)


@pytest.mark.parametrize(
    ("frames", "told"),
    [
        ([[KNOWN], [KNOWN, NEW], [], [NEW], [KNOWN]], Sight.YES),  # half of what lies there is in a frame
        ([[KNOWN], [KNOWN, NEW], [], [], [KNOWN]], Sight.UNKNOWN),
        ([[KNOWN]] * 5, Sight.UNKNOWN),  # it may lie beside it
        ([[], [ELSEWHERE], [], [], []], Sight.NO),
    ],
)
def test_what_lies_where_the_hand_let_go_is_what_it_held(
    tray: Container, frames: list[list[tuple[float, ...]]], told: Sight
) -> None:
    things = [
        [
            LocalizedObject(Detection("nut", 0.9, np.zeros(4), np.zeros(2)), 0.0, np.array(p), np.zeros((0, 3)))
            for p in f
        ]
        for f in frames
    ]
    shown = iter([Detections(0.0, "head", (*f, replace(tray.sighting, points=view(k)))) for k, f in enumerate(things)])

    async def look(timeout: float) -> Detections | None:
        return next(shown, None)

    eye = SimpleNamespace(look=look)
    context: Any = SimpleNamespace(t=0.0, watch=lambda *_, **__: nullcontext(eye))
    attempt = Attempt("nut", "tray", "right", tray.sighting)
    report = PickReport(tried=[attempt.first_seen], let_go=(0.5, -0.3))
    choice = PickChoice([attempt], tray, np.array([KNOWN]))
    with pytest.raises(StopIteration):
        look_after(context, PickConfig(looks_after=5), attempt, choice, ("nut",), report).send(None)
    assert report.in_tray == told.value


def test_the_first_place_is_the_middle_as_the_localizer_tells_it(tray: Container) -> None:
    places = tray.places(0.04)
    np.testing.assert_array_equal(places[0], tray.sighting.position)
    assert len(places) > 5


def test_a_hand_that_does_not_get_to_the_middle_of_an_unknown_shape_has_places_beside_it(tray: Container) -> None:
    places = Container(tray.sighting, None, 0.15).places(0.04)
    np.testing.assert_array_equal(places[0], tray.sighting.position)
    away = np.linalg.norm(places[1:] - places[0], axis=1)
    assert len(away) == 4 and (away > 0.03).all() and (away < 0.05).all()


def test_what_lies_inside_is_told_from_what_lies_beside(tray: Container) -> None:
    near = np.array([[0.5, -0.3, 0.03], [0.5, -0.12, 0.03], [0.66, -0.3, 0.03]])
    assert tray.holds(near).tolist() == [True, False, False]
