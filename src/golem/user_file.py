"""A user's file as a module, with the files beside it that it imports."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from golem.errors import ConfigError

_folders: set[str] = set()
"""Folders of users' files, which are on the import path, behind what is installed."""


def import_file(path: Path) -> ModuleType:
    """Return the Python file at the absolute `path` as a module, imported once; it may import what lies beside it.

    Raises:
        ConfigError: a file beside it has the name of one that was imported from another user's folder.
        Exception: whatever the file raises.
    """
    name = f"golem_user_{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"
    if name in sys.modules:
        return sys.modules[name]
    for file in neighbours(path):
        own = ".".join(file.relative_to(path.parent).with_suffix("").parts).removesuffix(".__init__")
        loaded = Path(getattr(sys.modules.get(own), "__file__", None) or file)
        if loaded != file and any(folder in map(str, loaded.parents) for folder in _folders):
            raise ConfigError(f"{path} imports {file}, and {loaded} of that name is in use; rename one.")
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
        _folders.add(str(path.parent))
    importlib.invalidate_caches()
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


def neighbours(path: Path) -> list[Path]:
    """Return the Python files in the folder of the one at `path` that it imports, and those that they import."""
    found, waiting = set[Path](), [path]
    while waiting:
        try:
            nodes = list(ast.walk(ast.parse(waiting.pop().read_bytes())))
        except (OSError, SyntaxError, ValueError):  # said where it is imported
            continue
        names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
        names += [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
        for name in {name.partition(".")[0] for name in names} - sys.stdlib_module_names - {""}:
            package = path.parent / name
            files = package.rglob("*.py") if (package / "__init__.py").is_file() else ()
            new = {file for file in (package.with_suffix(".py"), *files) if file.is_file()} - found - {path}
            found |= new
            waiting += new
    return sorted(found)
