"""The rung pack: the list that a gantry would give, and what is made of a job's end."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from golem.evaluation.base import TrialOutcome, TrialSpec, make_rung, rung_class
from golem.evaluation.episodes.oracle import Whereabouts
from golem.evaluation.rungs.whole_pack import WholePackOptions, WholePackRung, judged, lost_by, write_claims
from golem.robots.worlds.ioniq5 import Ioniq5Layout
from golem.robots.worlds.layout import PackLayout
from golem.skills.fastener_list import read_list
from golem.skills.job_file import Fate

SCENE: Any = SimpleNamespace(
    layout=PackLayout(),
    draws=tuple(SimpleNamespace(slot=slot) for slot in (8, 9, 30)),
    names=SimpleNamespace(screws=("screw_08", "screw_09", "screw_30")),
)


def tray(slot: int, inside: bool, right: bool = True) -> Whereabouts:
    return Whereabouts(slot, "screw", True, "tray" if inside else "floor", "tray", inside and right)


def test_it_is_a_rung_of_grasp_methods() -> None:
    assert rung_class("pack") is WholePackRung
    rung = make_rung("golem.evaluation.rungs.whole_pack:WholePackRung", {"part": "edge"})
    assert "visual_servo" in rung.methods() and list(rung.cases(lambda case: None)) == [{}]
    assert "goal" in rung.config("visual_servo", "bench", {})


def test_the_list_has_every_fastener_and_claims_that_are_wrong_as_often_as_asked(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    claims = write_claims(tmp_path / "a.csv", SCENE, WholePackOptions(wrong=0.0), rng)
    listed = read_list(tmp_path / "a.csv", {"tray"})
    assert len(claims) == 63 == len(listed) - 1 and listed[0].kind == "tray"
    assert [slot for slot, claimed in claims if claimed] == [8, 9, 30]
    edge = write_claims(tmp_path / "b.csv", SCENE, WholePackOptions(wrong=0.0, part="edge"), rng)
    assert [slot for slot, claimed in edge if claimed] == [8, 9]
    many = [write_claims(tmp_path / "c.csv", SCENE, WholePackOptions(), rng) for _ in range(50)]
    off = np.mean([claimed != (slot in (8, 9, 30)) for claims in many for slot, claimed in claims])
    assert 0.04 < off < 0.06


def test_the_list_errs_by_as_much_as_asked(tmp_path: Path) -> None:
    scene: Any = SimpleNamespace(layout=PackLayout(), draws=())
    lists = []
    for options in (WholePackOptions(place=0.0), WholePackOptions(place=0.001, kind=0.2)):
        write_claims(tmp_path / "a.csv", scene, options, np.random.default_rng(0))
        lists.append([one for one in read_list(tmp_path / "a.csv", {"tray"}) if one.kind != "tray"])
    right, wrong = lists
    assert {one.kind for one in right} == {"screw"}
    assert 0.1 < np.mean([one.kind != "screw" for one in wrong]) < 0.3
    off = [(a.x - b.x, a.y - b.y, a.z - b.z) for a, b in zip(right, wrong, strict=True)]
    assert np.std(off) == pytest.approx(0.001, rel=0.15)


def test_the_list_of_the_real_pack_has_its_kinds_and_trays(tmp_path: Path) -> None:
    scene: Any = SimpleNamespace(layout=Ioniq5Layout(), draws=())
    write_claims(tmp_path / "a.csv", scene, WholePackOptions(world="ioniq5"), np.random.default_rng(0))
    listed = read_list(tmp_path / "a.csv", {"tray"})
    assert Counter(one.kind for one in listed) == {"screw": 53, "nut": 30, "bolt": 1, "tray": 13}
    assert Counter(one.takes for one in listed) == {"": 84, "screw": 7, "nut": 6}


def test_the_share_in_the_tray_wrong_words_and_false_claims_are_counted() -> None:
    claims = [(7, True), (8, True), (9, True), (10, True), (30, False)]
    fates = [Fate.TIGHT, Fate.IN_TRAY, Fate.IN_TRAY, Fate.JAMMED, Fate.OPEN]
    found = [Whereabouts(7, "screw", False), *(tray(slot, slot == 8) for slot in (8, 9, 30))]
    series = judged(claims, fates, found)
    assert series == pytest.approx(
        {
            "lost_in_tray": 1.0,
            "lost_unclaimed": 1.0,
            "loosened_in_tray": 1 / 3,
            "right_tray": 1 / 3,
            "wrong_in_tray": 1.0,
            "loosened": 3.0,
            "wrong_refusals": 1.0,
            "false_claims_found": 0.5,
        }
    )
    assert sorted(lost_by(series)) == ["grasp_method", "list"]
    whole = judged([(8, True), (9, True)], [Fate.IN_TRAY] * 2, [tray(8, True), tray(9, True, right=False)])
    assert (whole["loosened_in_tray"], whole["right_tray"]) == (1.0, 0.5)


def test_its_table_blames_by_fastener() -> None:
    rows = [
        (TrialSpec("pack", "visual_servo", "field", 0, i), TrialOutcome(False, "pack", series={"lost_missing": 2.0}))
        for i in range(2)
    ]
    [table] = WholePackRung().tables({"visual_servo": rows})
    assert ("visual_servo", "missing", "4", "localizer") in table.rows
