"""Modules that are right but for one thing: a correct one behind a wrapper that breaks one promise."""

from __future__ import annotations

import dataclasses
import inspect
import random
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from golem.evaluation.conformance.base import Candidate
from golem.robots.model.spatial import rotation_rpy, transform

CALLS = {
    "robot": "joints",
    "estimator": "step",
    "servo": "step",
    "hand": "step",
    "lower_body": "step",
    "upper_body": "step",
    "localizer": "locate",
    "grasp_method": "propose",
    "odometry": "estimate",
    "mapper": "grid",
    "memory": "query",
    "navigator": "step",
}
"""The method of each slot that a mutant breaks."""


@dataclass(frozen=True)
class Mutant:
    """One way to be wrong.

    Attributes:
        check: the check that must name it, and the first that does.
        around: given the correct module and its method, returns the wrong one.
        only: slots for which it is wrong; all where empty.
        never: slots for which it is not.
    """

    check: str
    around: Callable[[Any, Callable[..., Any]], Callable[..., Any]]
    only: tuple[str, ...] = ()
    never: tuple[str, ...] = ()

    def fits(self, slot: str) -> bool:
        """Return whether a module of `slot` can be wrong in this way."""
        return slot not in self.never and (not self.only or slot in self.only)


def spoil(answer: Any, change: Callable[[np.ndarray], np.ndarray]) -> Any:
    """Return a copy of `answer` in which `change` was applied to the first array or number inside, if there is one."""
    if isinstance(answer, np.ndarray):
        return change(answer.astype(np.float64))
    if isinstance(answer, float):
        return float(change(np.array([answer]))[0])
    if isinstance(answer, list | tuple):
        if not answer:
            return answer
        return type(answer)([spoil(answer[0], change), *answer[1:]])
    for field in dataclasses.fields(answer):
        value = getattr(answer, field.name)
        holds = isinstance(value, np.ndarray | float) or dataclasses.is_dataclass(value)
        if holds and field.name not in ("t", "detection"):
            return dataclasses.replace(answer, **{field.name: spoil(value, change)})
    raise AssertionError(f"nothing to spoil in {answer}")


def arrays(value: Any) -> list[np.ndarray]:
    """Return every array inside `value`."""
    if isinstance(value, np.ndarray):
        return [value]
    if isinstance(value, list | tuple):
        return [a for each in value for a in arrays(each)]
    if dataclasses.is_dataclass(value):
        return [a for f in dataclasses.fields(value) for a in arrays(getattr(value, f.name))]
    return []


def _raises(module: Any, method: Callable[..., Any]) -> Callable[..., Any]:
    def wrong(*given: Any) -> Any:
        raise ZeroDivisionError("my bug")

    return wrong


def _exits(module: Any, method: Callable[..., Any]) -> Callable[..., Any]:
    def wrong(*given: Any) -> Any:
        raise SystemExit(3)

    return wrong


def _nothing(module: Any, method: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *given: None


def _of(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Any, Any], Callable[..., Any]]:
    def around(module: Any, method: Callable[..., Any]) -> Callable[..., Any]:
        def wrong(*given: Any) -> Any:
            return spoil(method(*given), change)

        return wrong

    return around


def _first(act: Callable[[], object]) -> Callable[[Any, Any], Callable[..., Any]]:
    """Return what does `act` before every call."""

    def around(module: Any, method: Callable[..., Any]) -> Callable[..., Any]:
        def wrong(*given: Any) -> Any:
            act()
            return method(*given)

        return wrong

    return around


def _start_thread() -> None:
    thread = threading.Thread(target=lambda: None)
    thread.start()
    thread.join()


def _read_file() -> None:
    Path(__file__).read_bytes()


def _writes_input(module: Any, method: Callable[..., Any]) -> Callable[..., Any]:
    def wrong(*given: Any) -> Any:
        answer = method(*given)
        for values in arrays(list(given))[:1]:
            values[...] = values + 1.0
        return answer

    return wrong


def _one_buffer(module: Any, method: Callable[..., Any]) -> Callable[..., Any]:
    kept: list[Any] = []

    def wrong(*given: Any) -> Any:
        answer = method(*given)
        for old in kept:
            for values in arrays(old)[:1]:
                values += 1.0
        kept.append(answer)
        return answer

    return wrong


_COUNT = [0]


def _counts_over_all(module: Any, method: Callable[..., Any]) -> Callable[..., Any]:
    def wrong(*given: Any) -> Any:
        _COUNT[0] += 1
        return spoil(method(*given), lambda a: a + 1e-9 * _COUNT[0])

    return wrong


def _never_forgets(module: Any, method: Callable[..., Any]) -> Callable[..., Any]:
    calls = [0]

    def wrong(*given: Any) -> Any:
        calls[0] += 1
        return spoil(method(*given), lambda a: a + 1e-9 * calls[0])

    return wrong


def _slow(module: Any, method: Callable[..., Any]) -> Callable[..., Any]:
    def wrong(*given: Any) -> Any:
        steps = 0
        while steps < 100_000:  # milliseconds, without a look at a clock
            steps += 1
        return method(*given)

    return wrong


