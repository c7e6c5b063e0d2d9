"""What this machine lacks to run GOLEM, and the line that installs it."""

from __future__ import annotations

import ctypes
import importlib.metadata
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from golem.errors import LOCKS, GolemError, MissingSystemLibrary
from golem.package_data import load_data
from golem.robots.mujoco.gl import LIBRARIES

DEBIAN_PACKAGES = ("libgomp1", *LIBRARIES["egl"][1].split())
"""What a minimal Debian or Ubuntu lacks: OpenMP for Pinocchio, and for MuJoCo EGL with a software driver."""

DISK_NEEDED = 2e9
"""Room for the runs of an evaluation with their pictures [bytes]."""

BUFFER_NEEDED = 4 * 2**20
"""Receive buffer for the images of one moment: three cameras of 640 x 480, colour and depth [bytes]."""

PROBE_TIMEOUT = 120.0
"""How long a loaded machine may take to import everything once [s]."""

EXTRAS: dict[str, list[str]] = load_data(__package__, "extras.yaml")
"""The importable modules of each optional extra."""
_CHECKOUT = (Path(__file__).parents[2] / "scripts" / "bootstrap.sh").is_file()

_INSTALLERS = {
    "apt-get": f"apt-get install -y {' '.join(DEBIAN_PACKAGES)}",
    "dnf": "dnf install -y libgomp mesa-libEGL mesa-libGL mesa-dri-drivers",
    "pacman": "pacman -S --noconfirm gcc-libs libglvnd mesa",
    "zypper": "zypper install -y libgomp1 libEGL1 libGL1 Mesa-dri",
}

_LOAD = "import cv2, daqp, mujoco, onnxruntime, pinocchio"

_RENDER = """
import mujoco
model = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><light pos='0 0 3'/><geom type='plane' size='1 1 1'/></worldbody></mujoco>"
)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 8, 8) as renderer:
    renderer.update_scene(data)
    assert renderer.render().any(), "the picture is black"
"""


@dataclass(frozen=True)
class DoctorOptions:
    """Report what this machine lacks to run GOLEM, and the line that installs it."""

    compile: bool = False
    """Instead, compile what the first runs would have to."""


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """One row of the table.

    Attributes:
        fix: the line to type, or what to do, when it does not suffice; empty when it does.
        needed: False where GOLEM runs without it.
    """

    name: str
    found: str
    fix: str = ""
    needed: bool = True

    @property
    def failed(self) -> bool:
        """Whether GOLEM cannot run because of this."""
        return self.needed and bool(self.fix)


def check_python() -> Diagnosis:
    """Look at the version of the interpreter."""
    found = sys.version.split()[0]
    if (3, 11) <= sys.version_info < (3, 14):
        return Diagnosis("Python", found)
    return Diagnosis("Python", found, "install Python 3.11, 3.12 or 3.13, then: make PYTHON=/path/to/python3.12 venv")


def check_packages() -> Diagnosis:
    """Look whether every required package is installed in a version that is allowed."""
    from packaging.requirements import Requirement

    try:
        lines = importlib.metadata.requires("golem-humanoid") or []
    except importlib.metadata.PackageNotFoundError:
        return Diagnosis("packages", "golem-humanoid itself is not installed", "make venv")
    wanted = [Requirement(line) for line in lines if "extra ==" not in line]
    wrong: list[str] = []
    for requirement in wanted:
        try:
            version = importlib.metadata.version(requirement.name)
        except importlib.metadata.PackageNotFoundError:
            wrong.append(f"{requirement.name} is absent")
            continue
        if version not in requirement.specifier:
            wrong.append(f"{requirement.name} is {version}, not {requirement.specifier}")
    if wrong:
        return Diagnosis("packages", "; ".join(wrong), _reinstall_line())
    return Diagnosis("packages", f"{len(wanted)} of {len(wanted)}")


def check_extras() -> list[Diagnosis]:
    """Look which optional extras are there; none is needed."""
    rows: list[Diagnosis] = []
    for extra, modules in EXTRAS.items():
        absent = [module for module in modules if importlib.util.find_spec(module) is None]
        line = f"make venv-{LOCKS.get(extra, extra)}" if _CHECKOUT else f"pip install 'golem-humanoid[{extra}]'"
        found = f"without {', '.join(absent)}" if absent else "installed"
        rows.append(Diagnosis(f"extra {extra}", found, line if absent else "", needed=False))
    return rows


def check_dds() -> list[Diagnosis]:
    """Send a sample through Cyclone DDS, and look whether the system lets it receive images; nothing without it."""
    if importlib.util.find_spec("cyclonedds") is None:
        return []
    from golem.middleware.dds import connect, interfaces

    try:
        connect.self_test()
    except GolemError as error:
        return [Diagnosis("DDS", str(error), "do as that sentence says", needed=False)]
    buffer = interfaces.receive_buffer()
    if buffer is not None and buffer < BUFFER_NEEDED:
        fix = f"sudo sysctl -w net.core.rmem_max={4 * BUFFER_NEEDED}"
        return [Diagnosis("DDS", f"works, but images get lost in {buffer / 1e6:.1f} MB of buffer", fix, needed=False)]
    return [Diagnosis("DDS", "works", needed=False)]


