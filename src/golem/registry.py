"""Which implementation a name stands for, per slot of the stack.

An implementation is named by its registered name (`diff_ik`), by module and class (`my_package.legs:Squat`) or by
file and class (`my_legs.py:Squat`). Nothing is imported before it is asked for.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import importlib.util
import inspect
import sys
import typing
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from golem.errors import ConfigError, GolemError, ModuleFault, unknown_name
from golem.options import convert_all, dataclass_in, fill

_IMPLEMENTATIONS: dict[str, dict[str, str]] = {
    "robot": {
        "mujoco": "golem.robots.mujoco.engine:MujocoRobot",
        "replay": "golem.robots.replay.robot:ReplayRobot",
    },
    "estimator": {
        "tether": "golem.hardware.estimator.tether:TetherEstimator",
        "random_walk_kf": "golem.hardware.estimator.random_walk_kf:RandomWalkKF",
        "invariant_ekf": "golem.hardware.estimator.invariant_ekf:InvariantEKF",
    },
    "servo": {"pd_gravity": "golem.hardware.servo.servo:Servo"},
    "hand": {"magpie": "golem.hardware.hands.magpie:MagpieHand"},
    "lower_body": {
        "almi": "golem.capabilities.legs.almi:Almi",
        "handover": "golem.capabilities.legs.handover:Handover",
        "hold": "golem.capabilities.legs.hold:JointHold",
        "mpc": "golem.capabilities.legs.mpc.controller:MPC",
        "policy": "golem.capabilities.legs.policy:Policy",
        "vendor": "golem.capabilities.legs.vendor:Vendor",
        "wbc": "golem.capabilities.legs.wbc:Wbc",
    },
    "upper_body": {
        "diff_ik": "golem.capabilities.arms.diff_ik:DiffIK",
        "pink_ik": "golem.capabilities.arms.pink_ik:PinkIK",
    },
    "localizer": {"onnx": "golem.capabilities.perception.onnx_detector:OnnxDetector"},
    "grasp_method": {
        "centroid": "golem.capabilities.grasping.centroid:Centroid",
        "visual_servo": "golem.capabilities.grasping.visual_servo:VisualServo",
    },
    "navigator": {"goto": "golem.capabilities.navigation.goto:GoTo"},
}


def slots() -> tuple[str, ...]:
    """Return the names of the slots a stack has."""
    return tuple(_IMPLEMENTATIONS)


def names(slot: str) -> tuple[str, ...]:
    """Return the registered names of one slot."""
    return tuple(_IMPLEMENTATIONS[slot])


def register(slot: str, name: str, target: str) -> None:
    """Make `target` (`package.module:Class`) selectable as `name` in `slot`.

    Raises:
        ConfigError: the slot does not exist, or the name is taken by something else.
    """
    if slot not in _IMPLEMENTATIONS:
        raise unknown_name("slot", slot, _IMPLEMENTATIONS)
    taken = _IMPLEMENTATIONS[slot].setdefault(name, target)
    if taken != target:
        raise ConfigError(f"The name '{name}' in slot '{slot}' already stands for {taken}.")


def load(slot: str, use: str) -> type[Any]:
    """Return the class that `use` names in `slot`, importing it now.

    Raises:
        ConfigError: there is no such name, file, module or class.
        ModuleFault: importing the user's file raised.
    """
    target = _IMPLEMENTATIONS[slot].get(use, use)
    location, colon, class_name = target.rpartition(":")
    if not colon:
        raise unknown_name(f"{slot} implementation", use, _IMPLEMENTATIONS[slot])
    module = _import(slot, use, location)
    cls = getattr(module, class_name, None)
    if not inspect.isclass(cls):
        own = (v for v in vars(module).values() if inspect.isclass(v) and v.__module__ == module.__name__)
        raise unknown_name(f"class in {location}", class_name, (v.__name__ for v in own))
    return cls


def create(slot: str, use: str, options: Mapping[str, object], **context: object) -> Any:
    """Build the implementation `use` of `slot`.

    A class whose constructor takes `config` (a dataclass) gets the options as that dataclass, in which further
    dataclasses are given as mappings; any other class gets them as keyword arguments. `context` is what the stack
    itself supplies (e.g. `side`): passed where the constructor has a parameter of that name, else left out.

    Raises:
        ConfigError: an option does not exist, has the wrong type, or has no default and is missing.
        ModuleFault: the constructor raised.
    """
    cls = load(slot, use)
    what = f"option of {slot}: {use}"
    try:
        parameters = inspect.signature(cls).parameters
        supplied = {key: value for key, value in context.items() if key in parameters}
        config = _config_class(cls)
        arguments = (
            {"config": fill(what, config, options)} if config else convert_all(what, cls, options, supplied)
        )
        return cls(**arguments, **supplied)
    except GolemError:
        raise
    except (Exception, SystemExit) as error:  # a user's constructor may raise anything
        raise ModuleFault.of(slot, use, error, "its constructor raised ") from error


def _config_class(cls: type[Any]) -> type[Any] | None:
    """Return the dataclass that the constructor's parameter `config` takes, if there is one."""
    if dataclasses.is_dataclass(cls) or "config" not in inspect.signature(cls).parameters:
        return None
    return dataclass_in(typing.get_type_hints(cls.__init__).get("config"))


def _import(slot: str, use: str, location: str) -> ModuleType:
    try:
        if not location.endswith(".py"):
            return importlib.import_module(location)
        path = Path(location).expanduser().resolve()
        if not path.is_file():
            raise ConfigError(f"{slot}: '{use}' names the file {path}, which does not exist.")
        name = f"golem_user_{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"
        if name in sys.modules:
            return sys.modules[name]
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module  # dataclasses look their own module up while it loads
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[name]
            raise
        return module
    except GolemError:
        raise
    except ModuleNotFoundError as error:
        if error.name is not None and (location == error.name or location.startswith(error.name + ".")):
            raise ConfigError(
                f"{slot}: '{use}' names the module {location}, which cannot be found; "
                f"registered names: {', '.join(_IMPLEMENTATIONS[slot])}."
            ) from error
        raise ModuleFault(
            slot, use, f"it needs the package '{error.name}', which is not installed"
        ) from error
    except (Exception, SystemExit) as error:  # a user's file may raise anything
        raise ModuleFault.of(slot, use, error, "importing it raised ") from error
