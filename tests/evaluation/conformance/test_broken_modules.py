"""Each of these modules breaks one promise, and the check of that promise is the one that says so."""

from __future__ import annotations

import asyncio
import random
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from golem.evaluation.conformance import suite
from golem.evaluation.conformance.base import FAILED, PASSED, Candidate, Report
from golem.evaluation.conformance.examine import candidate, examine
from golem.evaluation.conformance.still_robot import StillRobot
from golem.interfaces.payloads import GripState
from golem.skills.base import SkillCancelled, SkillResult
from golem.skills.context import Context

from .mutants import CALLS, GENERAL, OWN, AsCalled, Mutant, changed, mutate
from .small_modules import CountGoal, Counts, DarkSpots

GOOD: dict[str, Candidate] = {
    "robot": Candidate("robot", "still", StillRobot),
    "estimator": candidate("estimator", "tether"),
    "servo": candidate("servo", "pd_gravity"),
    "hand": candidate("hand", "magpie"),
    "lower_body": candidate("lower_body", "hold"),
    "upper_body": candidate("upper_body", "diff_ik"),
    "localizer": Candidate("localizer", "spots", DarkSpots),
    "grasp_method": candidate("grasp_method", "centroid"),
    "odometry": candidate("odometry", "legs"),
    "mapper": candidate("mapper", "grid"),
    "memory": candidate("memory", "object_map"),
    "navigator": candidate("navigator", "goto"),
    "skill": Candidate("skill", "counts", Counts),
}
CASES = [(slot, what) for slot in CALLS for what, mutant in GENERAL.items() if mutant.fits(slot)]
Change = Callable[[Any], None]


def named(report: Report) -> list[str]:
    return [finding.check for finding in report.findings if finding.status == FAILED]


def broken(slot: str, change: Change) -> Candidate:
    """Return the good module of `slot` after `change` was made to it."""

    def make() -> Any:
        module = GOOD[slot].make()
        change(module)
        return module

    return Candidate(slot, "broken", make)


@pytest.mark.parametrize("slot", GOOD)
def test_the_modules_that_are_broken_below_are_whole(slot: str) -> None:
    report = examine(Candidate(slot, "good", GOOD[slot].make))
    assert not report.failed, [(f.check, f.reason) for f in report.failed]
    assert sum(finding.status == PASSED for finding in report.findings) >= 10


