"""A name in the stack file becomes an instance, or one sentence that says what would have worked."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from golem import registry
from golem.capabilities.grasping.centroid import Centroid
from golem.capabilities.grasping.visual_servo import VisualServo
from golem.errors import ConfigError, ModuleFault
from golem.evaluation.conformance.examine import OPTIONS
from golem.slots import KEYS, SLOTS
from golem.user_file import neighbours

USER_FILE = """
from __future__ import annotations
from dataclasses import dataclass, field

@dataclass(frozen=True)
class Loop:
    gain: float = 1.0

@dataclass(frozen=True)
class Config:
    depth: float = 0.01
    loop: Loop = field(default_factory=Loop)

class WithConfig:
    def __init__(self, config: Config | None = None, side: str = "none") -> None:
        self.config, self.side = config or Config(), side

class WithKeywords:
    def __init__(self, gain: float, side: str = "none") -> None:
        self.gain, self.side = gain, side

class Nothing:
    pass

class Raises:
    def __init__(self) -> None:
        raise OSError("no such weights")

not_a_class = 3
"""


@pytest.fixture
def user(tmp_path: Path) -> str:
    """A user's file with modules in it."""
    path = tmp_path / "mine.py"
    path.write_text(USER_FILE)
    return str(path)


def test_every_slot_has_a_contract_and_every_key_a_slot_with_its_default() -> None:
    for slot in SLOTS:
        assert registry.contract(slot).__name__ in SLOTS[slot].contract
    assert {row.slot for row in KEYS.values()} == set(SLOTS) - {registry.SKILL}
    for row in KEYS.values():
        assert {row.default, row.standing or row.default} <= set(SLOTS[row.slot].shipped)


@pytest.mark.parametrize("slot", SLOTS)
def test_every_registered_name_is_a_class_with_the_promised_name(slot: str) -> None:
    for use in registry.names(slot):
        if use == "pink_ik":
            pytest.importorskip("pink")
        assert isinstance(registry.load(slot, use), type)


def test_a_registered_name() -> None:
    assert isinstance(registry.create("grasp_method", "centroid", {}), Centroid)


def test_a_class_of_an_installed_package() -> None:
    use = "golem.capabilities.grasping.centroid:Centroid"
    assert isinstance(registry.create("grasp_method", use, {}), Centroid)


def test_a_class_of_a_file(user: str) -> None:
    assert type(registry.create("grasp_method", f"{user}:Nothing", {})).__name__ == "Nothing"


def test_a_file_is_loaded_once(user: str) -> None:
    assert registry.load("hand", f"{user}:Nothing") is registry.load("hand", f"{user}:Nothing")


def test_options_of_a_config_dataclass() -> None:
    method = registry.create("grasp_method", "centroid", {"depth": 0.02})
    assert (method.config.depth, method.config.gap) == (0.02, Centroid().config.gap)


def test_options_of_a_nested_config() -> None:
    method = registry.create("grasp_method", "visual_servo", {"servo": {"tolerance": 0.002}})
    assert isinstance(method, VisualServo)
    assert method.config.servo.tolerance == 0.002
    assert method.config.centroid == VisualServo().config.centroid


def test_a_nested_option_that_does_not_exist() -> None:
    with pytest.raises(ConfigError, match="grasp_method: visual_servo 'servo'.*Did you mean 'tolerance'"):
        registry.create("grasp_method", "visual_servo", {"servo": {"tolerence": 0.002}})


def test_options_of_a_user_class(user: str) -> None:
    made = registry.create("hand", f"{user}:WithConfig", {"loop": {"gain": 2}}, side="left")
    assert (made.config.loop.gain, made.config.depth, made.side) == (2.0, 0.01, "left")


def test_keyword_options_of_a_user_class(user: str) -> None:
    made = registry.create("hand", f"{user}:WithKeywords", {"gain": 2}, side="left", seed=1)
    assert (made.gain, made.side) == (2.0, "left")


