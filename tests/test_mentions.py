"""Files, modules and names that docstrings and pages mention in back-ticks are there."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from tests.sources import parsed

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "src" / "golem"
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
HISTORY = ("CHANGELOG.md", "docs/decisions", "docs/history", "docs/results")
"""Pages of what once was: their names may be gone."""
FILE = re.compile(r"[\w./-]+\.(?:py|sh)")
NAME = re.compile(r"(?:golem\.)?((?:[a-z_][a-z0-9_]*\.)+)([A-Za-z_]\w*)")
FOREIGN = {"mujoco", "model", "estop"}
"""Names that MuJoCo, its objects and options share with folders of ours."""
SUFFIXES = {"html", "json", "jsonl", "npz", "onnx", "txt", "webp", "yaml"}
OF_OTHERS = {"grasp_gen/serving/zmq_server.py", "isaaclab_ov/assets/articulation/articulation.py"}
"""Files of other repositories, in the words of those who cite them."""


def members(path: Path) -> set[str]:
    """Return the names that a module defines or imports, and those of the classes and functions in it."""
    found: set[str] = set()
    for node in ast.walk(parsed(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            found.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.add(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            found.add(node.attr)
        elif isinstance(node, ast.alias):
            found.add(node.asname or node.name)
    return found


PLACES: dict[str, set[str]] = {}
"""What there is in modules and folders of each name: members, and modules below."""
for _path in SOURCE.rglob("*.py"):
    _name = _path.parent.name if _path.stem == "__init__" else _path.stem
    PLACES.setdefault(_name, set()).update(members(_path))
    PLACES.setdefault(_path.parent.name, set()).add(_path.stem)
    PLACES.setdefault(_path.parent.parent.name, set()).add(_path.parent.name)
PACKAGES = {path.parent.name for path in SOURCE.rglob("__init__.py")}
FOLDERS = (
    "artefacts",
    "docker",
    "docs",
    "examples",
    "findings",
    "firmware",
    "requirements",
    "ros",
    "scripts",
    "src",
    "tests",
    "typings",
)
FILES = {str(path.relative_to(ROOT)) for name in FOLDERS for path in (ROOT / name).rglob("*")}


def wrong(text: str) -> Iterator[str]:
    """Yield what stands in back-ticks, looks like a file or a name of ours, and is none."""
    for words in re.findall(r"(?<!`)`([^`\n]+)`(?!`)", text):
        named = NAME.fullmatch(words.removesuffix("()"))
        if FILE.fullmatch(words):
            if words not in OF_OTHERS and not any(path == words or path.endswith(f"/{words}") for path in FILES):
                yield words
        elif named:
            place, name = named[1].rstrip(".").split(".")[-1], named[2]
            ours = place in PLACES and (place in PACKAGES or name[0].isupper()) and name not in SUFFIXES
            if ours and place not in FOREIGN and name not in PLACES[place]:
                yield words


def docstrings(path: Path) -> Iterator[str]:
    """Yield every text in a module that stands by itself."""
    for node in ast.walk(parsed(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.value.value


def test_what_docstrings_mention_is_there() -> None:
    found = [
        f"{path.relative_to(ROOT)}: {words}"
        for path in sorted(SOURCE.rglob("*.py"))
        for text in docstrings(path)
        for words in wrong(text)
    ]
    assert found == []


def test_what_pages_mention_is_there() -> None:
    found = [
        f"{path.relative_to(ROOT)}: {words}"
        for path in sorted(PAGES)
        if not str(path.relative_to(ROOT)).startswith(HISTORY)
        for words in wrong(path.read_text(encoding="utf-8"))
    ]
    assert found == []


def test_what_is_gone_is_noticed() -> None:
    text = "see `base.Nothing`, `ros.node.RosNode`, `tests/test_nothing.py`, `tests/test_mentions.py` and `np.array`"
    assert [*wrong(text)] == ["base.Nothing", "tests/test_nothing.py"]
