from __future__ import annotations

import ast
import importlib
import pickle
import re
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ElementTree
from dataclasses import fields
from enum import StrEnum
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")

from scripts import generate_messages as generate

from golem.interfaces.payloads import GateState, GripState
from golem.middleware.ros import definitions, msgs

ROOT = Path(__file__).resolve().parents[3]
PACKAGE = definitions.SHARE / "golem_interfaces"
SECTIONS = definitions.sections()
TYPES: dict[str, definitions.Definition] = definitions.load("jazzy").fielddefs  # type: ignore[assignment]
OF_GOLEM = [name for name in SECTIONS if name.startswith("golem_interfaces/")]


def test_the_folder_for_colcon_is_the_one_in_the_package() -> None:
    assert (ROOT / "ros").resolve() == definitions.SHARE


def test_a_file_is_split_at_its_separators() -> None:
    assert definitions.split("int32 a\n---\nint32 b\n --- \n") == ["int32 a\n", "int32 b\n", ""]


def test_cmake_builds_every_file_and_no_other() -> None:
    listed = set(re.findall(r'"((?:msg|srv|action)/\w+\.\w+)"', (PACKAGE / "CMakeLists.txt").read_text()))
    there = {str(path.relative_to(PACKAGE)) for path in PACKAGE.glob("*/*")}
    assert listed == there


def test_the_package_depends_on_what_its_types_are_made_of() -> None:
    package = ElementTree.parse(PACKAGE / "package.xml").getroot()
    declared = {element.text for element in package.findall("depend")}
    used = {other.split("/")[0] for name in OF_GOLEM for other in definitions.nested(TYPES[name][1])}
    assert used - {"golem_interfaces"} <= declared
    cmake = (PACKAGE / "CMakeLists.txt").read_text()
    assert all(f"find_package({name} REQUIRED)" in cmake for name in declared)
    assert set(re.findall(r"DEPENDENCIES (.*)\n", cmake)[0].split()) == declared


def test_the_package_has_the_version_of_the_software() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    version = ElementTree.parse(PACKAGE / "package.xml").getroot().findtext("version")
    assert version == project["version"]


@pytest.mark.parametrize("name", OF_GOLEM)
def test_every_field_of_ours_says_what_it_is(name: str) -> None:
    for line in SECTIONS[name].splitlines():
        if line.strip() and not line.startswith("#") and not name.endswith(("_Result", "_Feedback")):
            assert "#" in line or "LocalizedObject[]" in line, line
        assert len(line) <= 120


@pytest.mark.parametrize("name", OF_GOLEM)
def test_names_are_those_that_rosidl_allows(name: str) -> None:
    # rosidl_adapter, parser.py: VALID_MESSAGE_NAME_PATTERN, VALID_FIELD_NAME_PATTERN, VALID_CONSTANT_NAME_PATTERN
    constants, fields = TYPES[name]
    stem = name.rsplit("/", 1)[1].split("_")[0]
    assert re.fullmatch("[A-Z][A-Za-z0-9]*", stem)
    for field, _ in fields:
        assert re.fullmatch("(?!.*__)(?!.*_$)[a-z][a-z0-9_]*", field)
    for constant, *_ in constants:
        assert re.fullmatch("(?!.*__)(?!.*_$)[A-Z]([A-Z0-9_]?[A-Z0-9]+)*", constant)


@pytest.mark.parametrize(
    ("name", "states"),
    [("golem_interfaces/msg/SafetyStatus", GateState), ("golem_interfaces/msg/HandStatus", GripState)],
)
def test_states_are_those_of_the_software(name: str, states: type[StrEnum]) -> None:
    constants, _ = TYPES[name]
    assert {constant: value for constant, _, value in constants} == {s.name: s.value for s in states}


def test_the_generated_files_are_current() -> None:
    # If this fails: python scripts/generate_messages.py
    kept = {path.name: path.read_text() for path in generate.MSGS.glob("*.*") if path.suffix != ".py"}
    assert kept == generate.files()


@pytest.mark.parametrize("name", msgs.DEFINITIONS)
def test_a_stub_says_what_its_class_is(name: str) -> None:
    package, _, short = name.split("/")
    tree = ast.parse((generate.MSGS / f"{package}.pyi").read_text())
    (stub,) = (node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == short)
    said = {ast.unparse(each.target): each for each in stub.body if isinstance(each, ast.AnnAssign)}
    made = getattr(importlib.import_module(f"golem.middleware.ros.msgs.{package}"), short)
    assert made.__msgtype__ == name and made.__module__ == f"golem.middleware.ros.msgs.{package}"
    assert [field for field, each in said.items() if each.value] == [field.name for field in fields(made)]
    message = made()
    for field, each in said.items():
        value, hint = getattr(message, field), ast.unparse(each.annotation).removeprefix("ClassVar[")
        if isinstance(value, np.ndarray):
            assert value.dtype == getattr(np, hint.removeprefix("NDArray[np.").removesuffix("]"))
        else:
            assert hint.startswith(type(value).__name__)
    assert pickle.loads(pickle.dumps(message)) == message


def test_a_package_of_messages_lists_them_and_has_no_others() -> None:
    package = importlib.import_module("golem.middleware.ros.msgs.std_srvs")
    assert dir(package)[-2:] == ["Trigger_Request", "Trigger_Response"]
    with pytest.raises(ImportError):
        importlib.import_module("golem.middleware.ros.msgs.of_nobody")
    with pytest.raises(AttributeError, match="Shout"):
        _ = package.Shout


def without_extras(code: str) -> None:
    """Run `code` in a Python that has none of the packages that come with an extra."""
    absent = "import sys; sys.modules.update(dict.fromkeys(['rosbags', 'cyclonedds', 'mcap', 'foxglove']))\n"
    subprocess.run([sys.executable, "-c", absent + code], check=True, timeout=100)


def test_the_generated_classes_need_no_extra() -> None:
    without_extras(
        "from golem.middleware.ros.msgs.golem_interfaces import SafetyStatus\n"
        "assert SafetyStatus(state='active').state == SafetyStatus.ACTIVE"
    )


@pytest.mark.slow
def test_the_demo_needs_no_extra() -> None:
    without_extras("import golem.cli, golem.demo")


def test_a_definition_reads_back_as_the_same_type() -> None:
    from rosbags.typesys import get_types_from_msg

    for name in ("sensor_msgs/msg/CameraInfo", "golem_interfaces/msg/Sightings", "unitree_hg/msg/LowState"):
        read = get_types_from_msg(definitions.text(name, TYPES), name)
        assert all(list(fields) == TYPES[each][1] for each, (_, fields) in read.items())
        assert name in read and len(read) > 1