@pytest.mark.parametrize(("slot", "what"), CASES)
def test_a_broken_module_is_named_by_the_check_of_its_promise(
    slot: str, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(suite, "FAR", 0.1)  # so that being slow takes milliseconds
    report = examine(mutate(GOOD[slot], GENERAL[what]))
    assert named(report)[:1] == [GENERAL[what].check], [(f.check, f.reason) for f in report.failed]


@pytest.mark.parametrize(("slot", "what"), OWN)
def test_what_one_slot_alone_promises_is_named(slot: str, what: str) -> None:
    check, change = OWN[slot, what]

    def around(module: Any, method: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *given: change(method(*given))

    report = examine(mutate(GOOD[slot], Mutant(check, around)))
    assert named(report)[:1] == [check], [(f.check, f.reason) for f in report.failed]


class _Without:
    """A module that lacks a member."""

    def __init__(self, module: Any, name: str) -> None:
        self._module, self._name = module, name

    def __getattr__(self, name: str) -> Any:
        if name == self._name:
            raise AttributeError(name)
        return getattr(self._module, name)


@pytest.mark.parametrize("slot", CALLS)
def test_a_module_that_lacks_a_method_is_named(slot: str) -> None:
    report = examine(Candidate(slot, "broken", lambda: _Without(GOOD[slot].make(), CALLS[slot])))
    assert named(report) == ["has_every_member"] and f"lacks {CALLS[slot]}" in report.failed[0].reason
    assert {finding.status for finding in report.findings[2:]} == {"skipped"}


@pytest.mark.parametrize(
    ("slot", "method"), (CALLS | {"robot": "advance", "odometry": "add_scan", "mapper": "add_scan"}).items()
)
def test_a_method_that_takes_other_arguments_is_named(slot: str, method: str) -> None:
    report = examine(broken(slot, lambda module: setattr(module, method, lambda: None)))
    assert named(report) == ["has_every_member"] and "takes ()" in report.failed[0].reason


@pytest.mark.parametrize("slot", GOOD)
def test_a_module_that_cannot_be_made_is_named(slot: str) -> None:
    def raises(module: Any) -> None:
        raise ValueError("my bug")

    report = examine(broken(slot, raises))
    assert named(report) == ["can_be_made"] and "ValueError: my bug (test_broken" in report.failed[0].reason


@pytest.mark.parametrize("slot", GOOD)
def test_a_thread_that_the_constructor_leaves_behind_is_named(slot: str) -> None:
    over = threading.Event()
    try:
        report = examine(broken(slot, lambda module: threading.Thread(target=over.wait).start()))
    finally:
        over.set()
    assert named(report) == ["can_be_made"]


@pytest.mark.parametrize(
    ("slot", "attribute", "value"),
    [
        ("lower_body", "rate", 0.0),
        ("lower_body", "latency", 0.5),
        ("lower_body", "latency", -0.1),
        ("lower_body", "envelope", None),
        ("lower_body", "gait", "always"),
        ("upper_body", "rate", float("nan")),
        ("upper_body", "latency", "fast"),
        ("localizer", "latency", -1.0),
        ("robot", "calibration", {}),
        ("robot", "calibration", {name: np.zeros((4, 4)) for name in StillRobot().cameras}),
        ("skill", "Goal", int),
        ("skill", "timeout", lambda goal: -1.0),
    ],
)
def test_a_number_that_cannot_be_is_named(slot: str, attribute: str, value: Any) -> None:
    report = examine(broken(slot, lambda module: setattr(module, attribute, value)))
    assert named(report) == ["declares_sound_numbers"], [(f.check, f.reason) for f in report.failed]


def _wrap(name: str, change: Callable[[Any], Any]) -> Change:
    """Return what makes a method of a module give other answers."""

    def apply(module: Any) -> None:
        right = getattr(module, name)
        setattr(module, name, AsCalled(lambda *given: change(right(*given)), right))

    return apply


def _still(arms: Any) -> None:
    """Stay where the reset was, but tell the errors of a controller that works."""
    reset, step = arms.reset, arms.step

    def stays(q: Any) -> None:
        arms.first = q[12:].copy()
        reset(q)

    arms.reset = AsCalled(stays, reset)
    arms.step = AsCalled(lambda *given: replace(step(*given), q=arms.first.copy()), step)


def _drifts(arms: Any) -> None:
    step, ticks = arms.step, [0]

    def drifts(left: Any, right: Any, q: Any, dt: float) -> Any:
        ticks[0] = ticks[0] + 1 if left is right is None else 0
        return changed(q=lambda q: q + 0.002 * ticks[0] * (np.arange(15) == 1))(step(left, right, q, dt))

    arms.step = AsCalled(drifts, step)


def _takes_anything(arms: Any) -> None:
    step, last = arms.step, []

    def takes(*given: Any) -> Any:
        try:
            last[:] = [step(*given)]
        except Exception:
            if not all(np.isfinite(a).all() for a in given[:3] if a is not None):
                raise
        return last[0]

    arms.step = AsCalled(takes, step)


def _raises_otherwise(arms: Any) -> None:
    step = arms.step

    def raises(*given: Any) -> Any:
        try:
            return step(*given)
        except Exception as error:
            raise ValueError("no pose") from error

    arms.step = AsCalled(raises, step)


def _keeps_the_first_goal(navigator: Any) -> None:
    start, given = navigator.start, []

    def starts(goal: Any) -> None:
        given.append(goal)
        if len(given) == 1:
            start(goal)

    navigator.start = AsCalled(starts, start)


def _remembers_frames(eyes: Any) -> None:
    locate, frames = eyes.locate, []

    def remembers(frame: Any, labels: Any) -> Any:
        frames.append(frame)
        found = locate(frame, labels)
        return found if len(frames) < 10 else found[:1]

    eyes.locate = AsCalled(remembers, locate)


def _knows_every_word(eyes: Any) -> None:
    locate = eyes.locate
    eyes.locate = AsCalled(lambda frame, labels: locate(frame, ("screw",) if labels else ()), locate)


def _guesses_a_depth(eyes: Any) -> None:
    locate = eyes.locate

    def guesses(frame: Any, labels: Any) -> Any:
        blind = not frame.depth.any() and frame.rgb.any()
        return locate(replace(frame, depth=frame.depth + 0.5) if blind else frame, labels)

    eyes.locate = AsCalled(guesses, locate)


@pytest.mark.parametrize(
    ("slot", "check", "change"),
    [
        ("hand", "says_what_it_does_not_know", _wrap("status", lambda s: replace(s, gap=0.0, offset=0.0))),
        ("hand", "holds_what_it_presses_on", _wrap("status", lambda s: replace(s, state=GripState.OPEN))),
        ("hand", "holds_what_it_presses_on", _wrap("status", lambda s: replace(s, state=GripState.HOLDING))),
        ("upper_body", "goes_to_the_target", _still),
        ("upper_body", "keeps_still_without_a_target", _drifts),
        ("upper_body", "refuses_what_is_no_pose", _takes_anything),
        ("upper_body", "refuses_what_is_no_pose", _raises_otherwise),
        ("navigator", "begins_again", _keeps_the_first_goal),
        ("localizer", "remembers_nothing", _remembers_frames),
        ("localizer", "refuses_labels_it_does_not_know", _knows_every_word),
        ("localizer", "leaves_out_what_it_cannot_place", _guesses_a_depth),
        ("robot", "attitude_is_a_rotation", _wrap("imu", lambda imu: replace(imu, quat=2.0 * imu.quat))),
        ("robot", "stamps_its_hands", _wrap("hand", lambda hand: replace(hand, t=hand.t + 1.0))),
        ("robot", "answers_soundly", _wrap("joints", lambda joints: [values[:12] for values in joints])),
        ("robot", "answers_soundly", _wrap("imu", lambda imu: replace(imu, gyro=imu.gyro * np.nan))),
        ("robot", "answers_soundly", _wrap("hand", lambda hand: None)),
        ("robot", "cameras_see", _wrap("capture", lambda images: (images[0], images[1].astype(np.float64)))),
        ("robot", "cameras_see", _wrap("capture", lambda images: (images[0][::2], images[1]))),
        ("robot", "cameras_see", _wrap("capture", lambda images: (images[0], -images[1]))),
    ],
)
def test_a_promise_that_takes_more_than_an_answer_to_break_is_named(slot: str, check: str, change: Change) -> None:
    report = examine(broken(slot, change))
    assert check in named(report), [(f.check, f.reason) for f in report.failed]
    assert len(named(report)) <= 2


def test_a_robot_that_cannot_be_closed_twice_is_named() -> None:
    def once(robot: Any) -> None:
        closed: list[bool] = []

        def close() -> None:
            if closed:
                raise ValueError("closed")
            closed.append(True)

        robot.close = close

    assert named(examine(broken("robot", once))) == ["closes_twice"]


class _Mine(Counts):
    """A skill whose first step is a test's own."""

    def __init__(self, act: Callable[[Context], object]) -> None:
        self._act = act

    async def run(self, context: Context, goal: CountGoal) -> SkillResult:
        await context.tick()
        done = self._act(context)
        return done if isinstance(done, SkillResult) else await super().run(context, goal)


class _Stubborn(Counts):
    async def run(self, context: Context, goal: CountGoal) -> SkillResult:
        while True:
            try:
                await context.tick()
            except SkillCancelled:
                continue


class _Waits(Counts):
    async def run(self, context: Context, goal: CountGoal) -> SkillResult:
        await asyncio.sleep(0.01)
        return SkillResult(True, "done", None, "Waited.")


class _Plain(Counts):
    def run(self, context: Context, goal: CountGoal) -> Any:
        return SkillResult(True, "done", None, "Done.")


@dataclass(frozen=True)
class ArrayGoal:
    """A goal that nobody can write down."""

    where: np.ndarray


class _Demanding(Counts):
    Goal = ArrayGoal


def _raise(context: Context) -> None:
    raise KeyError("my bug")


COUNT = [0]


def _count(context: Context) -> SkillResult:
    COUNT[0] += 1
    return SkillResult(True, "done", None, f"Counted to {COUNT[0]}.")


@pytest.mark.parametrize(
    ("check", "make"),
    [
        ("answers_soundly", lambda: _Mine(_raise)),
        ("answers_soundly", lambda: _Mine(lambda context: SkillResult(True, "done", "hand", "Done."))),
        ("answers_soundly", _Waits),
        ("answers_soundly", _Plain),
        ("has_every_member", lambda: _Without(Counts(), "timeout")),
        ("declares_sound_numbers", _Demanding),
        ("repeats_itself", lambda: _Mine(_count)),
        ("reads_no_clock", lambda: _Mine(lambda context: time.time())),
        ("opens_no_file", lambda: _Mine(lambda context: Path(__file__).read_text())),
        ("starts_no_thread", lambda: _Mine(lambda context: threading.Thread(target=int).start())),
        ("draws_no_shared_randomness", lambda: _Mine(lambda context: random.random())),
        pytest.param("can_be_cancelled", _Stubborn, marks=pytest.mark.slow),
        ("gives_reasons", lambda: _Mine(lambda context: SkillResult(False, "count", None, " "))),
    ],
)
def test_a_broken_skill_is_named(check: str, make: Callable[[], Any]) -> None:
    report = examine(Candidate("skill", "broken", make))
    assert named(report)[:1] == [check], [(f.check, f.reason) for f in report.failed]


@pytest.mark.parametrize("slot", GOOD)
def test_ten_broken_modules_of_every_slot_are_named(slot: str) -> None:
    if slot == "skill":
        return  # 13 above
    general = sum(mutant.fits(slot) for mutant in GENERAL.values())
    assert general + sum(where == slot for where, _ in OWN) + 4 >= 10
