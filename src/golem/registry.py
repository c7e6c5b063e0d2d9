"""Which implementation a name stands for, per slot of the stack.

An implementation is named by its registered name (`diff_ik`), by module and class (`my_package.legs:Squat`) or by
file and class (`my_legs.py:Squat`). An installed package registers a name by an entry point of the group
`golem.<slot>`. Nothing is imported before it is asked for.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib
import inspect
import sys
import typing
from collections.abc import Collection, Generator, Mapping
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Any

from golem.errors import ConfigError, GolemError, ModuleFault, unknown_name
from golem.options import convert_all, dataclass_in, fill
from golem.slots import PARTS, SLOTS
from golem.user_file import import_file

PACKAGE = "golem-humanoid"
"""Distribution of the shipped implementations."""
GROUP = "golem."
"""What the group of an entry point begins with; the slot follows."""
SKILL = "skill"
"""The one slot of which a stack has any number of modules, each under a name of its own."""


def names(slot: str) -> tuple[str, ...]:
    """Return the registered names of one slot: the shipped ones, then those of other installed packages."""
    return tuple(dict.fromkeys((*SLOTS[slot].shipped, *_others(slot, tuple(sys.path)))))


def contract(slot: str) -> type[Any]:
    """Return the protocol that the modules of `slot` satisfy."""
    return _attribute(SLOTS[slot].contract)


def requires(slot: str, use: str) -> tuple[str, ...]:
    """Return what `use` of `slot` cannot do without; see `golem.stack.Stack.check`. Raises as `load` does."""
    return tuple(getattr(load(slot, use), "requires", ()))


def load(slot: str, use: str) -> type[Any]:
    """Return the class that `use` names in `slot`, importing it now.

    Raises:
        ConfigError: there is no such name, file, module or class, or two packages register the name.
        ModuleFault: importing the user's file raised.
    """
    location, colon, class_name = _target(slot, use).rpartition(":")
    if not colon:
        if use.endswith(".py") or Path(f"{use}.py").is_file():
            raise ConfigError(f"'{use}' names a file and no class in it; write {use.removesuffix('.py')}.py:CLASS.")
        raise unknown_name(f"{slot} implementation", use, names(slot))
    module = _import(slot, use, location)
    cls = getattr(module, class_name, None)
    if not inspect.isclass(cls):
        own = (v for v in vars(module).values() if inspect.isclass(v) and v.__module__ == module.__name__)
        raise unknown_name(f"class in {location}", class_name, (v.__name__ for v in own))
    return cls


def resolve(slot: str, use: str, options: Mapping[str, object]) -> tuple[str, Mapping[str, object]]:
    """Return `use` and its options; for a file that an implementation of `slot` takes, that implementation's.

    A leg policy's file, `policy.onnx`, stands for `policy` with the option `file: policy.onnx`.
    """
    name = SLOTS[slot].files.get(Path(use).suffix)
    return (use, options) if name is None else (name, {"file": use, **options})


def create(slot: str, use: str, options: Mapping[str, object], **context: object) -> Any:
    """Build the implementation `use` of `slot`.

    A class whose constructor takes `config` (a dataclass) gets the options as that dataclass, in which further
    dataclasses are given as mappings; any other class gets them as keyword arguments. `context` is what the stack
    itself supplies (e.g. `side`): passed where the constructor has a parameter of that name, else left out.

    Raises:
        ConfigError: an option does not exist, has the wrong type, or has no default and is missing.
        ModuleFault: the constructor raised.
    """
    use, options = resolve(slot, use, options)
    cls = load(slot, use)
    with _blamed(slot, use):
        parameters = inspect.signature(cls).parameters
        supplied = {key: value for key, value in context.items() if key in parameters}
        return cls(**_given(slot, use, cls, options, supplied), **supplied)


def check(slot: str, use: str, options: Mapping[str, object]) -> None:
    """Check that the implementation `use` is one of `slot` and has these `options`, without building it.

    A class that lacks a method of the slot's contract is of another slot.

    Raises:
        ConfigError: it lacks methods, or see `create`.
        ModuleFault: see `load`.
    """
    cls, asked = load(slot, use), contract(slot)
    lacking = _lacking(cls, asked)
    if lacking:
        fits = [name for name in SLOTS if name != slot and not _lacking(cls, contract(name))]
        hint = f"; it fits the slot {' or '.join(fits)}" if fits else ""
        raise ConfigError(
            f"'{use}' is no {slot}: it lacks {', '.join(lacking)} of the contract {asked.__name__}{hint}; "
            f"valid: {', '.join(names(slot))}, or a class of yours."
        )
    with _blamed(slot, use):
        _given(slot, use, cls, options, SLOTS[slot].supplied)


def _lacking(cls: type[Any], asked: type[Any]) -> list[str]:
    """Return the methods of the contract `asked` that the class `cls` has not; one with `__getattr__` has all."""
    methods = [n for n, v in vars(asked).items() if inspect.isfunction(v) and not n.startswith("_")]
    return [] if hasattr(cls, "__getattr__") else [name for name in methods if not hasattr(cls, name)]


def _given(
    slot: str, use: str, cls: type[Any], options: Mapping[str, object], supplied: Collection[str]
) -> dict[str, Any]:
    if config_class(cls) is not None:
        return {"config": configure(slot, use, options)}
    return convert_all(_option(slot, use), cls, options, supplied)


@contextmanager
def _blamed(slot: str, use: str) -> Generator[None, None, None]:
    """Turn what a user's constructor raises, which may be anything, into its fault."""
    try:
        yield
    except GolemError:
        raise
    except (Exception, SystemExit) as error:
        raise ModuleFault.of(slot, use, error, "its constructor raised ") from error


