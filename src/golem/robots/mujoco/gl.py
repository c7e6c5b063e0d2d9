"""The OpenGL context that off-screen rendering needs, and what to install when there is none.

Importing this module imports neither MuJoCo nor OpenGL: MuJoCo chooses its OpenGL backend when it is first imported,
and with a backend whose library is absent that import fails. So an entry point calls `choose_backend` first.
"""

from __future__ import annotations

import ctypes
import importlib
import os
import sys
import threading
from typing import Protocol

from golem.errors import MissingSystemLibrary, unknown_name

LIBRARIES = {
    "egl": ("libEGL.so.1", "libegl1 libegl-mesa0 libgl1 libgl1-mesa-dri"),
    "osmesa": ("libOSMesa.so.8", "libosmesa6 libgl1"),
}
"""Per Linux backend the shared library it loads and the Debian packages that bring it and a software driver."""


class GlContext(Protocol):
    """What MuJoCo's context classes have in common."""

    def make_current(self) -> None:
        """Direct the OpenGL calls of this thread to this context."""

    def free(self) -> None:
        """Release it."""


class _OfThread(threading.local):
    context: GlContext | None = None


_shared = _OfThread()


def choose_backend() -> str:
    """Settle how this process renders: `MUJOCO_GL` where it is set, else EGL on Linux and CGL on macOS.

    Call it before MuJoCo is imported.

    Raises:
        ConfigError: `MUJOCO_GL` names a backend that cannot render without a display.
        MissingSystemLibrary: the backend's shared library is absent.
    """
    if sys.platform != "linux":
        return "cgl"
    backend = os.environ.get("MUJOCO_GL", "").strip().lower() or "egl"
    if backend not in LIBRARIES:
        raise unknown_name("off-screen OpenGL backend in MUJOCO_GL", backend, LIBRARIES)
    os.environ["MUJOCO_GL"] = backend
    library, _ = LIBRARIES[backend]
    try:
        ctypes.CDLL(library)
    except OSError as error:
        raise _missing(backend, f"{library} is not installed") from error
    return backend


def shared_context() -> GlContext:
    """Return the one OpenGL context of the calling thread, made current in it: a context serves one thread at a time.

    Raises:
        ConfigError: as in `choose_backend`.
        MissingSystemLibrary: the backend's library or its driver is absent.
    """
    if _shared.context is None:
        backend = choose_backend()
        try:
            _shared.context = importlib.import_module(f"mujoco.{backend}").GLContext(1, 1)
        except Exception as error:  # PyOpenGL reports absent libraries as AttributeError, ImportError or GLError
            raise _missing(backend, f"no context ({type(error).__name__})") from error
    assert _shared.context is not None
    _shared.context.make_current()
    return _shared.context


def _missing(backend: str, reason: str) -> MissingSystemLibrary:
    if backend not in LIBRARIES:
        return MissingSystemLibrary(f"Off-screen rendering is impossible on this system: {reason}.")
    return MissingSystemLibrary(
        f"Cameras need the OpenGL backend '{backend}', which does not work here ({reason}); "
        f"install it with: sudo apt-get install -y {LIBRARIES[backend][1]}"
    )
