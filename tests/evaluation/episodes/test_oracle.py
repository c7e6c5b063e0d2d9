"""The judge of a whole pack: in its place, lifted, in which tray, on the floor."""

from __future__ import annotations

from collections import Counter
from types import SimpleNamespace
from typing import Any, cast

import mujoco
import numpy as np
from tests.robots.worlds.test_ioniq5 import build

from golem.evaluation.episodes.oracle import whereabouts


def test_where_each_fastener_is_is_known() -> None:
    w = build(seed=1, loose=0.5)
    scene = SimpleNamespace(layout=w.layout, names=w.names, draws=w.draws)
    robot = cast(Any, SimpleNamespace(scene=scene, data=w.data))
    mujoco.mj_forward(w.model, w.data)
    found = {one.slot: one for one in whereabouts(robot)}
    assert set(found) == set(range(84)) - set(w.layout.empty_holes)
    assert all(one.where == "seated" for one in found.values())
    assert {slot for slot, one in found.items() if one.loose} == {draw.slot for draw in w.draws}

    screws = [d for d in w.draws if d.kind == "screw"]
    nuts = [d for d in w.draws if d.kind == "nut"]
    trays = {tray.name: tray for tray in w.layout.trays()}

    def put(name: str, at: Any) -> None:
        w.data.qpos[w.model.joint(name).qposadr[0] :][:3] = at

    for draw, tray in ((screws[0], "tray_far"), (screws[1], "tray_nuts"), (nuts[0], "tray_left_nuts")):
        put(draw.name, trays[tray].pose()[:3, 3] + (0.03, -0.04, 0.01))
    put(screws[2].name, (0.2, 0.1, 0.006))
    for k, draw in enumerate((screws[3], nuts[1])):  # up by more, and by less than what holds them
        mouth = w.names.mouths[w.draws.index(draw)]
        put(draw.name, mouth + (draw.shank_length + 0.002) * np.array([0.0, 0.0, 1.0]) if k == 0 else mouth)
    put(nuts[2].name, w.names.mouths[w.draws.index(nuts[2])] + (0.008, 0.0, 0.001))  # beside its stud
    mujoco.mj_forward(w.model, w.data)
    found = {one.slot: one for one in whereabouts(robot)}
    first = found[screws[0].slot]
    assert (first.where, first.tray, first.right) == ("tray", "tray_far", True)
    assert (found[screws[1].slot].tray, found[screws[1].slot].right) == ("tray_nuts", False)
    assert found[nuts[0].slot].right
    assert [found[d.slot].where for d in (screws[2], screws[3], nuts[1], nuts[2])] == [
        "floor", "lifted", "seated", "lifted",
    ]  # fmt: skip
    loose = Counter((one.kind, one.where) for one in found.values() if one.loose)
    assert (loose["screw", "tray"], loose["nut", "tray"], sum(one.right for one in found.values())) == (2, 1, 2)
    assert (loose["screw", "floor"], loose["screw", "lifted"], loose["nut", "lifted"]) == (1, 1, 1)
    assert loose["nut", "seated"] == len(nuts) - 2
