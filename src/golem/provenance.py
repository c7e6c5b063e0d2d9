"""Which code, packages and configuration a trial was run with."""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import json
import os
import platform
import re
import shlex
import subprocess
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import MISSING, asdict, fields, is_dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, cast

import golem
from golem.capabilities.legs.passports.read import read_passport
from golem.errors import ConfigError, OutputError
from golem.slots import KEYS
from golem.stack import Stack
from golem.user_file import neighbours

PACKAGES = ("golem-humanoid", "numpy", "scipy", "mujoco", "pin", "daqp", "onnxruntime", "torch")
"""Distributions whose version may change a trial's outcome."""


def digest(data: Mapping[str, Any]) -> str:
    """Return 16 hex digits that identify JSON-like `data`, whatever the order of its keys."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def command_line(start: str, config: Any, always: Collection[str] = ()) -> str:
    """Return the command that runs a configuration.

    Args:
        start: its first words.
        config: dataclass of its options, as tyro reads it; a dataclass within it has no prefix. What is the default
            is left out.
        always: names of options that are said all the same.
    """
    words = [start]
    for option in fields(config):
        value, name = getattr(config, option.name), option.name.replace("_", "-")
        default = option.default if option.default_factory is MISSING else option.default_factory()
        if is_dataclass(value):
            words.append(command_line("", value))
        elif option.name in always or value != default:
            values = value if isinstance(value, tuple) else () if isinstance(value, bool) else (value,)
            dashes = "-" if len(name) == 1 else "--no-" if value is False else "--"
            words += [dashes + name, *(shlex.quote(str(v)) for v in values)]
    return " ".join(word for word in words if word)


def changes(where: str, old: object, new: object) -> list[str]:
    """Return in words in what JSON-like `new` differs from `old`, each found at `where`."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        before, after = cast("Mapping[str, object]", old), cast("Mapping[str, object]", new)
        names = dict.fromkeys([*before, *after])
        prefix = f"{where}." if where else ""
        return [
            line
            for name in names
            for line in changes(f"{prefix}{name}", before.get(name, "absent"), after.get(name, "absent"))
        ]
    if json.dumps(old) == json.dumps(new):
        return []
    hashes = all(isinstance(value, str) and _HASH.fullmatch(value) for value in (old, new))
    return [f"{where} has changed" if hashes else f"{where} was {old} and is {new}"]


_HASH = re.compile("[0-9a-f]{16,64}|absent")


def stack_facts(stack: Stack) -> dict[str, Any]:
    """Return what a stack contributes to a trial's configuration: itself, its profile's numbers, its files' content.

    Raises ConfigError, ModuleFault: see `Stack.check`.
    """
    from golem.robots.sensors.profiles import load_profile

    stack.check()
    return {"stack": asdict(stack), "profile": asdict(load_profile(stack.profile)), "user_files": user_files(stack)}


def user_files(stack: Stack) -> dict[str, str]:
    """Return, for what a stack names that is a file, `slot/name` -> hash of its content."""
    found: dict[str, str] = {}
    chosen = {key: stack.choice(key) for key in KEYS}
    chosen |= {f"skills/{name}": choice for name, choice in stack.skills.items()}
    for key, choice in chosen.items():
        for name, path in _named({"use": choice.use, **choice.options}).items():
            found[f"{key}/{name}"] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


def _source(module: str) -> str:
    """Return the file of a user's `package.module`; what is a path already, or nothing that can be found, as it is."""
    if not module or "/" in module or module.endswith(".py"):
        return module
    try:
        spec = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        return module
    return module if spec is None or spec.origin is None else spec.origin


def _named(options: Mapping[str, Any]) -> dict[str, Path]:
    """Return the files that options name, whatever their depth: also those of classes, and a policy's network."""
    found: dict[str, Path] = {}
    for name, value in options.items():
        if isinstance(value, Mapping):
            within = _named(cast(Mapping[str, Any], value))
            found |= {f"{name}/{inner}": path for inner, path in within.items()}
        elif isinstance(value, str):
            file = _source(value.rpartition(":")[0]) if name == "use" else value
            found[name] = Path(file).expanduser()
            if found[name].suffix == ".py":
                path = found[name].resolve()
                found |= {f"{name}/{p.relative_to(path.parent)}": p for p in neighbours(path)}
            if found[name].suffix in (".yaml", ".yml"):
                with suppress(ConfigError):  # another kind of file, or absent: said elsewhere
                    found.setdefault("network", read_passport(value).network)
    return {name: path for name, path in found.items() if path.is_file()}


@functools.cache
def versions() -> dict[str, str]:
    """Return the versions of Python and of the installed packages of `PACKAGES`."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


@functools.cache
def code_files() -> dict[str, str]:
    """Return, for every file of the package `golem`, committed or not, 16 hex digits that identify its content."""
    root = _package()
    return {
        path.relative_to(root).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()[:16]
        for path in sorted(Path(entry.path) for entry in _package_files())
    }


class Unchanged:
    """Sees whether the package's code changes under what runs it: workers import, and load networks, late."""

    def __init__(self) -> None:
        self._stamp = self._now()

    def check(self, out: Path) -> None:
        """Refuse to add another result to `out` once the code has changed. Raises OutputError: it has."""
        if self._now() != self._stamp:
            raise OutputError(
                f"The code of golem changed while this ran; {out} holds results of the old one, choose another --out."
            )

    @staticmethod
    def _now() -> tuple[int, int]:
        times = [entry.stat().st_mtime_ns for entry in _package_files()]
        return len(times), max(times)


@functools.cache
def commit() -> str:
    """Return the git commit of the package, with `-dirty` where its files differ; outside git, its version."""
    if _git("ls-files", "--error-unmatch", "__init__.py") is None:
        return versions().get("golem-humanoid", "unknown")
    head = _git("rev-parse", "--short=12", "HEAD")
    return f"{head}-dirty" if _git("status", "--porcelain", "--", ".") else f"{head}"


def _package() -> Path:
    return Path(golem.__path__[0])


def _package_files(folder: Path | str | None = None) -> Iterator[os.DirEntry[str]]:
    with os.scandir(folder or _package()) as entries:
        for entry in entries:
            if not entry.is_dir():
                yield entry
            elif entry.name != "__pycache__":
                yield from _package_files(entry.path)


def _git(*arguments: str) -> str | None:
    command = ["git", "-C", str(_package()), *arguments]
    try:
        result = subprocess.run(command, capture_output=True, text=True, check=True, timeout=30)
    except (OSError, subprocess.SubprocessError):
        return None
    return result.stdout.strip()
