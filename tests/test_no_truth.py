"""No module of a stack can reach the simulator's truth: neither by an import nor through any object it holds."""

from __future__ import annotations

import gc
import sys
import types
import weakref
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import mujoco
import numpy as np
import pytest
from tests.sources import FILES, Code, code, name, parse

from golem import registry
from golem.interfaces import topics
from golem.middleware.bus import Topic
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.external_forces import Pushes
from golem.robots.mujoco.scene import Scene
from golem.robots.mujoco.truth import Truth
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.base import Tick
from golem.skills.pick import PickGoal
from golem.slots import SLOTS
from golem.stack import Choice, Stack

# Who may name the simulator and what is in its world: the twin itself, those who judge, teach, show and check it.
INSIDERS = (
    "robots/mujoco",
    "robots/isaaclab",
    "robots/physx",
    "robots/worlds",
    "evaluation",
    "datasets/commands.py",
    "datasets/gym_env.py",
    "training",
    "dashboard",
    "cli.py",
    "run.py",
    "demo.py",
    "demo_pack.py",
    "demo_walk.py",
    "doctor.py",
)
# The twin's robot is built from the same table as the model that the modules use.
BUILDERS = (*INSIDERS, "robots/model")
# A planner rolls out a model of its own, built from that table; which one it holds is checked below.
PLANNERS = ("capabilities/legs/mpc/planning_model.py",)
SECRETS = {
    "mujoco": (*BUILDERS, *PLANNERS),
    "golem.robots.mujoco": INSIDERS,
    # A realism profile says, among other things, how the screws of its worlds are drawn.
    "golem.robots.worlds": (*INSIDERS, "robots/sensors/profiles.py"),
    "golem.evaluation": INSIDERS,
}


def secrets(file: Code, owner: str) -> list[str]:
    """Return what the file `owner` (relative to the package) imports but must not."""
    return [
        f"{owner} imports {imported}"
        for imported in sorted(file.imports | file.dynamic)
        for secret, insiders in SECRETS.items()
        if (imported + ".").startswith(secret + ".") and not owner.startswith(insiders)
    ]


def relative(file: Code, owner: str) -> list[str]:
    """Return the relative imports of the file `owner`: they hide what is imported."""
    return [f"{owner} imports {imported}" for imported in sorted(file.imports) if imported.startswith(".")]


def test_only_insiders_import_the_simulator() -> None:
    assert len(FILES) > 600
    assert [found for path in FILES for found in secrets(code(path), name(path))] == []
    assert [found for path in FILES for found in relative(code(path), name(path))] == []


SECRET_IMPORTS = [
    "import mujoco",
    "from mujoco import MjData",
    "def f():\n    import mujoco.viewer",
    "from golem.robots import mujoco",
    "from golem.robots.mujoco.engine import MujocoRobot",
    "from golem.robots.worlds.layout import PackLayout",
    "import golem.evaluation.episodes.oracle",
    "import importlib\nimportlib.import_module('golem.evaluation.episodes.oracle')",
]


@pytest.mark.parametrize("owner", ["skills/pick.py", "runtime/lockstep.py", "hardware/servo/servo.py", "stack.py"])
def test_a_secret_import_is_found(owner: str) -> None:
    assert [leak for leak in SECRET_IMPORTS if not secrets(parse(leak), owner)] == []
    assert relative(parse("from ..robots import mujoco"), owner) != []


HOLDERS = (MujocoRobot, Scene, Truth, Pushes, LockstepRunner)
"""Who holds the truth, or drives the robot; no module may reach them."""
TRUTH = (mujoco.MjData, mujoco.MjModel, mujoco.MjSpec, *HOLDERS)
"""The same and the simulation itself, for modules that have none of their own."""


def referents(thing: Any, namespaces: set[int]) -> Iterator[Any]:
    """Yield what a piece of code that holds `thing` can get from it, other than by importing.

    Followed are attributes, items, closures, defaults, bound methods, suspended coroutines, weak references and the
    memory behind arrays. Not followed are modules, classes, and the namespaces of modules (`namespaces`, by id).
    """
    if isinstance(thing, types.ModuleType | type | types.CodeType | types.BuiltinFunctionType):
        return
    if isinstance(thing, types.FunctionType):
        yield from (thing.__closure__, thing.__defaults__, thing.__kwdefaults__, thing.__dict__)
        return
    if isinstance(thing, np.ndarray):
        yield thing.base
        if thing.dtype.hasobject:
            yield from thing.flat
        return
    if isinstance(thing, memoryview):
        yield thing.obj
    if isinstance(thing, weakref.ReferenceType):
        yield thing()
    if isinstance(thing, types.CoroutineType):
        frame = thing.cr_frame
        yield from () if frame is None else frame.f_locals.values()
    for referent in gc.get_referents(thing):
        if id(referent) not in namespaces:
            yield referent


def is_truth(thing: Any) -> bool:
    return isinstance(thing, TRUTH)


def _is_gone(thing: Any) -> bool:
    """Return whether it is a weak proxy of what is no more."""
    try:
        return thing.__class__ is None
    except ReferenceError:
        return True


def reachable(roots: Iterable[tuple[str, Any]], secret: Callable[[Any], bool] = is_truth) -> list[str]:
    """Return the ways from `roots` (name, object) to what is `secret`, each as names of types; empty if none is."""
    namespaces = {id(vars(module)) for module in list(sys.modules.values()) if hasattr(module, "__dict__")}
    seen: dict[int, Any] = {}
    queue = [(name, thing) for name, thing in roots]
    found: list[str] = []
    while queue:
        way, thing = queue.pop()
        if id(thing) in seen or _is_gone(thing):
            continue
        seen[id(thing)] = thing
        if secret(thing):
            found.append(f"{way} -> {type(thing).__name__}")
            continue
        way = f"{way} -> {type(thing).__name__}" if len(way) < 400 else way
        queue.extend((way, referent) for referent in referents(thing, namespaces))
    assert len(seen) > 100, "the walk did not get anywhere"
    return found


