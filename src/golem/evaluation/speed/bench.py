"""`golem bench`: every performance figure next to its reference, in one run, in CPU time of this thread."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import closing, contextmanager
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
from golem.capabilities.mapping.voxel_grid import VoxelGridMapper
from golem.capabilities.navigation.astar import Way, astar
from golem.capabilities.navigation.costmap import INSCRIBED, Costmap
from golem.capabilities.navigation.footprint import HOME
from golem.capabilities.navigation.local_controller import Around, LocalController, LocalControllerConfig
from golem.errors import ConfigError, GolemError, MissingExtra
from golem.evaluation.conformance.room import ROOM, MadeWalk
from golem.hardware.estop.estop_config import VirtualEstop
from golem.hardware.safety.base import GateInputs, OperatorRequest, SafetyLimits
from golem.hardware.safety.gate import Gate, check
from golem.hardware.safety.memory import GateMemory
from golem.hardware.servo.servo import Servo
from golem.interfaces import public
from golem.interfaces.nav_payloads import OccupancyGrid
from golem.interfaces.payloads import EstopMessage, GateState
from golem.interfaces.ros_convert import base_estimate
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros import names
from golem.middleware.ros.codec import dds_name
from golem.middleware.ros.msgs.std_srvs import Trigger_Request
from golem.middleware.ros.node import RosNode
from golem.middleware.wire.convert import encode_low_command, encode_low_state
from golem.robots.mujoco.config import MujocoConfig, World
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.live.safety_process import SafetyProcess
from golem.runtime.lockstep import build, start_posture
from golem.runtime.perception_nodes import CameraNode, LocalizerNode
from golem.skills.pick_config import PickGoal
from golem.stack import load_stack
from golem.types import NUM_JOINTS, TICK, UPPER, Array, BaseEstimate, Imu, LowCommand, LowState, PlanarPose, RgbdImage


@dataclass(frozen=True, slots=True)
class Figure:
    """One measured figure.

    Attributes:
        median, p99: over the repetitions; equal where there is one.
        unit: of both.
        reference: what it is compared with, and where that comes from.
    """

    name: str
    median: float
    p99: float
    unit: str
    reference: str


@dataclass(frozen=True, kw_only=True)
class BenchOutput:
    """What every bench is asked."""

    seed: int = 0
    """Of what is drawn."""
    json: bool = False
    """Print the figures as a last line of JSON."""

    def told(self, figures: list[Figure]) -> list[Figure]:
        """Return the figures, which are printed as JSON where that is asked for."""
        if self.json:
            print(json.dumps([asdict(f) for f in figures]))
        return figures


@dataclass(frozen=True)
class BenchConfig(BenchOutput):
    """Print every performance figure next to its reference, in CPU time."""

    quick: bool = False
    """Fewer repetitions."""


def run_bench(config: BenchConfig) -> list[Figure]:
    """Measure and print. Raises ConfigError: the seed is negative."""
    if config.seed < 0:
        raise ConfigError(f"--seed is {config.seed}; it must be 0 or more.")
    figures = [*_control(config), *_physics(config), *_perception(config), *_navigation(config), *_robot(config)]
    print_figures(figures)
    return config.told(figures)


def print_figures(figures: Sequence[Figure], title: str = "GOLEM, CPU time of one thread") -> None:
    """Print a table of figures under a title."""
    table = Table("figure", "median", "p99", "unit", "reference", title=title)
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
    with closing(robot):
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
    return figures


def _navigation(config: BenchConfig) -> list[Figure]:
    rows = navigation_times(timed, 10 if config.quick else 60)
    return [figure(name, times, 1e3, "ms", reference) for name, times, reference in rows]


SIDE, BOXES = 400, 60
"""Cells along each side of the map, and boxes of 1 m on it."""


def navigation_times(timed: Callable[[Callable[[int], object], int], Array], n: int) -> list[tuple[str, Array, str]]:
    """Return names, CPU times of `n` repetitions by `timed` [s], and what they are compared with."""
    rng = np.random.default_rng(0)
    cells = np.zeros((SIDE, SIDE), np.int8)
    for r, c in rng.integers(20, SIDE - 40, (BOXES, 2)):
        cells[r : r + 20, c : c + 20] = 100
    grid = OccupancyGrid(0.0, PlanarPose(0.0, 0.0, 0.0), 0.05, cells)
    costmap = Costmap(grid, np.zeros((0, 2)), 0.3)
    walk, mapper = MadeWalk(ROOM, still=1e3, every=1), VoxelGridMapper()
    scans = walk.base_scans(n + 3, np.random.default_rng(1))
    for scan in scans[:3]:
        mapper.add_scan(scan)
    mapper.grid()

    def search(i: int) -> object:
        return astar(costmap.cost, (2, 2), (SIDE - 3, SIDE - 3), 0.02, INSCRIBED)

    local, pose, goal = (LocalController(LocalControllerConfig()), PlanarPose(1.0, 1.0, 0.8), PlanarPose(4.0, 4.0, 0.0))
    way, frame = Way(np.linspace((1.0, 1.0), (4.0, 4.0), 80)), np.array([0.0, 0.0, 1.0, 0.0, 0.05])

    def follow(i: int) -> object:
        return local.follow(pose, way, goal, HOME, Around(costmap.clearance, frame))

    search(0)
    follow(0)
    return [
        ("map: one scan of 20,000 points", timed(lambda i: mapper.add_scan(scans[i + 3]), n), "100 ms: 10 Hz"),
        ("costmap of 400 x 400", timed(lambda i: Costmap(grid, np.zeros((0, 2)), 0.3), n), "100 ms: 10 Hz"),
        ("A* over 400 x 400, corner to corner", timed(search, n), "20 ms (issue 28)"),
        ("local controller: one twist", timed(follow, n), "50 ms: 20 Hz"),
    ]


def _robot(config: BenchConfig) -> list[Figure]:
    """Robot seconds per CPU second of a whole tethered pick, with and without what cameras and detector took."""
    with stopwatch(CameraNode) as cameras, stopwatch(LocalizerNode) as localizer:
        running, robot = build(load_stack("tether", profile="field"), config.seed)
        with closing(robot):
            start = time.process_time()
            running.execute("pick", PickGoal())
            whole = time.process_time() - start
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


WARM_UP = 500
"""Ticks of the gate alone that are not timed; it is activated half-way."""


def gate_ticks(n: int) -> Array:
    """Return the (n,) CPU times of ticks of an active gate with new frames each [s]. Raises GolemError: not active."""
    domain, clock = LocalDomain(), 0.0
    safety, robot = domain.participant(), domain.participant()
    limits, estop = SafetyLimits.from_profile(), VirtualEstop()
    gate = SafetyProcess(safety, RosNode(safety, "safety"), limits, estop, clock=lambda: clock)
    states, commands = (
        robot.writer(names.topic(row.name), dds_name(row.type), row.qos)
        for row in (public.topic("/lowstate"), public.topic("/safety/lowcmd_in"))
    )
    node, base = RosNode(robot, "others"), public.topic("/base_estimate")
    estimates = node.publisher(base.name, base.type, base.qos)
    activate = node.client("/safety/activate", public.TRIGGER)
    q, zeros = start_posture(), np.zeros(NUM_JOINTS)
    up, noise = np.array([1.0, 0.0, 0.0, 0.0]), np.random.default_rng(0)
    command = LowCommand(0.0, q, zeros, zeros, np.full(NUM_JOINTS, 100.0), np.full(NUM_JOINTS, 3.0))
    times: list[float] = []
    for i in range(1, 2 * n + 1):
        clock = i * TICK
        dq, shake = 1e-3 * noise.standard_normal((2, NUM_JOINTS))
        imu = Imu(up, shake[:3], np.array([0.0, 0.0, 9.81]) + shake[3:6])
        states.write(encode_low_state(LowState(clock, q, dq, zeros, imu)))
        commands.write(encode_low_command(command, 0, answers=clock))
        estimates.publish(base_estimate(BaseEstimate(clock, np.eye(4))))
        start = time.thread_time_ns()
        gate.step()
        if i > n:
            times.append((time.thread_time_ns() - start) * 1e-9)
        if i == n // 2:
            activate.call(Trigger_Request())
    if gate.status.state is not GateState.ACTIVE:
        raise GolemError(f"The gate is {gate.status.state} ({gate.status.why}), not active.")
    return np.array(times)


def check_ticks(n: int) -> Array:
    """Return the (n,) CPU times of the gate alone, with new frames at each tick [s]. Raises GolemError: not active."""
    gate, noise = Gate(), np.random.default_rng(0)
    q, zeros, up = start_posture(), np.zeros(NUM_JOINTS), np.array([1.0, 0.0, 0.0, 0.0])
    kp, kd = np.full(NUM_JOINTS, 100.0), np.full(NUM_JOINTS, 3.0)
    times: list[float] = []
    for i in range(1, WARM_UP + n + 1):
        t, shake = i * TICK, 1e-3 * noise.standard_normal((4, NUM_JOINTS))
        imu = Imu(up, shake[3, :3], np.array([0.0, 0.0, 9.81]) + shake[3, 3:6])
        state = LowState(t, q + 10.0 * shake[0], shake[1], shake[2], imu)
        command = LowCommand(t, q + shake[0], zeros, shake[2], kp, kd)
        request = OperatorRequest.ACTIVATE if i > WARM_UP // 2 else OperatorRequest.NONE
        estop, base = EstopMessage(t, i % 65536, False), BaseEstimate(t, np.eye(4))
        inputs = GateInputs(t, state, command, estop, request, base)
        start = time.thread_time_ns()
        result = gate.step(inputs)
        if i > WARM_UP:
            times.append((time.thread_time_ns() - start) * 1e-9)
    if result.state is not GateState.ACTIVE:
        raise GolemError(f"The gate is {result.state} ({result.reason}: {result.detail}), not active.")
    return np.array(times)
