"""What has passed is kept, what lasts is not repeated, and nothing goes on where a check fails."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.middleware.ros.future import RosError
from golem.middleware.wire.convert import encode_low_state
from golem.runtime.bringup.base import BringupConfig, BringupStep, StepFinding, StepRefused, Task, Workbench
from golem.runtime.bringup.bringup_command import CHECKS, FILE, BringupReport, run_checks
from golem.runtime.bringup.listening_checks import check_state
from golem.runtime.bringup.motor_checks import answer_problem, check_motion
from golem.types import NUM_JOINTS, TICK, Imu, LowState

REFUSALS = {"refuses": StepRefused("the gate has ended"), "asks in vain": RosError("NOT STOPPED: press the button")}
"""What checks raise, by name."""


class Nobody:
    """A person who hears everything and does nothing."""

    def __init__(self, says: str = "same") -> None:
        self.heard: list[str] = []
        self._says = says

    def tell(self, text: str) -> None:
        self.heard.append(text)

    def confirm(self, question: str, word: str) -> bool:
        self.heard.append(question)
        return word == self._says

    def act(self, task: Task) -> None:
        raise AssertionError("nothing is to be done here")


def bench(says: str = "same") -> Workbench:
    return Workbench(cast(Any, None), Nobody(says), BringupConfig(), lambda: cast(Any, None))


def checks(done: list[str], outcomes: dict[str, bool], lasting: str = "") -> tuple[BringupStep, ...]:
    """Return checks called as `outcomes`, which write down that they were done."""

    def make(name: str) -> BringupStep:
        def run(_: Workbench) -> StepFinding:
            done.append(name)
            if name in REFUSALS:
                raise REFUSALS[name]
            return StepFinding(outcomes[name], f"about {name}", {"figure": 1.5})

        return BringupStep(name, f"Title of {name}", run, lasting=name == lasting)

    return tuple(map(make, outcomes))


def test_nothing_goes_on_where_a_check_fails(tmp_path: Path) -> None:
    done: list[str] = []
    row = checks(done, {"one": True, "two": False, "three": True})
    report = BringupReport(tmp_path, "domain 1")
    assert not run_checks(bench(), report, row, again=())
    assert done == ["one", "two"]
    page = report.page(row).read_text()
    assert "Title of one: passed" in page and "Title of two: FAILED" in page
    assert "Title of three: not reached" in page and "| figure | 1.5 |" in page


def test_what_lasts_is_not_repeated_unless_asked(tmp_path: Path) -> None:
    done: list[str] = []
    row = checks(done, {"one": True, "two": True}, lasting="two")
    assert run_checks(bench(), BringupReport(tmp_path, "domain 1"), row, again=())
    assert run_checks(bench(), BringupReport(tmp_path, "domain 1"), row, again=())
    assert run_checks(bench(), BringupReport(tmp_path, "domain 1"), row, again=("two",))
    assert done == ["one", "two", "one", "one", "two"]


def test_another_robot_on_the_same_domain_is_checked_anew(tmp_path: Path) -> None:
    done: list[str] = []
    row = checks(done, {"one": True, "two": True}, lasting="two")
    assert run_checks(bench(), BringupReport(tmp_path, "domain 1"), row, again=())
    assert run_checks(bench("no"), BringupReport(tmp_path, "domain 1"), row, again=())
    assert done == ["one", "two"] * 2


def test_a_repetition_that_is_cut_short_leaves_no_old_pass(tmp_path: Path) -> None:
    def cut(_: Workbench) -> StepFinding:
        raise KeyboardInterrupt

    assert run_checks(bench(), BringupReport(tmp_path, "domain 1"), checks([], {"two": True}, lasting="two"), again=())
    row = (BringupStep("two", "Title of two", cut, lasting=True),)
    with pytest.raises(KeyboardInterrupt):
        run_checks(bench(), BringupReport(tmp_path, "domain 1"), row, again=("two",))
    assert not BringupReport(tmp_path, "domain 1").passed("two")


def test_nothing_moves_before_a_person_says_so(tmp_path: Path) -> None:
    class Link:
        def spin(self, *_: Any) -> bool:
            return True

    at = bench("no")
    at.link, at.gate = cast(Any, Link()), cast(Any, type("Gate", (), {"code": None})())
    finding = check_motion(at)
    assert not finding.passed and "nobody says that the robot may move" in finding.text


@pytest.mark.parametrize("name", REFUSALS)
def test_a_refusal_fails_its_check(name: str, tmp_path: Path) -> None:
    report = BringupReport(tmp_path, "domain 1")
    assert not run_checks(bench(), report, checks([], {name: True}), again=())
    assert str(REFUSALS[name]) in (tmp_path / FILE).read_text()


@pytest.mark.parametrize(("earlier", "late", "passes"), [(500, 0, True), (0, 100, False)])
def test_only_states_that_are_damaged_while_it_listens_count(earlier: int, late: int, passes: bool) -> None:
    class Link:
        damaged = earlier

        def spin(self, *_: Any) -> bool:
            return True

        def listen(self, seconds: float) -> list[tuple[float, LowState]]:
            self.damaged += late
            zero, imu = np.zeros(NUM_JOINTS), Imu(np.eye(4)[0], np.zeros(3), np.array([0.0, 0.0, 9.81]))
            states = [LowState(k * TICK, zero, zero, zero, imu) for k in range(1500)]
            self.payload = encode_low_state(states[-1])
            return [(state.t, state) for state in states]

    at = bench()
    at.link = cast(Any, Link())
    finding = check_state(at)
    assert finding.passed == passes and finding.figures["unreadable states"] == late, finding.text


def test_a_report_of_another_robot_or_none_is_refused(tmp_path: Path) -> None:
    BringupReport(tmp_path, "domain 1").add("one", StepFinding(True, "fine"))
    with pytest.raises(ConfigError, match="not on domain 2"):
        BringupReport(tmp_path, "domain 2")
    (tmp_path / FILE).write_text(json.dumps({"where": "domain 1"}))
    with pytest.raises(ConfigError, match="no file of a bring-up"):
        BringupReport(tmp_path, "domain 1")


def test_what_must_hold_each_time_is_repeated_each_time() -> None:
    assert {check.name for check in CHECKS if not check.lasting} == {"domain", "hoist", "state", "estop", "release"}


def test_a_real_robot_needs_its_button_and_devices_have_names() -> None:
    with pytest.raises(ConfigError, match="choose among: head camera"):
        BringupConfig(without=("camera",))
    with pytest.raises(ConfigError, match="share"):
        BringupConfig(share=1.0)


@pytest.mark.parametrize(
    ("moves", "words"),
    [
        ({3: 0.1, 4: 0.02}, ""),
        ({3: -0.1}, "wrong sign"),
        ({4: 0.1}, "left_ankle_pitch_joint moved instead"),
        ({3: 0.1, 9: 0.12}, "right_knee_joint moved further"),
    ],
)
def test_a_joint_that_was_sent_answers_alone(moves: dict[int, float], words: str) -> None:
    moved = np.zeros(NUM_JOINTS)
    for joint, angle in moves.items():
        moved[joint] = angle
    said = answer_problem(3, moved, 0.1)
    assert words in said and bool(said) is bool(words)