class Inspected:
    """A stack in the middle of a pick, with hold of every module it made."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, stack: Stack) -> None:
        self.roots: list[tuple[str, Any]] = []
        create = registry.create

        def collect(slot: str, use: str, options: Any, **context: Any) -> Any:
            module = create(slot, use, options, **context)
            if slot != "robot":
                assert not any(isinstance(value, TRUTH) for value in context.values())
                self.roots.append((slot, module))
            return module

        monkeypatch.setattr(registry, "create", collect)
        self.running, self.robot = build(stack, seed=0)
        self.run = self.running.start("pick", PickGoal())
        self.running.executor.run(0.2)
        assert self.run.result is None
        coroutine = self.run._coroutine
        self.roots += [("context", self.running.context), ("coroutine", coroutine), ("bus", self.running.bus)]

    def module(self, slot: str) -> Any:
        return next(module for name, module in self.roots if name == slot)


@pytest.fixture
def inspected(monkeypatch: pytest.MonkeyPatch) -> Iterator[Inspected]:
    """A tether stack after 0.2 s of a pick."""
    stack = Inspected(monkeypatch, Stack())
    yield stack
    stack.robot.close()


def test_no_module_holds_a_way_to_the_truth(inspected: Inspected) -> None:
    made = {name for name, _ in inspected.roots}
    assert made >= set(SLOTS) - {"robot"}
    assert inspected.running.bus.count(topics.rgbd_images("head")) > 0
    assert reachable(inspected.roots) == []


@pytest.mark.parametrize("legs", ["wbc", "mpc"])
def test_no_module_of_a_standing_robot_does(legs: str, monkeypatch: pytest.MonkeyPatch) -> None:
    on_ground = Choice("mujoco", {"support": "ground"})
    stack = Stack({"robot": on_ground, "lower_body": Choice(legs), "fallback": Choice("wbc")})
    inspected = Inspected(monkeypatch, stack)
    robot = inspected.robot

    def secret(thing: Any) -> bool:
        return isinstance(thing, HOLDERS) or thing is robot.data or thing is robot.scene.model

    assert reachable(inspected.roots, secret) == []
    # Only the planner has a simulation at all, and it is no view of the robot's.
    simulations = [way.split(" -> ")[0] for way in reachable(inspected.roots)]
    assert set(simulations) == ({"lower_body"} if legs == "mpc" else set())
    inspected.module("lower_body").planted = robot.truth
    assert any(way.endswith("Truth") for way in reachable(inspected.roots, secret))
    robot.close()


def closure(secret: Any) -> Callable[[], Any]:
    return lambda: secret


class Slotted:
    __slots__ = ("hidden",)

    def __init__(self, hidden: Any) -> None:
        self.hidden = hidden


async def suspended(secret: Any) -> None:
    await Tick()
    print(secret)


def started(secret: Any) -> Any:
    coroutine = suspended(secret)
    coroutine.send(None)
    return coroutine


LEAKS: dict[str, Callable[[MujocoRobot], Any]] = {
    "attribute": lambda robot: robot,
    "bound method": lambda robot: robot.capture,
    "closure": closure,
    "nested containers": lambda robot: {"a": [({"b": robot.data},)]},
    "slots": lambda robot: Slotted(robot.scene.model),
    "default argument": lambda robot: eval("lambda d=d: d", {"d": robot.data}),
    "coroutine": started,
    "weak reference": weakref.ref,
    "array of objects": lambda robot: np.array([robot, None], dtype=object),
    "scene": lambda robot: robot.scene,
    "truth": lambda robot: robot.truth,
    "push": lambda robot: robot.push,
}


@pytest.mark.parametrize("kind", LEAKS)
@pytest.mark.filterwarnings("ignore:coroutine")
def test_a_planted_leak_is_found(kind: str, inspected: Inspected) -> None:
    inspected.module("upper_body").planted = LEAKS[kind](inspected.robot)
    ways = reachable(inspected.roots)
    assert ways and ways[0].startswith("upper_body ->"), ways


def test_a_leak_over_the_bus_is_found(inspected: Inspected) -> None:
    inspected.running.bus.publish(Topic("leak", object), inspected.robot.data, 0.0)
    assert any("MjData" in way for way in reachable(inspected.roots))


def test_no_message_is_a_view_of_the_simulators_memory(inspected: Inspected) -> None:
    data = inspected.robot.data
    blocks = [data.qpos, data.qvel, data.ctrl, data.sensordata, data.xpos, data.qacc]
    values = list(inspected.running.bus._now.values())
    arrays = [a for a in _arrays(values) if a.size]
    assert len(arrays) > 20
    assert not any(np.shares_memory(a, block) for a in arrays for block in blocks)
    assert any(np.shares_memory(a, data.qpos) for a in _arrays([*values, {"x": data.qpos[3:5]}]))


def _arrays(values: Iterable[Any]) -> list[np.ndarray]:
    """Return every array in messages: dataclasses, tuples and mappings."""
    out: list[np.ndarray] = []
    queue = list(values)
    while queue:
        value = queue.pop()
        if isinstance(value, np.ndarray):
            out.append(value)
        elif isinstance(value, tuple | list):
            queue.extend(value)
        elif isinstance(value, dict):
            queue.extend(value.values())
        elif hasattr(value, "__dataclass_fields__"):
            queue.extend(getattr(value, name) for name in value.__dataclass_fields__)
    return out
