"""The options of `golem` commands, read from the sources: importing what they configure takes seconds."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

from golem import cli
from golem.evaluation.rung_table import RUNGS

SOURCE = Path(cli.__file__).resolve().parents[1]
Names = frozenset[str]
READERS: dict[str, tuple[tuple[str, str], ...]] = {
    "run": (("golem.run", "RunConfig"),),
    "ladder": (("golem.evaluation.harness.ladder", "LadderConfig"),),
    "faults": (("golem.evaluation.harness.ladder", "LadderConfig"), ("golem.evaluation.rungs.faults", "FaultOptions")),
    "skill": (("golem.runtime.live.skill_client", "SkillClientConfig"),),
    "blame": (
        ("golem.evaluation.harness.ladder", "LadderConfig"),
        ("golem.evaluation.blame.blame_command", "BlameConfig"),
    ),
}
"""What the commands read that leave parsing to a function of their own: module and dataclass."""
SECOND: dict[str, Names] = {
    "bench": frozenset(cli.BENCHES),
    "drivers": frozenset(cli.DEVICES),
    "model": frozenset(cli.MODEL_COMMANDS),
    "train": frozenset(cli.TRAINERS),
}
"""Commands of two words, and their second words."""


@cache
def module(name: str) -> ast.Module | None:
    """Return the code of a module of the package; None where there is none."""
    path = SOURCE.joinpath(*name.split("."))
    for file in (path.with_suffix(".py"), path / "__init__.py"):
        if file.is_file():
            return ast.parse(file.read_text(encoding="utf-8"))
    return None


@cache
def imports(owner: str) -> dict[str, tuple[str, str]]:
    """Return what a module takes from others of the package, anywhere in its text: name -> module and name there."""
    found: dict[str, tuple[str, str]] = {}
    for node in ast.walk(module(owner) or ast.Module([], [])):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("golem"):
            found |= {alias.asname or alias.name: (node.module or "", alias.name) for alias in node.names}
    return found


@cache
def definition(owner: str, name: str) -> tuple[str, ast.ClassDef] | None:
    """Return the class that `name` means in the module `owner`, with the module that defines it."""
    for node in (module(owner) or ast.Module([], [])).body:
        if isinstance(node, ast.ClassDef) and node.name == name:
            return owner, node
    there = imports(owner).get(name)
    return definition(*there) if there else None


def mentioned(owner: str, node: ast.AST) -> Iterator[tuple[str, str]]:
    """Yield the classes of the package that an annotation names."""
    for part in ast.walk(node):
        if isinstance(part, ast.Name) and definition(owner, part.id):
            yield owner, part.id


@cache
def fields(owner: str, name: str) -> Names:
    """Return the options that a dataclass adds to a command line, as they are written without the dashes."""
    found = definition(owner, name)
    if found is None:
        return frozenset()
    owner, kind = found
    names = {field for base in kind.bases for each in mentioned(owner, base) for field in fields(*each)}
    for node in kind.body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            hint = ast.unparse(node.annotation)
            own = node.target.id
            inner = {field for each in mentioned(owner, node.annotation) for field in fields(*each)}
            plain = "OmitArgPrefixes" in hint or "name=''" in hint
            names |= {own} | (inner if plain else {f"{own}.{field}" for field in inner})
    return frozenset(names)


def parsed(command: Callable[[list[str]], int]) -> Iterator[tuple[str, str]]:
    """Yield module and name of every dataclass that the code of a command gives to `_parse`."""
    code = ast.parse(inspect.getsource(command))
    taken = {
        alias.asname or alias.name: (node.module or "", alias.name)
        for node in ast.walk(code)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    for node in ast.walk(code):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "_parse":
            match node.args[0]:
                case ast.Name(id=name):
                    yield taken.get(name, ("golem.cli", name))
                case ast.Attribute(value=ast.Name(id=place), attr=name):
                    yield ".".join(taken[place]), name
                case _:
                    pass


@cache
def rung_options(rung: str) -> Names:
    """Return the options of a rung's own."""
    owner, _, name = RUNGS[rung].partition(":")
    found = definition(owner, name)
    while found:
        owner, kind = found
        for node in kind.body:
            if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "Options":
                return fields(owner, ast.unparse(node.value))
        found = next((definition(*each) for base in kind.bases for each in mentioned(owner, base)), None)
    return frozenset()


@cache
def trained(what: str) -> Names:
    """Return the parameters of every function of a trainer, and the fields of the dataclasses that these take."""
    owner = cli.TRAINERS[what]
    return parameters(owner, *{place for place, _ in imports(owner).values() if place.startswith("golem.training")})


def parameters(*places: str) -> Names:
    """Return the parameters of the functions of modules, and the fields of the dataclasses that these take."""
    names: set[str] = set()
    for place in places:
        for node in (module(place) or ast.Module([], [])).body:
            if isinstance(node, ast.ClassDef):
                names |= fields(place, node.name)
            elif isinstance(node, ast.FunctionDef):
                for argument in [*node.args.args, *node.args.kwonlyargs]:
                    names.add(argument.arg)
                    for each in mentioned(place, argument.annotation or node):
                        names |= fields(*each)
    return frozenset(names)


@cache
def goals() -> Names:
    """Return the fields of every shipped skill's goal."""
    found: set[str] = set()
    for file in (SOURCE / "golem" / "skills").glob("*.py"):
        owner = f"golem.skills.{file.stem}"
        for node in (module(owner) or ast.Module([], [])).body:
            if isinstance(node, ast.ClassDef) and node.name.endswith("Goal"):
                found |= fields(owner, node.name)
    return frozenset(found)


@cache
def options(command: str, second: str = "", rung: str = "") -> Names:
    """Return the options of a command, without the dashes and with underscores.

    Args:
        command: the word after `golem`.
        second: the one after that.
        rung: for `ladder`, the rung that is named.
    """
    function = cli.COMMANDS[command]
    names: set[str] = {"help"}
    if command == "dataset" or second == "--lerobot":
        return parameters("golem.datasets.commands") | names | {"lerobot"}
    if second in SECOND.get(command, ()):
        if command == "train":
            return trained(second) | names
        table = {"bench": cli.BENCHES, "drivers": cli.DEVICES, "model": cli.MODEL_COMMANDS}[command]
        owner, config, _ = table[second]
        return fields(owner, config) | names
    inner = inspect.getclosurevars(function).nonlocals
    kinds = [*READERS.get(command, ())]
    kinds += [(inner["module"], inner["names"].partition(":")[0])] if "names" in inner else parsed(function)
    for owner, name in kinds:
        names |= fields(owner, name)
    if command in ("ladder", "blame"):
        names |= rung_options(rung or "tether")
    return frozenset(names | (goals() if command in ("run", "skill") else frozenset()))