def test_what_the_stack_supplies_is_not_an_option(user: str) -> None:
    with pytest.raises(ConfigError, match=r"'side'; valid: gain\."):
        registry.create("hand", f"{user}:WithKeywords", {"gain": 1.0, "side": "right"}, side="left")


@pytest.mark.parametrize(
    ("slot", "use", "words"),
    [
        ("upper_body", "dif_ik", ["upper_body", "'dif_ik'", "diff_ik, pink_ik", "Did you mean 'diff_ik'?"]),
        ("upper_body", "", ["upper_body", "diff_ik"]),
        ("hand", "no_such_file.py:Hand", ["hand", "no_such_file.py", "does not exist"]),
        ("hand", "no_such_package.hands:Hand", ["no_such_package.hands", "cannot be found", "magpie"]),
        ("hand", "golem.no_such_module:Hand", ["golem.no_such_module", "cannot be found"]),
        ("hand", "golem.hardware.hands.magpie:MagpieHnd", ["Did you mean 'MagpieHand'?"]),
        ("hand", "golem.hardware.hands.magpie:", ["class in golem.hardware.hands.magpie", "MagpieHand"]),
        ("hand", "golem.hardware.hands.magpie:FORCE_STEP", ["Unknown class", "MagpieHand"]),
    ],
)
def test_a_wrong_name_is_answered_with_what_would_work(slot: str, use: str, words: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        registry.create(slot, use, {})
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_a_file_without_a_class_is_answered_with_the_form() -> None:
    with pytest.raises(ConfigError, match=r"'my\.py' names a file and no class in it; write my\.py:CLASS\."):
        registry.load("hand", "my.py")


def test_a_file_without_its_ending_is_answered_with_the_form(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my.py").write_text("class Mine: ...")
    with pytest.raises(ConfigError, match=r"'my' names a file and no class in it; write my\.py:CLASS\."):
        registry.load("hand", "my")


def test_a_wrong_class_of_a_file_is_answered_with_its_classes(user: str) -> None:
    with pytest.raises(ConfigError, match=r"'WithConfg'; valid: .*WithKeywords.* Did you mean 'WithConfig'"):
        registry.create("hand", f"{user}:WithConfg", {})


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("raise RuntimeError('boom')", "importing it raised RuntimeError: boom"),
        ("def broken(:", "importing it raised SyntaxError"),
        ("import no_such_package_anywhere", "needs the package 'no_such_package_anywhere'"),
    ],
)
def test_a_file_that_cannot_be_imported_is_the_modules_fault(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "broken.py"
    path.write_text(text + "\n")
    use = f"{path}:Hand"
    with pytest.raises(ModuleFault) as caught:
        registry.create("hand", use, {})
    assert (caught.value.slot, caught.value.use) == ("hand", use)
    assert reason in caught.value.reason


def test_a_file_imports_the_files_beside_it_and_not_those_beside_another(tmp_path: Path) -> None:
    for folder, value in (("one", 1), ("two", 2)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "my_helper_of_test.py").write_text(f"VALUE = {value}\n")
        text = "from my_helper_of_test import VALUE\nclass Hand:\n    value = VALUE\n"
        (tmp_path / folder / "hand.py").write_text(text)
    assert registry.load("hand", f"{tmp_path}/one/hand.py:Hand").__dict__["value"] == 1
    with pytest.raises(ConfigError, match=r"two/my_helper_of_test\.py, and .*one/my_helper.* rename one"):
        registry.load("hand", f"{tmp_path}/two/hand.py:Hand")


def test_neighbours_are_what_a_file_imports_whatever_the_depth(tmp_path: Path) -> None:
    for name, text in {
        "a.py": "import b, numpy, random\nfrom pack.inner import x\n",
        "b.py": "import c\nimport a\n",
        "c.py": "broken(:\n",
        "unused.py": "",
        "random.py": "",
        "pack/__init__.py": "",
        "pack/inner.py": "x = 1\n",
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    found = [str(path.relative_to(tmp_path)) for path in neighbours(tmp_path / "a.py")]
    assert found == ["b.py", "c.py", "pack/__init__.py", "pack/inner.py"]


@pytest.mark.parametrize(
    ("slot", "use", "options", "words"),
    [
        ("grasp_method", "visual_servo", {"gian": 3}, "Unknown option of grasp_method: visual_servo 'gian'"),
        ("grasp_method", "visual_servo", {"servo": {"tolerence": 1}}, "Did you mean 'tolerance'"),
        ("hand", "MINE:WithKeywords", {"gian": 3}, "it lacks .* of the contract HandController"),
        (
            "grasp_method",
            "golem.capabilities.memory.object_map:ObjectMap",
            {},
            "lacks propose, servo of the contract GraspMethod; it fits the slot memory; valid: antipodal",
        ),
    ],
)
def test_a_wrong_module_is_refused_without_being_built(
    user: str, slot: str, use: str, options: dict[str, object], words: str
) -> None:
    with pytest.raises(ConfigError, match=words):
        registry.check(slot, use.replace("MINE", user), options)


@pytest.mark.parametrize("slot", SLOTS)
def test_every_shipped_module_is_one_of_its_slot(slot: str) -> None:
    for use in registry.names(slot):
        if use == "pink_ik":
            pytest.importorskip("pink")
        registry.check(slot, use, {**OPTIONS.get(slot, {}).get(use, {}), **NEEDED.get(use, {})})


NEEDED: dict[str, dict[str, object]] = {
    "replay": {"file": "bag"},
    **dict.fromkeys(("grounding_dino", "owlv2", "yolo_world"), {"weights": "file"}),
}


def test_a_file_that_failed_is_tried_again_once_mended(tmp_path: Path) -> None:
    path = tmp_path / "mended.py"
    path.write_text("raise RuntimeError\n")
    with pytest.raises(ModuleFault):
        registry.load("hand", f"{path}:Hand")
    path.write_text("class Hand: ...\n")
    assert registry.load("hand", f"{path}:Hand").__name__ == "Hand"


def test_a_constructor_that_raises_is_the_modules_fault(user: str) -> None:
    with pytest.raises(ModuleFault, match=r"hand: .*mine\.py:Raises failed: .*OSError: no such weights"):
        registry.create("hand", f"{user}:Raises", {})


def install(folder: Path, package: str, *points: str) -> None:
    """Install a package of one module `PACKAGE`, with entry points of the grasp methods' group, into `folder`."""
    (folder / f"{package}.py").write_text("class Mine: ...\n")
    info = folder / f"{package}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("\n".join(("[golem.grasp_method]", *points)))


def test_an_installed_package_registers_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    assert "suction" not in registry.names("grasp_method")
    install(tmp_path, "sucker", "suction = sucker:Mine")
    monkeypatch.syspath_prepend(str(tmp_path / "another"))  # what is installed is looked up once per path
    assert "sucker" not in sys.modules
    assert type(registry.create("grasp_method", "suction", {})).__module__ == "sucker"
    assert registry.names("grasp_method")[-2:] == ("visual_servo", "suction")
    with pytest.raises(ConfigError, match="suction, visual_servo. Did you mean 'suction'"):
        registry.load("grasp_method", "sucton")
    assert "suction" not in registry.names("lower_body")


def test_a_name_that_two_packages_register_is_refused_with_both(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path, "one_pack", "suction = one_pack:Mine", "centroid = one_pack:Mine")
    install(tmp_path, "other_pack", "suction = other_pack:Mine")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(ConfigError, match="'suction' .* registered by (one|other)_pack and (one|other)_pack"):
        registry.load("grasp_method", "suction")
    with pytest.raises(ConfigError, match="'centroid' .* registered by golem-humanoid and one_pack"):
        registry.load("grasp_method", "centroid")
    assert registry.load("grasp_method", "one_pack:Mine").__name__ == "Mine"
    assert registry.load("grasp_method", "visual_servo") is VisualServo
    assert registry.names("grasp_method").count("centroid") == 1


def test_a_class_that_does_not_say_what_it_takes_is_at_fault() -> None:
    with pytest.raises(ModuleFault, match="builtins:dict failed: .*no signature"):
        registry.create("grasp_method", "builtins:dict", {})