def configure(slot: str, use: str, options: Mapping[str, object]) -> Any:
    """Return the config dataclass of `use` of `slot`, with `options`, None if it has none. Raises as `create` does."""
    use, options = resolve(slot, use, options)
    config = config_class(load(slot, use))
    return None if config is None else fill(_option(slot, use), config, options)


def part(name: str, options: Mapping[str, object]) -> Any:
    """Return the config of the part `name` of `golem.slots.PARTS`. Raises ConfigError: an option is wrong."""
    return fill(f"option of {name}", part_class(name), options)


def part_class(name: str) -> type[Any]:
    """Return the config dataclass of the part `name`."""
    return _attribute(PARTS[name])


def config_class(cls: type[Any]) -> type[Any] | None:
    """Return the dataclass that the constructor's parameter `config` takes, if there is one."""
    if dataclasses.is_dataclass(cls) or "config" not in inspect.signature(cls).parameters:
        return None
    return dataclass_in(typing.get_type_hints(cls.__init__).get("config"))


def _option(slot: str, use: str) -> str:
    return f"option of {slot}: {use}"


def _attribute(target: str) -> type[Any]:
    location, _, name = target.rpartition(":")
    return getattr(importlib.import_module(location), name)


def _target(slot: str, use: str) -> str:
    """Return the `module:Class` that `use` stands for, or `use`. Raises ConfigError: two packages register it."""
    shipped = SLOTS[slot].shipped
    use = SLOTS[slot].files.get(Path(use).suffix, use)
    owners = [(PACKAGE, shipped[use])] if use in shipped else []
    owners += _others(slot, tuple(sys.path)).get(use, [])
    if len(owners) > 1:
        packages = " and ".join(package for package, _ in owners)
        raise ConfigError(
            f"The name '{use}' in slot '{slot}' is registered by {packages}; name the class itself, e.g. "
            f"{owners[-1][1]}, or remove one of the packages."
        )
    return owners[0][1] if owners else use


@functools.cache
def _others(slot: str, path: tuple[str, ...]) -> dict[str, list[tuple[str, str]]]:
    """Return what the packages on the import `path` register in `slot`: name -> (package, `module:Class`) of each."""
    found: dict[str, list[tuple[str, str]]] = {}
    for point in metadata.entry_points(group=GROUP + slot):
        package = "a package without a name" if point.dist is None else point.dist.name
        found.setdefault(point.name, []).append((package, point.value))
    return found


def _import(slot: str, use: str, location: str) -> ModuleType:
    try:
        if not location.endswith(".py"):
            return importlib.import_module(location)
        path = Path(location).expanduser().resolve()
        if not path.is_file():
            raise ConfigError(f"{slot}: '{use}' names the file {path}, which does not exist.")
        return import_file(path)
    except GolemError:
        raise
    except ModuleNotFoundError as error:
        if error.name is not None and (location == error.name or location.startswith(error.name + ".")):
            raise ConfigError(
                f"{slot}: '{use}' names the module {location}, which cannot be found (a file: FILE.py:CLASS); "
                f"registered names: {', '.join(names(slot))}."
            ) from error
        raise ModuleFault(slot, use, f"it needs the package '{error.name}', which is not installed") from error
    except (Exception, SystemExit) as error:  # a user's file may raise anything
        raise ModuleFault.of(slot, use, error, "importing it raised ") from error