def check_disk(folder: Path | None = None) -> Diagnosis:
    """Look at the free space of `folder` (default: the working directory) and whether it can be written."""
    folder = folder or Path.cwd()
    free = shutil.disk_usage(folder).free
    found = f"{free / 1e9:.0f} GB free in {folder}"
    if not os.access(folder, os.W_OK):
        return Diagnosis("disk", f"{folder} cannot be written", "work in a folder of yours, or pass --out FOLDER")
    if free < DISK_NEEDED:
        return Diagnosis("disk", found, f"free {DISK_NEEDED / 1e9:.0f} GB, or pass --out FOLDER on another disk")
    return Diagnosis("disk", found)


def check_libraries() -> Diagnosis:
    """Load every package with native code in a process of its own."""
    environment = {key: value for key, value in os.environ.items() if key != "MUJOCO_GL"}
    problem = _problem(_LOAD, environment)
    if problem:
        return Diagnosis("libraries", problem, install_line() if ".so" in problem else _reinstall_line())
    return Diagnosis("libraries", "native code loads")


def check_graphics() -> Diagnosis:
    """Render an 8x8 picture with MuJoCo in a process of its own, since a broken driver may abort it."""
    environment = dict(os.environ)
    if sys.platform == "linux":
        environment.setdefault("MUJOCO_GL", "egl")
    backend = environment.get("MUJOCO_GL", "the default")
    if backend == "egl" and not _loads(LIBRARIES["egl"][0]):
        return Diagnosis("graphics", f"{LIBRARIES['egl'][0]} is missing", install_line())
    problem = _problem(_RENDER, environment)
    if not problem:
        return Diagnosis("graphics", f"MuJoCo renders with MUJOCO_GL={backend}")
    if backend not in ("egl", "the default"):
        return Diagnosis("graphics", f"MuJoCo fails with MUJOCO_GL={backend}: {problem}", "export MUJOCO_GL=egl")
    return Diagnosis("graphics", f"MuJoCo fails with MUJOCO_GL={backend}: {problem}", install_line())


def require_system() -> None:
    """Check that native code loads and MuJoCo renders. Raises MissingSystemLibrary: no; says what installs it."""
    for check in (check_libraries(), check_graphics()):
        if check.failed:
            raise MissingSystemLibrary(f"{check.found}; type: {check.fix}")


def install_line() -> str:
    """Return the line that installs the missing libraries with this system's package manager."""
    if sys.platform != "linux":
        return "unset MUJOCO_GL"
    sudo = "" if os.geteuid() == 0 else "sudo "
    for command, line in _INSTALLERS.items():
        if shutil.which(command):
            return sudo + line
    return f"install what your system calls these Debian packages: {' '.join(DEBIAN_PACKAGES)}"


def diagnose() -> list[Diagnosis]:
    """Run every check."""
    checks = [check_python(), check_packages(), check_libraries(), check_graphics(), check_disk()]
    return [*checks, *check_dds(), *check_extras()]


def run(console: Console | None = None) -> int:
    """Print the table; return the exit code: 0 when GOLEM can run here, 2 when something needed is missing."""
    checks = diagnose()
    table = Table("", "what", "found", "to do")
    for check in checks:
        mark = "[red]no[/]" if check.failed else "[dim]-[/]" if check.fix else "[green]ok[/]"
        table.add_row(mark, check.name, check.found.replace("[", r"\["), check.fix.replace("[", r"\["))
    (console or Console()).print(table)
    return 2 if any(check.failed for check in checks) else 0


def _reinstall_line() -> str:
    return "make clean venv" if _CHECKOUT else "pip install --force-reinstall WHEEL"


def _problem(program: str, environment: dict[str, str]) -> str:
    """Return what goes wrong when a fresh interpreter runs `program`; empty when nothing does."""
    with tempfile.TemporaryDirectory() as scratch:
        command = [sys.executable, "-c", program]
        try:
            done = subprocess.run(
                command, env=environment, cwd=scratch, capture_output=True, text=True, timeout=PROBE_TIMEOUT
            )
        except subprocess.TimeoutExpired:
            return f"no answer within {PROBE_TIMEOUT:.0f} s"
    if done.returncode == 0:
        return ""
    said = done.stderr.strip().splitlines()
    return said[-1] if said else f"exit code {done.returncode}"


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


if __name__ == "__main__":
    try:
        require_system()
    except GolemError as error:
        sys.exit(f"golem: {error}")
