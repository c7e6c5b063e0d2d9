"""`golem bench`: every performance figure next to its reference, in one run, in CPU time of this thread."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.base import UpperBody
from golem.capabilities.arms.diff_ik import DiffIK
from golem.capabilities.arms.postures import posture
from golem.errors import ConfigError, MissingExtra
from golem.evaluation.speed.gate_bench import check_ticks, gate_ticks
from golem.evaluation.speed.navigation_bench import navigation_times
from golem.hardware.safety.base import GateInputs, OperatorRequest, SafetyLimits
from golem.hardware.safety.gate import check
from golem.hardware.safety.memory import GateMemory
from golem.hardware.servo.servo import Servo
from golem.interfaces.payloads import EstopMessage
from golem.robots.mujoco.config import MujocoConfig, World
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.lockstep import build, start_posture
from golem.runtime.perception_nodes import CameraNode, LocalizerNode
from golem.skills.pick_config import PickGoal
from golem.stack import load_stack
from golem.types import NUM_JOINTS, TICK, UPPER, Array, Imu, LowCommand, LowState, RgbdImage


@dataclass(frozen=True)
class BenchConfig:
    """Print every performance figure next to its reference, in CPU time."""

    quick: bool = False
    """Fewer repetitions."""
    seed: int = 0
    """Seed of the episodes."""
    json: bool = False
    """Print the figures as a last line of JSON."""


@dataclass(frozen=True, slots=True)
class Figure:
    """One measured figure.

    Attributes:
        name: what was measured.
        median, p99: over the repetitions; equal where there is one.
        unit: of both.
        reference: what it is compared with, and where that comes from.
    """

    name: str
    median: float
    p99: float
    unit: str
    reference: str


def run_bench(config: BenchConfig) -> list[Figure]:
    """Measure and print.

    Raises:
        ConfigError: the seed is negative.
    """
    if config.seed < 0:
        raise ConfigError(f"--seed is {config.seed}; it must be 0 or more.")
    figures = [*_control(config), *_physics(config), *_perception(config), *_navigation(config), *_robot(config)]
    print_figures(figures)
    if config.json:
        print(json.dumps([asdict(f) for f in figures]))
    return figures


def print_figures(
    figures: Sequence[Figure], title: str = "GOLEM, CPU time of one thread", reference: str = "reference"
) -> None:
    """Print a table of figures under a title; `reference` is the head of what they are compared with."""
    table = Table("figure", "median", "p99", "unit", reference, title=title)
    for f in figures:
        table.add_row(f.name, f"{f.median:.3g}", f"{f.p99:.3g}", f.unit, f.reference)
    Console().print(table)


def timed(step: Callable[[int], object], n: int) -> Array:
    """Return the (n,) CPU times of `step(0) ... step(n - 1)` [s]."""
    times = np.empty(n)
    for i in range(n):
        start = time.thread_time_ns()
        step(i)
        times[i] = (time.thread_time_ns() - start) * 1e-9
    return times


def figure(name: str, times: Array, scale: float, unit: str, reference: str) -> Figure:
    """Return median and 99th percentile of times [s] in `unit`s of 1 / `scale` seconds."""
    return Figure(name, float(np.median(times)) * scale, float(np.quantile(times, 0.99)) * scale, unit, reference)


def _control(config: BenchConfig) -> list[Figure]:
    n = 1000 if config.quick else 20000
    figures = [ik_figure("IK tick, diff_ik", DiffIK(), min(n, 4000), "300 us wanted")]
    try:
        from golem.capabilities.arms.pink_ik import PinkIK

        figures.append(ik_figure("IK tick, pink_ik", PinkIK(), min(n, 4000), "137 us: prototype of Pink + daqp"))
    except MissingExtra as error:
        Console().print(f"pink_ik left out: {error}")
    servo, limits, memory = Servo(), SafetyLimits.from_profile(), GateMemory()
    rng = np.random.default_rng(config.seed)
    q = start_posture() + 1e-4 * rng.standard_normal((n, 27))
    imu = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))
    servo.reset(LowState(0.0, q[0], np.zeros(27), np.zeros(27), imu))

    def tick(i: int) -> None:
        nonlocal memory
        t = i * TICK
        state = LowState(t, q[i], np.zeros(27), np.zeros(27), imu)
        command = servo.step(state, q[0], TICK)
        request = OperatorRequest.ACTIVATE if i == 1 else OperatorRequest.NONE
        memory = check(GateInputs(t, state, command, EstopMessage(t, i % 256, False), request), limits, memory).memory

    figures.append(figure("safety gate tick", check_ticks(n), 1e6, "us", "25 us wanted"))
    figures.append(figure("safety process tick", gate_ticks(n), 1e6, "us", ""))
    figures.append(figure("servo + safety tick", timed(tick, n), 1e6, "us", "2000 us available at 500 Hz"))
    return figures


def ik_figure(name: str, ik: UpperBody, n: int, reference: str) -> Figure:
    """Time both hands on circles of 8 cm radius and 4 s period at 100 Hz."""
    q = start_posture()
    q[UPPER] = posture("ready")
    ik.reset(q)
    kinematics = UpperKinematics()
    left, right = kinematics.pose("left", q[UPPER]), kinematics.pose("right", q[UPPER])
    targets = []
    for i in range(n):
        phase = 2 * np.pi * i * 0.01 / 4.0
        offset = 0.08 * np.array([0.0, np.sin(phase), 1.0 - np.cos(phase)])
        pair = [left.copy(), right.copy()]
        for T in pair:
            T[:3, 3] += offset
        targets.append(pair)
    return figure(name, timed(lambda i: ik.step(targets[i][0], targets[i][1], q, 0.01), n), 1e6, "us", reference)


def _physics(config: BenchConfig) -> list[Figure]:
    """One tick of the twin on its feet, motors and hands included, limbs that stop each other or not."""
    q, zero = start_posture(on_ground=True), np.zeros(NUM_JOINTS)
    stiff = LowCommand(0.0, q, zero, zero, np.full(NUM_JOINTS, 3000.0), np.full(NUM_JOINTS, 40.0))
    worlds: tuple[World, ...] = ("open", "rubble", "pack")
    figures: list[Figure] = []
    for world, limbs in product(worlds, (False, True)):
        options = MujocoConfig(support="ground", world=world, self_collision=limbs)
        robot = MujocoRobot("ideal", config.seed, q, options)
        robot.release()
        tick = partial(robot.advance, stiff, {}, TICK)
        times = timed(lambda _, tick=tick: tick(), 500 if config.quick else 5000)
        name = f"twin's tick, {world}{', limbs stop each other' if limbs else ''}"
        figures.append(figure(name, times, 1e6, "us", "2000 us of robot time"))
        robot.close()
    return figures


def _perception(config: BenchConfig) -> list[Figure]:
    from golem.capabilities.perception.onnx_detector import OnnxDetector

    n = 5 if config.quick else 40
    _, robot = build(load_stack("tether", profile="field"), config.seed)
    detector = OnnxDetector()
    figures = []
    try:
        for camera in ("head", "right_hand"):
            info = robot.cameras[camera]
            size = f"{info.width}x{info.height}"
            robot.capture(camera)
            times = timed(lambda i, camera=camera: robot.capture(camera), n)
            figures.append(figure(f"RGB-D frame {camera} {size}", times, 1e3, "ms", "with depth noise"))
            rgb, depth = robot.capture(camera)
            frame = RgbdImage(0.0, info, rgb, depth, np.eye(4))
            times = timed(lambda i, frame=frame: detector.locate(frame, detector.classes), n)
            figures.append(figure(f"detector {camera} {size}", times, 1e3, "ms", "14.3 ms: 640x480, prototype"))
    finally:
        robot.close()
    return figures


def _navigation(config: BenchConfig) -> list[Figure]:
    """Return what mapping and navigation cost."""
    rows = navigation_times(timed, 10 if config.quick else 60)
    return [figure(name, times, 1e3, "ms", reference) for name, times, reference in rows]


def _robot(config: BenchConfig) -> list[Figure]:
    """Robot seconds per CPU second of a whole tethered pick, with and without what cameras and detector took."""
    with stopwatch(CameraNode) as cameras, stopwatch(LocalizerNode) as localizer:
        running, robot = build(load_stack("tether", profile="field"), config.seed)
        try:
            start = time.process_time()
            running.execute("pick", PickGoal())
            whole = time.process_time() - start
        finally:
            robot.close()
    blind = running.executor.t / (whole - sum(cameras) - sum(localizer))
    seeing = running.executor.t / whole
    return [
        Figure("tethered pick, cameras and detector left out", blind, blind, "robot s / CPU s", "5 wanted"),
        Figure("tethered pick with them", seeing, seeing, "robot s / CPU s", "1 wanted"),
    ]


@contextmanager
def stopwatch(
    kind: type[Any], method: str = "step", clock: Callable[[], float] = time.process_time
) -> Generator[list[float], None, None]:
    """Collect the seconds that `clock` counts in every call of a method of a class."""
    spent: list[float] = []
    original = getattr(kind, method)

    def timed(*arguments: Any) -> Any:
        start = clock()
        try:
            return original(*arguments)
        finally:
            spent.append(clock() - start)

    setattr(kind, method, timed)
    try:
        yield spent
    finally:
        setattr(kind, method, original)
