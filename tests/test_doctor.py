"""The doctor names the line to type."""

from __future__ import annotations

import importlib.metadata
import io
import shutil
from pathlib import Path

import pytest
from rich.console import Console

from golem import doctor
from golem.errors import MissingSystemLibrary


def printed() -> tuple[int, str]:
    text = io.StringIO()
    code = doctor.run(Console(file=text, width=200))
    return code, text.getvalue()


def test_this_environment_is_healthy() -> None:
    code, text = printed()
    assert code == 0
    assert "native code loads" in text
    assert "MuJoCo renders" in text


def test_a_missing_gl_library_is_named_with_its_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setattr(doctor, "_loads", lambda library: False)
    monkeypatch.setattr(shutil, "which", lambda command: f"/usr/bin/{command}" if command == "apt-get" else None)
    with pytest.raises(MissingSystemLibrary, match=r"libEGL.so.1 is missing; type: .*apt-get install -y .*libegl1"):
        doctor.require_system()


def test_a_failing_row_makes_the_table_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "check_graphics", lambda: doctor.Diagnosis("graphics", "none", "type [this]"))
    code, text = printed()
    assert code == 2
    assert "type [this]" in text


def test_an_absent_extra_is_no_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "EXTRAS", {"pink": ["no_such_module"]})
    (row,) = doctor.check_extras()
    assert row.fix and not row.failed


def test_a_small_receive_buffer_is_named_with_its_line(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("cyclonedds")
    monkeypatch.setattr("golem.middleware.dds.interfaces.receive_buffer", lambda: 212_992)
    (row,) = doctor.check_dds()
    assert "0.2 MB" in row.found and "sysctl -w net.core.rmem_max=16777216" in row.fix and not row.failed
    monkeypatch.setattr("golem.middleware.dds.interfaces.receive_buffer", lambda: None)
    assert [row.found for row in doctor.check_dds()] == ["works"]


def test_a_package_of_the_wrong_version_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    real = importlib.metadata.version
    monkeypatch.setattr(importlib.metadata, "version", lambda name: "3.2.0" if name == "mujoco" else real(name))
    row = doctor.check_packages()
    assert row.failed and "mujoco is 3.2.0" in row.found


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.access", lambda path, mode: False)
    assert doctor.check_disk(tmp_path).failed


def test_other_systems_get_their_own_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    monkeypatch.setattr(shutil, "which", lambda command: "/usr/bin/dnf" if command == "dnf" else None)
    monkeypatch.setattr("sys.platform", "linux")
    assert doctor.install_line().startswith("sudo dnf install")
