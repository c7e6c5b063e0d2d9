"""`golem options`: what a stack file may set, as the sources state it."""

from __future__ import annotations

import dataclasses
import inspect
import shutil
import textwrap
import types
import typing
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from tyro.conf import Positional, arg

from golem import registry
from golem.errors import GolemError, check_known
from golem.options import dataclass_in, notes
from golem.slots import KEYS, PARTS, SLOTS
from golem.stack import SKILLS

REQUIRED = "required"
"""Shown as the default of an option that has none."""


@dataclass(frozen=True)
class OptionsConfig:
    """List what a stack file may set."""

    slot: Annotated[str | None, Positional, arg(metavar="[SLOT]", help_behavior_hint="")] = None
    """A slot, or a part such as locomotion; default: list them all."""
    use: Annotated[str | None, Positional, arg(metavar="[USE]", help_behavior_hint="")] = None
    """An implementation: a name, file.py:Class or package.module:Class; default: list those of the slot."""


@dataclass(frozen=True, slots=True)
class Option:
    """One option: its `name` in the stack file, dots leading into mappings, and its default, or `REQUIRED`."""

    name: str
    kind: str
    default: str
    text: str


def run_options(config: OptionsConfig) -> None:
    """Print what `options_text` returns."""
    print(options_text(config))


def options_text(config: OptionsConfig) -> str:
    """Return the list. Raises ConfigError: there is no such slot or implementation; ModuleFault: its import raised."""
    if config.slot is None:
        return _everything()
    name = registry.SKILL if config.slot == SKILLS else config.slot
    name = KEYS[name].slot if name in KEYS else name
    if name in PARTS:
        cls = registry.part_class(name)
        return _page(name, cls, options_of(cls))
    check_known("slot", {**KEYS, **SLOTS, **PARTS}, name)
    if config.use is None:
        return _slot(name)
    cls = registry.load(name, config.use)
    target = registry.config_class(cls) or cls
    return _page(f"{name}: {config.use}", cls, options_of(target, SLOTS[name].supplied))


def options_of(cls: type[Any], supplied: tuple[str, ...] = (), default: Any = None) -> Iterator[Option]:
    """Yield the options of a config dataclass, those of dataclasses inside it after them, or of a constructor.

    Args:
        cls: the dataclass, or a class that takes its options as keyword arguments.
        supplied: parameters that are no options.
        default: an instance of the dataclass whose values are the defaults; None takes those of the class.
    """
    texts: dict[str, str] = {}
    for one in reversed(cls.__mro__):
        texts |= notes(one.__doc__)
    if not dataclasses.is_dataclass(cls):
        texts |= notes(cls.__init__.__doc__)
    hints = typing.get_type_hints(cls if dataclasses.is_dataclass(cls) else cls.__init__)
    for name, value in _defaults(cls, default).items():
        if name in supplied:
            continue
        hint, text = hints.get(name, Any), texts.get(name, "")
        inner = dataclass_in(hint)
        if inner is None:
            yield Option(name, _kind(hint), _shown(value), text)
            continue
        optional = type(None) in typing.get_args(hint)
        kind = "mapping or off" if optional else "mapping"
        yield Option(name, kind, "off" if value is None else REQUIRED if value == REQUIRED else "", text)
        for option in options_of(inner, default=value if isinstance(value, inner) else None):
            yield dataclasses.replace(option, name=f"{name}.{option.name}")


def _everything() -> str:
    rows = [(slot, f"{', '.join(registry.names(slot))}{_default_of(slot)}") for slot in SLOTS]
    rows += [(name, _first_line(registry.part_class(name))) for name in PARTS]
    wide = max(len(name) for name, _ in rows)
    lines = [f"{name:{wide}}  {text}" for name, text in rows]
    return "\n".join([*lines, "", "golem options SLOT lists its modules, golem options SLOT USE the options of one."])


def _default_of(slot: str) -> str:
    row = KEYS.get(slot)
    if row is None:
        return ""
    return f"  (default: {row.default}{f', on its feet {row.standing}' if row.standing else ''})"


def _slot(slot: str) -> str:
    lines = [f"{slot}: {_first_line(registry.contract(slot))}", ""]
    names = registry.names(slot)
    for name in names:
        try:
            text = _first_line(registry.load(slot, name))
        except GolemError as error:  # of one that cannot be loaded here the others are none the worse
            text = str(error)
        lines.append(f"  {name:{max(map(len, names))}}  {text}")
    return "\n".join([*lines, "", "or package.module:Class, or file.py:Class."])


def _page(title: str, cls: type[Any], options: Iterator[Option]) -> str:
    width = shutil.get_terminal_size().columns
    lines = [f"{title}: {_first_line(cls)}", ""]
    for option in options:
        lines.append(f"  {option.name}: {option.kind}" + (f" = {option.default}" if option.default else ""))
        lines += textwrap.wrap(option.text, width, initial_indent="      ", subsequent_indent="      ")
    return "\n".join(lines if len(lines) > 2 else [*lines, "  It has no options."])


def _defaults(cls: type[Any], default: Any) -> Mapping[str, Any]:
    if default is not None:
        return {f.name: getattr(default, f.name) for f in dataclasses.fields(cls)}
    if not dataclasses.is_dataclass(cls):
        parameters = inspect.signature(cls).parameters.values()
        named = [p for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
        return {p.name: REQUIRED if p.default is p.empty else p.default for p in named}
    found: dict[str, Any] = {}
    for f in dataclasses.fields(cls):
        made = f.default if f.default_factory is dataclasses.MISSING else f.default_factory()
        found[f.name] = REQUIRED if made is dataclasses.MISSING else made
    return found


def _first_line(cls: type[Any]) -> str:
    """Return the first line of a class's docstring, but not of one that `dataclass` wrote."""
    line = inspect.cleandoc(cls.__doc__ or "").partition("\n")[0]
    return "" if line.startswith(f"{cls.__name__}(") else line


def _kind(hint: Any) -> str:
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin is typing.Literal:
        return " or ".join(str(value) for value in inner)
    if origin in (typing.Union, types.UnionType):
        return " or ".join("off" if kind is type(None) else _kind(kind) for kind in inner)
    if origin in (tuple, list):
        kinds = [_kind(kind) for kind in inner if kind is not ...]
        return f"list of {kinds[0]}" if ... in inner or origin is list else f"[{', '.join(kinds)}]"
    return "any" if hint is Any else getattr(hint, "__name__", str(hint))


def _shown(value: Any) -> str:
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(_shown, value))}]"
    if value is None:
        return "off"
    return f"{value:g}" if isinstance(value, float) else str(value)