def _lets_nan_through(module: Any, method: Callable[..., Any]) -> Callable[..., Any]:
    def wrong(*given: Any) -> Any:
        if any(not np.isfinite(a).all() for a in arrays(list(given))) or _holds_nan(given):
            answer = wrong.last
            return spoil(answer, lambda a: a * np.nan)
        wrong.last = method(*given)
        return wrong.last

    wrong.last = None  # pyright: ignore[reportFunctionMemberAccess]
    return wrong


def _holds_nan(given: tuple[Any, ...]) -> bool:
    return any(
        (isinstance(v, float) and v != v)
        or (dataclasses.is_dataclass(v) and _holds_nan(tuple(getattr(v, f.name) for f in dataclasses.fields(v))))
        for v in given
    )


GENERAL: dict[str, Mutant] = {
    "raises": Mutant("answers_soundly", _raises),
    "ends the process": Mutant("answers_soundly", _exits),
    "returns nothing": Mutant("answers_soundly", _nothing, never=("odometry", "mapper")),
    "returns NaN": Mutant("answers_soundly", _of(lambda a: a * np.nan)),
    "counts over all instances": Mutant("repeats_itself", _counts_over_all),
    "never forgets": Mutant("starts_over", _never_forgets, only=("estimator", "servo", "lower_body", "upper_body")),
    "asks for the time": Mutant("reads_no_clock", _first(time.perf_counter)),
    "sleeps": Mutant("reads_no_clock", _first(lambda: time.sleep(1e-4))),
    "reads a file": Mutant("opens_no_file", _first(_read_file)),
    "starts a thread": Mutant("starts_no_thread", _first(_start_thread)),
    "draws from random": Mutant("draws_no_shared_randomness", _first(random.random)),
    "draws from numpy": Mutant("draws_no_shared_randomness", _first(np.random.rand)),
    "draws from the system": Mutant("draws_no_shared_randomness", _first(np.random.default_rng)),
    "writes into its input": Mutant(
        "leaves_inputs_alone", _writes_input, never=("robot", "navigator", "localizer", "odometry", "mapper", "memory")
    ),
    "returns one buffer": Mutant(
        "leaves_answers_alone", _one_buffer, never=("hand", "navigator", "localizer", "mapper", "memory")
    ),
    "is slow": Mutant("keeps_its_time", _slow, only=("estimator", "hand")),
    "lets NaN through": Mutant(
        "stops_nan", _lets_nan_through, never=("robot", "localizer", "grasp_method", "odometry", "mapper", "memory")
    ),
}


Change = Callable[[Any], Any]


def changed(**fields: Any) -> Change:
    """Return what replaces fields of an answer: by values, or by functions of what they are."""

    def change(answer: Any) -> Any:
        if answer is None:
            return None
        new = {name: value(getattr(answer, name)) if callable(value) else value for name, value in fields.items()}
        return dataclasses.replace(answer, **new)

    return change


