"""Reads YAML and turns option values into what a constructor's type hints ask for, or says why it cannot."""

from __future__ import annotations

import dataclasses
import inspect
import re
import types
import typing
from collections.abc import Collection, Mapping
from math import inf
from pathlib import Path
from typing import Any, cast

import numpy as np
import yaml

from golem.errors import ConfigError, shorten, unknown_name
from golem.types import Array

_SCALARS: dict[Any, tuple[tuple[type, ...], str]] = {
    bool: ((bool,), "true or false"),
    int: ((int,), "an integer"),
    float: ((int, float), "a number"),
    str: ((str,), "a word"),
    Path: ((str, Path), "a path"),
}
"""What a value must be for a type hint, and how to say it."""
_NAMED = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)


def fill(what: str, config: type[Any], options: Mapping[str, object]) -> Any:
    """Return an instance of the dataclass `config` with `options`; dataclasses inside it are given as mappings.

    Args:
        what: what the options are to the user, e.g. `"option of upper_body: diff_ik"`.
        options: values by field name.

    Raises:
        ConfigError: an option does not exist, has the wrong type, or has no default and is missing.
    """
    return config(**convert_all(what, config, options))


def convert_all(
    what: str, function: type[Any], options: Mapping[str, object], supplied: Collection[str] = ()
) -> dict[str, Any]:
    """Return `options` as keyword arguments of the class `function`, converted to its type hints.

    Args:
        what: what the options are to the user.
        function: the class to be called.
        options: values by parameter name.
        supplied: parameters that the caller passes itself.

    Raises:
        ConfigError: as in `fill`.
    """
    parameters = inspect.signature(function).parameters
    valid = {k: p for k, p in parameters.items() if k not in supplied and p.kind in _NAMED}
    takes_any = any(p.kind is inspect.Parameter.VAR_KEYWORD for p in parameters.values())
    for key in options:
        if key not in valid and not takes_any:
            raise unknown_name(what, key, valid)
    for key, parameter in valid.items():
        if parameter.default is parameter.empty and key not in options:
            raise ConfigError(f"The {what} '{key}' has no default and must be given.")
    hints = typing.get_type_hints(function if dataclasses.is_dataclass(function) else function.__init__)
    return {key: convert(f"{what} '{key}'", hints.get(key), value) for key, value in options.items()}


