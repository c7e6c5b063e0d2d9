import subprocess
import sys

import pytest

PROBE = """
import os, sys, ctypes
os.environ.pop("MUJOCO_GL", None)
{setup}
from golem.errors import GolemError
from golem.robots.mujoco import gl
try:
    {call}
except GolemError as error:
    print(type(error).__name__, error)
    sys.exit(2)
"""

HIDE_EGL = """
load = ctypes.CDLL
class Hidden(load):
    def __init__(self, name, *args, **kwargs):
        if name and ("EGL" in str(name) or "OSMesa" in str(name)):
            raise OSError(f"{name}: cannot open shared object file")
        super().__init__(name, *args, **kwargs)
ctypes.CDLL = Hidden
"""

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux chooses among OpenGL libraries")


def probe(setup: str, call: str = "gl.shared_context()") -> subprocess.CompletedProcess[str]:
    code = PROBE.format(setup=setup, call=call)
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)


@pytest.mark.parametrize("call", ["gl.choose_backend()", "gl.shared_context()"])
def test_missing_egl_names_the_line_that_installs_it(call: str) -> None:
    result = probe(HIDE_EGL, call)
    assert result.returncode == 2, result.stderr
    assert result.stdout.startswith("MissingSystemLibrary ")
    assert "libEGL.so.1 is not installed" in result.stdout
    assert "sudo apt-get install -y libegl1 libegl-mesa0 libgl1 libgl1-mesa-dri" in result.stdout
    assert result.stdout.count("\n") == 1


def test_missing_osmesa_names_its_own_package() -> None:
    result = probe(HIDE_EGL + "os.environ['MUJOCO_GL'] = 'osmesa'", "gl.choose_backend()")
    assert result.returncode == 2, result.stderr
    assert "sudo apt-get install -y libosmesa6" in result.stdout


def test_missing_driver_is_told_like_a_missing_library() -> None:
    # The loader finds no vendor behind libEGL: what an image without a Mesa driver looks like.
    result = probe("os.environ['__EGL_VENDOR_LIBRARY_FILENAMES'] = '/nonexistent.json'")
    assert result.returncode == 2, result.stderr
    assert "libegl-mesa0" in result.stdout


def test_a_backend_that_needs_a_display_is_refused_by_name() -> None:
    result = probe("os.environ['MUJOCO_GL'] = 'glfw'", "gl.choose_backend()")
    assert result.returncode == 2, result.stderr
    assert "'glfw'; valid: egl, osmesa" in result.stdout


def test_rendering_works_where_nothing_chose_a_backend_before_mujoco_was_imported() -> None:
    assert probe("import mujoco").returncode == 0


def test_choosing_a_backend_imports_neither_mujoco_nor_opengl() -> None:
    result = probe("", "gl.choose_backend(); sys.exit('mujoco' in sys.modules or 'OpenGL' in sys.modules)")
    assert result.returncode == 0, result.stderr
