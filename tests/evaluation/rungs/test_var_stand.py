"""The rung var-stand: the same starts with and without docking, the world it makes, and a trial of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.evaluation.base import TrialOutcome, TrialSpec, make_rung, rung_class
from golem.evaluation.rungs.var_stand import PLACEMENT, VarStandRung, drawn_stance
from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.lockstep import start_posture
from golem.types import PlanarPose


def spec(index: int = 0, start: str = "placed", dock: str = "no") -> TrialSpec:
    return TrialSpec("var-stand", "visual_servo", "field", 0, index, case={"start": start, "dock": dock})


def test_every_start_is_tried_without_and_with_docking() -> None:
    assert rung_class("var-stand") is VarStandRung
    rung = make_rung("golem.evaluation.rungs.var_stand:VarStandRung", {"start": ["walked"]})
    assert [dict(case) for case in rung.cases(lambda case: None)] == [
        {"start": "walked", "dock": "no"},
        {"start": "walked", "dock": "yes"},
    ]
    assert "visual_servo" in rung.methods()
    with pytest.raises(ConfigError, match="brings robot and grasp method"):
        rung.config("visual_servo", "field", {"robot": "replay"})


def test_starts_are_those_of_the_paper_and_the_same_with_docking() -> None:
    starts = [drawn_stance(spec(i), walks=False).to(PlanarPose(0.0, 0.0, 0.0)) for i in range(400)]
    off = np.array([(p.x, p.y) for p in starts])
    np.testing.assert_allclose(off.std(axis=0), PLACEMENT, rtol=0.1)
    assert 0.10 < np.hypot(*off.T).mean() < 0.13
    assert drawn_stance(spec(3), walks=False) == drawn_stance(spec(3, dock="yes"), walks=False)
    walk = drawn_stance(spec(3, "walked"), walks=True)
    assert abs(walk.x - 6.0) <= 0.2 and abs(walk.y) <= 0.4 and abs(walk.yaw) <= math.radians(20.0)


@pytest.mark.parametrize("world", ["pack", "plant"])
def test_the_pack_stands_where_the_stance_says(world: str) -> None:
    stance = PlanarPose(1.0, 0.3, 0.2) if world == "plant" else PlanarPose(-0.05, 0.1, -0.1)
    place = (stance.x, stance.y, stance.yaw)
    options = {"support": "ground", "world": world, "layout": "varied"}
    there = MujocoRobot("field", 5, start_posture(True), MujocoConfig(stance=place, **options))  # pyright: ignore
    here = MujocoRobot("field", 5, start_posture(True), MujocoConfig(**{**options, "world": "pack"}))  # pyright: ignore
    T = stance.matrix()
    np.testing.assert_allclose(there.scene.layout.pose(), T @ here.scene.layout.pose(), atol=1e-9)
    np.testing.assert_allclose(there.scene.layout.tray_pose(), T @ here.scene.layout.tray_pose(), atol=1e-9)
    assert there.scene.names.screws == here.scene.names.screws
    for name in there.scene.names.screws:
        moved = T @ (*here.data.body(name).xpos, 1.0)
        np.testing.assert_allclose(there.data.body(name).xpos, moved[:3], atol=1e-9)
    there.close()
    here.close()


@pytest.mark.slow
@pytest.mark.long
def test_a_robot_that_stands_badly_docks_and_picks() -> None:
    found = VarStandRung().run(spec(0, dock="yes"), None)
    assert found.series["dockings"] >= 1 and found.series["approaches"] >= 1
    assert found.success, found.detail


def test_its_plot_is_of_the_places_alone() -> None:
    pytest.importorskip("matplotlib", reason="the extra report is not installed")
    from golem.evaluation.report.svg_figure import page_figure, styled

    rung = make_rung("golem.evaluation.rungs.var_stand:VarStandRung", {"start": ["placed"], "dock": ["no"]})
    rows = [(spec(i), TrialOutcome(i > 0, "done" if i else "stance")) for i in range(3)]
    with styled():
        assert rung.plot({"visual_servo": rows}, page_figure(300.0)) == "Success by condition [%]"
