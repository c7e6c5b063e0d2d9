"""numba, with compiled code that is never older than what it was made from.

numba keeps compiled code on disk for as long as the kernel's own file is the same, though constants and kernels of
other files are compiled into it. Here it is kept for as long as the file, all that it imports of this package or from
beside it, and the package's data are the same. Kernels take `njit` and `cfunc` from here.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import re
import signal
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numba import cfunc, config, njit
from numba.core import event
from numba.core.caching import InTreeCacheLocator, UserProvidedCacheLocator, UserWideCacheLocator

__all__ = ["cfunc", "njit", "sources", "stamp", "stamp_of_all"]

PACKAGE = Path(__file__).resolve().parent
_IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)|import[ \t]+([^\n]*))", re.M)


def sources(path: Path) -> frozenset[Path]:
    """Return the file and all files that it imports, of this package or from beside it, and those import."""
    found, new = {path}, [path]
    while new:
        others = _imports(new.pop()) - found
        found |= others
        new.extend(others)
    return frozenset(found)


def stamp(path: Path) -> str:
    """Return hex digits that change with the file, what it imports, the package's data, and the compiler."""
    return _sum(" ".join([*sorted(_content(file)[0] for file in sources(path)), _surroundings()]).encode())


def stamp_of_all() -> str:
    """Return hex digits that change with any kernel of the package, as those of `stamp` do with its own."""
    kernels = (file for file in sorted(PACKAGE.rglob("*.py")) if f"from {__name__} import" in _content(file)[1])
    return _sum(" ".join(map(stamp, kernels)).encode())


def _sum(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


@functools.cache
def _content(path: Path) -> tuple[str, str]:
    text = path.read_text(encoding="utf-8")
    return _sum(text.encode()), text


@functools.cache
def _imports(path: Path) -> frozenset[Path]:
    """Return the files of the package, and beside it, that a file imports itself."""
    names: set[str] = set()
    for module, taken, plain in _IMPORT.findall(_content(path)[1]):
        words = re.findall(r"[\w.]+", re.sub(r"#[^\n]*|\bas\s+\w+", "", taken or plain))
        names.update([module, *(f"{module}.{word}" for word in words)] if module else words)
    files = (_file(name.lstrip("."), path.parent) for name in names)
    return frozenset(file for file in files if file is not None)


@functools.cache
def _file(name: str, folder: Path) -> Path | None:
    first, *rest = name.split(".")
    base = PACKAGE.joinpath(*rest) if first == PACKAGE.name else folder.joinpath(first, *rest)
    return next((file for file in (base.with_suffix(".py"), base / "__init__.py") if file.is_file()), None)


@functools.cache
def _surroundings() -> str:
    """Return what identifies the package's data and the compiler."""
    data = (file for file in sorted(PACKAGE.rglob("*.*")) if file.suffix in (".json", ".xml", ".npz", ".yaml", ".csv"))
    sums = [_sum(file.read_bytes()) for file in data]
    return " ".join([*sums, *(importlib.metadata.version(name) for name in ("numba", "llvmlite", "numpy"))])


class _Stamped:
    if TYPE_CHECKING:
        _py_file: str

    def get_source_stamp(self) -> str:
        return stamp(Path(self._py_file).resolve())


class Provided(_Stamped, UserProvidedCacheLocator):
    """Compiled code in the folder that `NUMBA_CACHE_DIR` names."""


class InTree(_Stamped, InTreeCacheLocator):
    """Compiled code beside its source."""


class UserWide(_Stamped, UserWideCacheLocator):
    """Compiled code in the user's cache, where the folder of the source cannot be written."""


class _Held(event.Listener):
    """Holds Ctrl-C back while the main thread compiles: what is raised in a callback of LLVM's is lost."""

    depth = 0

    def on_start(self, event: event.Event) -> None:
        if threading.current_thread() is threading.main_thread():
            self.depth += 1
            if self.depth == 1:
                self.heard = list[int]()
                self.before = signal.signal(signal.SIGINT, lambda number, _: self.heard.append(number))

    def on_end(self, event: event.Event) -> None:
        if threading.current_thread() is threading.main_thread() and self.depth:
            self.depth -= 1
            if not self.depth:
                signal.signal(signal.SIGINT, self.before)
                for number in self.heard[:1]:
                    signal.raise_signal(number)


event.register("numba:compiler_lock", _Held())
_LOCATORS = [*(f"{__name__}.{kind.__name__}" for kind in (Provided, InTree, UserWide)), "IPythonCacheLocator"]
_config: Any = config  # numba makes its options at run time
_config.CACHE_LOCATOR_CLASSES = _config.CACHE_LOCATOR_CLASSES or ",".join(_LOCATORS)
