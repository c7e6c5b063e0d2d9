"""Commands, options, files, modules, make targets and extras that the pages name are there."""

from __future__ import annotations

import ast
import re
import shlex
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from tests.cli_options import SECOND, module, options

from golem import cli
from golem.evaluation.rung_table import RUNGS

ROOT = Path(__file__).resolve().parent.parent
PAGES = [
    page
    for page in sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
    if not page.relative_to(ROOT).as_posix().startswith(("CHANGELOG.md", "docs/history"))
]
"""The pages of what is there; the list of changes also names what is gone."""
FOLDERS = "artefacts docker docs examples findings firmware requirements ros scripts src tests typings".split()
SHELL = re.compile(r"^ *```(?:sh|bash|console)\n(.*?)^ *```", re.S | re.M)
EXTRAS = re.compile(r"extras? `(\w+)`|golem-humanoid\[([\w,]+)\]")
PATH = re.compile(rf"(?:{'|'.join(FOLDERS)})/[\w./*-]*")
MODULE = re.compile(r"golem(?:\.\w+)+")
OF_OTHERS = {"enable_gpl"}
"""Options of programs that are not ours."""


@cache
def project() -> dict[str, dict[str, object]]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


@cache
def targets() -> set[str]:
    """Return what `make` makes; `venv-%` stands for one target per lock."""
    named = set(re.findall(r"^([a-z][a-z-]*):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    return named | {f"venv-{lock.stem}" for lock in (ROOT / "requirements").glob("*.txt")}


def lines(text: str) -> Iterator[str]:
    """Yield the commands of a page: the lines of its shell blocks, and what is in back-ticks, each on one line."""
    for block in SHELL.findall(text):
        yield from block.replace("\\\n", " ").splitlines()
    prose = re.sub(r"^( *)```.*?^\1```$", "", text, flags=re.S | re.M)
    for words in re.findall(r"(?<!`)`([^`]+)`(?!`)", prose):
        yield " ".join(words.split())


def commands(line: str) -> Iterator[list[str]]:
    """Yield the commands of a line as their words, without comments, variables of the environment and redirections."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars="();<>|&")
    lexer.whitespace_split = True
    try:
        words = list(lexer)
    except ValueError:  # half a quotation: no command
        return
    command: list[str] = []
    for word in [*words, ";"]:
        if set(word) <= set("();<>|&"):
            if command:
                yield command
            command = []
        elif command or not re.fullmatch(r"\w+=.*", word):
            command.append(word)


@cache
def everything() -> frozenset[str]:
    """Return the options of all commands, and what the programs beside the package call anything of theirs."""
    found = set(OF_OTHERS)
    for name in cli.COMMANDS:
        found.update(options(name), *(options(name, second) for second in SECOND.get(name, ())))
    found.update(*(options("ladder", rung=rung) for rung in RUNGS))
    for file in [*(ROOT / "scripts").rglob("*.py"), ROOT / "tests" / "runtime" / "live" / "two_networks.py"]:
        found.update(re.findall(r"^    (\w+): ", file.read_text(encoding="utf-8"), re.M))
    return frozenset(found)


def unknown(words: list[str], valid: frozenset[str]) -> Iterator[str]:
    """Yield the options among `words` that are not among `valid` ones."""
    for word in words:
        option = word.partition("=")[0].removeprefix("--").replace("-", "_")
        if re.match(r"--[a-z]", word) and option not in valid and option.removeprefix("no_") not in valid:
            yield word


def wrong_command(words: list[str], own: frozenset[str]) -> str | None:
    """Return what is wrong with the words after `golem`; `own` are fields of goals that the pages define."""
    name, *rest = words
    if name.startswith("-") or not re.fullmatch(r"[a-z-]+", name):
        return None
    if name not in cli.COMMANDS:
        return f"no command '{name}'"
    second = rest[0] if rest else ""
    if name in ("drivers", "model", "train") and re.fullmatch(r"[a-z]+", second) and second not in SECOND[name]:
        return f"no '{second}' of golem {name}"
    rung = next((b for a, b in zip(rest, rest[1:], strict=False) if a == "--rung"), "")
    if rung and re.fullmatch(r"[a-z-]+", rung) and name == "ladder" and rung not in RUNGS:
        return f"no rung '{rung}'"
    valid = options(name, second, rung) | (own if name in ("run", "skill") else frozenset())
    return next((f"no option {word} of golem {name}" for word in unknown(rest, valid)), None)


@cache
def members(name: str) -> frozenset[str]:
    """Return what a module of the package defines or imports."""
    found: set[str] = set()
    for node in ast.walk(module(name) or ast.Module([], [])):
        match node:
            case ast.ClassDef(name=own) | ast.FunctionDef(name=own):
                found.add(own)
            case ast.Name(id=own, ctx=ast.Store()):
                found.add(own)
            case ast.alias(name=own, asname=other):
                found.add(other or own)
            case _:
                pass
    return frozenset(found)


def is_module(name: str) -> bool:
    return module(name) is not None or (ROOT / "src" / name.replace(".", "/")).is_dir()


def wrong_module(name: str) -> bool:
    """Return whether no module is called `golem.x.y`, and none has such a member; members of members are not asked."""
    parts = name.split(".")
    known = next(n for n in range(len(parts), 0, -1) if is_module(".".join(parts[:n])))
    return known < len(parts) and parts[known] not in members(".".join(parts[:known]))


def wrong_words(words: list[str], own: frozenset[str]) -> Iterator[str]:
    """Yield what is wrong with a command, or with words in back-ticks."""
    program = Path(words[0]).name
    if program == "golem" and words[1:]:
        reason = wrong_command(words[1:], own)
        if reason:
            yield reason
    elif words[0].startswith("--"):
        yield from (f"no option {word}" for word in unknown(words, everything()))
    elif program == "make":
        named = [word for word in words[1:] if re.fullmatch(r"[a-z-]+", word) and word[0] != "-"]
        yield from (f"no target '{word}'" for word in named if word not in targets())
    elif program.startswith("python") and words[1:2] == ["-m"] and words[2:]:
        place = words[2].replace(".", "/")
        if place.startswith("tests/") and not (ROOT / f"{place}.py").exists() and not (ROOT / place).is_dir():
            yield f"no module {words[2]}"
    for word in words:
        if PATH.fullmatch(word) and not any(ROOT.glob(word.rstrip("/"))):
            yield f"no file {word}"
        if MODULE.fullmatch(word.removesuffix("()")) and wrong_module(word.removesuffix("()")):
            yield f"no module {word}"


def wrong(text: str) -> Iterator[str]:
    """Yield what a page names and what is not there."""
    own = frozenset(re.findall(r"^    (\w+): ", text, re.M))
    for line in lines(text):
        for words in commands(line):
            yield from (f"{reason}: {' '.join(words)}" for reason in wrong_words(words, own))
    for one, several in EXTRAS.findall(text):
        yield from (
            f"no extra '{extra}'"
            for extra in (one or several).split(",")
            if extra not in project()["optional-dependencies"]
        )


def test_what_pages_name_is_there() -> None:
    assert len(PAGES) > 40
    found = {str(page.relative_to(ROOT)): [*wrong(page.read_text(encoding="utf-8"))] for page in PAGES}
    assert {page: reasons for page, reasons in found.items() if reasons} == {}


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("`golem ladr`", "no command 'ladr'"),
        ("```sh\nX=1 golem run stand --wrold open   # why\n```\n", "no option --wrold of golem run"),
        ("`golem ladder --rung push --impulse 3`", "no option --impulse of golem ladder"),
        ("`golem ladder --rung shove`", "no rung 'shove'"),
        ("`golem train hands`", "no 'hands' of golem train"),
        ("`golem safety --estop.prt /dev/x && make nothing`", "no option --estop.prt of golem safety"),
        ("`make nothing`", "no target 'nothing'"),
        ("`--unheard-of 3`", "no option --unheard-of"),
        ("`docs/none.md`", "no file docs/none.md"),
        ("`python -m tests.nothing`", "no module tests.nothing"),
        ("`golem.types.Nothing`", "no module golem.types.Nothing"),
        ("`golem.nothing.at_all`", "no module golem.nothing.at_all"),
        ("the extra `nothing`", "no extra 'nothing'"),
        ("`golem-humanoid[dds,nothing]`", "no extra 'nothing'"),
    ],
)
def test_what_is_not_there_is_found(text: str, reason: str) -> None:
    assert next(wrong(text)).startswith(reason)


@pytest.mark.parametrize(
    "text",
    [
        "`golem drivers hands --left.port /dev/x --domain 0`",
        "`golem ladder --rung push-limit --terms own -n 3`",
        "`golem train legs run --task walk`",
        "`golem run hall --skill walk --x 1`",
        "`make PYTHON=/path/to/python3.12 venv-dds`",
        "`golem.types.Array` and `golem.hardware.safety`, `scripts/test_*.sh`, the extra `dds`",
        "```sh\ngolem bringup $R --rehearse \\\n    --fault tilted_imu\n```\n",
    ],
)
def test_what_is_there_is_not(text: str) -> None:
    assert list(wrong(text)) == []