def moved(index: tuple[int, int], by: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return what adds `by` to one number of a matrix."""

    def change(matrix: np.ndarray) -> np.ndarray:
        out = matrix.copy()
        out[index] += by
        return out

    return change


def _each(change: Change) -> Change:
    return lambda answers: [change(answer) for answer in answers]


def _worse_first(grasps: list[Any]) -> list[Any]:
    return [changed(score=0.1)(grasps[0]), *grasps]


OWN: dict[tuple[str, str], tuple[str, Change]] = {
    ("estimator", "scales its rotation"): (
        "poses_are_rigid",
        changed(T_odom_base=lambda T: np.diag([1.1, 1.1, 1.1, 1.0]) @ T),
    ),
    ("estimator", "starts elsewhere"): ("starts_at_the_origin", changed(T_odom_base=moved((0, 3), 1.0))),
    ("estimator", "is surer than sure"): ("contact_is_a_probability", changed(contact=np.full(2, 2.0))),
    ("estimator", "stamps with its own time"): ("stamps_are_the_states", changed(t=lambda t: t - 1.0)),
    ("servo", "has negative gains"): ("gains_are_not_negative", changed(kp=lambda kp: kp - 300.0)),
    ("servo", "is stiff at once"): ("starts_softly", changed(kp=np.full(27, 100.0))),
    ("servo", "has gains of its own for the legs"): ("obeys_the_gains_of_the_legs", changed(kd=lambda kd: 0.5 * kd)),
    ("hand", "opens wider than it can"): ("keeps_the_range_of_the_hand", changed(gap=lambda gap: gap + 1.0)),
    ("hand", "presses harder than it can"): ("keeps_the_range_of_the_hand", changed(force=lambda f: f + 99.0)),
    ("lower_body", "sends degrees"): ("targets_are_angles_of_joints", changed(q=np.degrees)),
    ("lower_body", "has negative damping"): ("gains_are_possible", changed(kd=lambda kd: -kd)),
    ("lower_body", "is stiffer than any motor"): ("gains_are_possible", changed(kp=lambda kp: 1e4 + kp)),
    ("upper_body", "jumps"): ("targets_keep_the_limits", changed(q=lambda q: q + 0.5 * (np.arange(15) == 1))),
    ("upper_body", "leaves the limits"): ("targets_keep_the_limits", changed(q=lambda q: q + 9.0)),
    ("upper_body", "errs in an arm that is free"): ("tells_what_is_left", changed(error_position=np.ones(2))),
    ("upper_body", "tells no error"): ("tells_what_is_left", changed(error_position=np.zeros(2))),
    ("grasp_method", "scales its rotation"): (
        "poses_are_rigid",
        _each(changed(T_odom_gripper=lambda T: np.diag([1.1, 1.1, 1.1, 1.0]) @ T)),
    ),
    ("grasp_method", "puts the worse first"): ("best_grasp_comes_first", _worse_first),
    ("grasp_method", "opens wider than the hand"): ("gap_fits_the_hand", _each(changed(gap=0.2))),
    ("grasp_method", "grasps thin air"): ("grasps_the_object", _each(changed(T_odom_gripper=moved((2, 3), 0.5)))),
    ("odometry", "is elsewhere"): ("stays_where_the_robot_stands", changed(T_odom_base=moved((0, 3), 1.0))),
    ("odometry", "tilts"): (
        "stays_where_the_robot_stands",
        changed(T_odom_base=lambda T: T @ transform((0, 0, 0), rotation_rpy(0.2, 0.0, 0.0))),
    ),
    ("odometry", "heads elsewhere"): (
        "begins_at_the_origin",
        changed(T_odom_base=lambda T: transform((0, 0, 0), rotation_rpy(0.0, 0.0, 0.1)) @ T),
    ),
    ("odometry", "stands for ever"): ("notices_that_the_robot_walks", changed(T_odom_base=lambda T: np.eye(4))),
    ("odometry", "stamps with its own time"): ("stamps_are_of_now", changed(t=lambda t: t - 1.0)),
    ("odometry", "is surer than sure"): ("answers_soundly", changed(covariance=-np.eye(6))),
    ("mapper", "forgets the walls"): (
        "sees_the_floor_and_the_walls",
        changed(cells=lambda cells: np.minimum(cells, 0)),
    ),
    ("mapper", "puts the map elsewhere"): (
        "sees_the_floor_and_the_walls",
        changed(origin=lambda o: dataclasses.replace(o, x=o.x + 2.0)),
    ),
    ("mapper", "counts in bytes"): ("answers_soundly", changed(cells=lambda cells: cells.astype(np.uint8))),
    ("memory", "errs by two metres"): (
        "answers_with_where_it_was_seen",
        _each(changed(position=lambda place: place + 2.0)),
    ),
    ("memory", "is surer than sure"): ("answers_soundly", _each(changed(score=2.0))),
    ("memory", "sees last before first"): ("answers_soundly", _each(changed(last_seen=-9.0))),
    ("memory", "repeats itself in one answer"): (
        "answers_with_as_many_as_asked_for",
        lambda places: [*places, *places],
    ),
    ("navigator", "arrives at once"): ("arrives", changed(arrived=True)),
    ("navigator", "never arrives"): ("arrives", changed(arrived=False)),
    ("navigator", "walks the other way"): (
        "arrives",
        changed(twist=lambda v: dataclasses.replace(v, vx=-v.vx, vy=-v.vy)),
    ),
    ("navigator", "goes on where it has arrived"): (
        "stands_where_it_has_arrived",
        lambda step: changed(twist=changed(vx=0.3)(step.twist))(step) if step.arrived else step,
    ),
    ("localizer", "finds what nobody asked for"): (
        "finds_what_it_is_asked_for",
        _each(changed(detection=changed(label="nut"))),
    ),
    ("localizer", "puts the worse first"): ("best_score_comes_first", lambda found: found[::-1]),
    ("localizer", "is surer than sure"): (
        "best_score_comes_first",
        _each(changed(detection=changed(score=lambda score: score + 1.0))),
    ),
    ("localizer", "stamps with its own time"): ("stamps_are_the_frames", _each(changed(t=lambda t: t + 0.03))),
}
"""What one slot alone promises: (slot, what is wrong) -> (the check that names it, what happens to each answer)."""


def mutate(good: Candidate, mutant: Mutant) -> Candidate:
    """Return the module `good` with one thing wrong."""
    name = CALLS[good.slot]

    def make() -> Any:
        module = good.make()
        right = getattr(module, name)
        setattr(module, name, AsCalled(mutant.around(module, right), right))
        return module

    return Candidate(good.slot, f"{good.use}, broken", make)


class AsCalled:
    """A wrong method that takes the arguments of the right one."""

    def __init__(self, wrong: Callable[..., Any], right: Callable[..., Any]) -> None:
        """Call `wrong`, look like `right`."""
        self._wrong = wrong
        self.__signature__ = inspect.signature(right)

    def __call__(self, *given: Any) -> Any:
        """Be wrong."""
        return self._wrong(*given)