def read_yaml(text: str, name: str, foreign: bool = False) -> object:
    """Return what the YAML `text` of the file called `name` says: None, a scalar, a list or a mapping.

    Args:
        text: the file's text.
        name: the file, for messages.
        foreign: whether another program wrote it: its Python objects are read as None
            then, and of a key that is named twice the last counts, as other readers have it.

    Raises:
        ConfigError: it is not YAML, names a key twice, or refers to itself; names the line.
    """
    try:
        return yaml.load(text, _ForeignLoader if foreign else _Loader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        raise ConfigError(f"{name}{where}: not valid YAML ({getattr(error, 'problem', error)}).") from error
    except (ValueError, RecursionError) as error:  # PyYAML lets them through: `2024-99-99`, `[[[...`
        raise ConfigError(f"{name}: not valid YAML ({error}).") from error


def check_values(where: str, value: object) -> None:
    """Check that `value`, found at `where`, is made of words, numbers, truth values, lists and mappings by name.

    Raises ConfigError: it holds something else, or a number that is none.
    """
    if isinstance(value, Mapping):
        for key, inner in value.items():
            if not isinstance(key, str):
                raise ConfigError(f"{where}: an option's name is a word, not {key!r}.")
            check_values(f"{where}.{key}", inner)
    elif isinstance(value, list):
        for inner in value:
            check_values(where, inner)
    elif value != value:
        raise ConfigError(f"{where}: a number that is none (.nan) is no value.")
    elif not isinstance(value, str | int | float | None):
        raise ConfigError(
            f"{where}: a value is a word, a number, true, false, a list or a mapping, not a {type(value).__name__}."
        )


def vector(what: str, value: object, size: int, *shorter: int) -> Array:
    """Return the option `value`, one number or a list, as a (size,) array; a shorter list is repeated.

    Args:
        what: what the option is to the user, e.g. `"kp"`.
        value: as it stands in the file.
        size: length of a full list.
        shorter: the other lengths that are accepted, divisors of `size`.

    Raises:
        ConfigError: it is no list of finite numbers, or has another length.
    """
    lengths = (1, *shorter, size)
    wanted = f"one number or a list of {' or '.join(str(n) for n in lengths[1:])}"
    numbers = cast("list[object]", list(value) if isinstance(value, list | tuple) else [value])
    if not all(isinstance(x, int | float) and not isinstance(x, bool) and abs(x) < inf for x in numbers):
        raise ConfigError(f"The {what} is {wanted}, each finite, not {value!r}.")
    if len(numbers) not in lengths:
        raise ConfigError(f"The {what} is {wanted}, not a list of {len(numbers)}.")
    return np.resize(np.array(numbers, dtype=np.float64), size)


def require(where: str, *rows: tuple[str, float, bool, str]) -> None:
    """Check numbers, each given with its name, whether it is fine, and what is wanted, e.g. "a positive number".

    Args:
        where: what goes before the names, e.g. "gait.".
        rows: name, value, whether it is fine, what is wanted.

    Raises:
        ConfigError: one is not; about the first.
    """
    for what, value, fine, wanted in rows:
        if not fine:
            raise ConfigError(f"The {where}{what} is {wanted}, not {value:g}.")


def notes(doc: str | None) -> dict[str, str]:
    """Return what the sections `Attributes` and `Args` of a docstring in Google style say, by name."""
    found: dict[str, str] = {}
    for section in re.findall(r"^(?:Attributes|Args):((?:\n(?: .*)?)*)", inspect.cleandoc(doc or ""), re.MULTILINE):
        entries = re.findall(r"^    (\w+(?:, \w+)*)(?: \([^)]*\))?: *(.*(?:\n {5}.*)*)", section, re.MULTILINE)
        for names, text in entries:
            found |= dict.fromkeys(names.split(", "), " ".join(text.split()))
    return found


def dataclass_in(hint: Any) -> type[Any] | None:
    """Return the dataclass that a type hint is, or has among its alternatives."""
    if typing.get_origin(hint) in (tuple, list):
        return None
    for candidate in (hint, *typing.get_args(hint)):
        if inspect.isclass(candidate) and dataclasses.is_dataclass(candidate):
            return candidate
    return None


def convert(what: str, hint: Any, value: Any) -> Any:
    """Return `value` as the type hint asks for it; a hint that is not understood here accepts anything.

    Args:
        what: what the value is to the user.
        hint: type hint of a parameter or field.
        value: as YAML or JSON has it.

    Raises:
        ConfigError: it has another type.
    """
    config = dataclass_in(hint)
    if config is not None and isinstance(value, Mapping):
        return fill(f"key of {what.removeprefix('key of ')}", config, cast(Mapping[str, object], value))
    if config is not None and hint is config and not isinstance(value, config):
        names = ", ".join(f.name for f in dataclasses.fields(config))
        raise ConfigError(f"The {what} is a mapping with keys from {names}; not {shorten(repr(value))}.")
    if hint in _SCALARS:
        kinds, wanted = _SCALARS[hint]
        if not isinstance(value, kinds) or (isinstance(value, bool) and hint is not bool):
            raise ConfigError(f"The {what} is {wanted}, not {shorten(repr(value))}.")
        return hint(value)
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin in (types.UnionType, typing.Union) and len(inner) == 2 and inner[1] is type(None):
        # `off` is how YAML spells false: it switches off what may be absent.
        absent = value is None or (value is False and inner[0] is not bool)
        return None if absent else convert(what, inner[0], value)
    if origin is typing.Literal and value not in inner:
        raise unknown_name(f"value of {what}", str(value), map(str, inner))
    if origin in (tuple, list):
        return _sequence(what, origin, inner, value)
    return value


def _sequence(what: str, kind: type[Any], inner: tuple[Any, ...], value: Any) -> Any:
    """Return the list `value` as a tuple or list whose members have the types `inner`."""
    if not isinstance(value, list | tuple):
        raise ConfigError(f"The {what} is a list, not {shorten(repr(value))}.")
    members = cast(list[Any], list(cast(Any, value)))
    hints = (*inner[:1],) * len(members) if kind is list or inner[-1] is ... else inner
    if len(members) != len(hints):
        raise ConfigError(f"The {what} has {len(hints)} values, not {len(members)}.")
    return kind([convert(what, hint, member) for hint, member in zip(hints, members, strict=True)])


class _Loader(yaml.SafeLoader):
    """YAML whose mappings name each key once, and in which nothing refers to itself."""

    repeats = False

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Refuse aliases: no file of ours has a use for them, and they can nest without end."""
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark
            raise yaml.constructor.ConstructorError(None, None, "aliases are not allowed", mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Return the mapping of `node`, in which no key may occur twice."""
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise yaml.constructor.ConstructorError(None, None, "a key is one word", key.start_mark)
            if key.value in seen and not self.repeats:
                raise yaml.constructor.ConstructorError(None, None, f"'{key.value}' occurs twice", key.start_mark)
            seen.add(str(key.value))
        return super().construct_mapping(node, deep)


# YAML 1.1 reads 1e-6, which has no point, and 1.5e2, whose exponent has no sign, as words.
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$"), list("-+.0123456789")
)


class _ForeignLoader(_Loader):
    """The same, which makes nothing of Python objects, and takes the last of equal keys."""

    repeats = True


def _nothing(loader: yaml.SafeLoader, suffix: str, node: yaml.Node) -> None:
    """Read any Python object as None."""


_ForeignLoader.add_multi_constructor("tag:yaml.org,2002:python/", _nothing)
