from __future__ import annotations

import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

from golem import provenance
from golem.capabilities.legs.description import SHIPPED
from golem.stack import Choice, Stack


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package that stands in for golem's, outside any repository."""
    folder = tmp_path / "repository" / "package"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text("one = 1\n")
    monkeypatch.setattr(provenance, "_package", lambda: folder)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path))
    for name in ("GIT_AUTHOR_NAME", "GIT_AUTHOR_EMAIL", "GIT_COMMITTER_NAME", "GIT_COMMITTER_EMAIL"):
        monkeypatch.setenv(name, "nobody")
    return folder


def git(folder: Path, *arguments: str) -> str:
    return subprocess.run(["git", "-C", str(folder), *arguments], check=True, capture_output=True, text=True).stdout


def commit() -> str:
    return provenance.commit.__wrapped__()


def code() -> str:
    return provenance.digest(provenance.code_files.__wrapped__())


def test_the_commit_is_gits_and_says_when_files_differ(package: Path) -> None:
    git(package.parent, "init", "-q")
    git(package.parent, "add", ".")
    git(package.parent, "commit", "-q", "-m", "first")
    head = git(package.parent, "rev-parse", "HEAD").strip()
    assert commit() == head[:12]
    (package.parent / "notes.txt").write_text("beside the package")
    assert commit() == head[:12]
    (package / "new.py").write_text("")
    assert commit() == head[:12] + "-dirty"


def test_outside_git_the_version_stands_in(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(provenance, "versions", lambda: {"golem-humanoid": "1.2.3"})
    assert commit() == "1.2.3"


def test_a_package_that_a_strangers_repository_ignores_is_not_of_its_commit(
    package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    git(package.parent, "init", "-q")
    (package.parent / "own.py").write_text("")
    git(package.parent, "add", "own.py")
    git(package.parent, "commit", "-q", "-m", "stranger")
    monkeypatch.setattr(provenance, "versions", lambda: {"golem-humanoid": "1.2.3"})
    assert commit() == "1.2.3"


def test_the_code_files_follows_content_and_names_but_no_caches(package: Path) -> None:
    first = code()
    (package / "__pycache__").mkdir()
    (package / "__pycache__" / "x.pyc").write_bytes(b"cache")
    assert code() == first
    (package / "__init__.py").write_text("one = 2\n")
    second = code()
    (package / "__init__.py").rename(package / "other.py")
    assert len({first, second, code()}) == 3


def test_a_users_policy_is_its_description_and_its_network(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text((SHIPPED / "almi_stand.yaml").read_text())
    network = tmp_path / "almi_stand.onnx"
    network.write_bytes(b"one")
    policy = {"use": "policy", "options": {"file": str(mine)}}
    for legs in (Choice("policy", {"file": str(mine)}), Choice("handover", {"walk": policy, "stand": policy})):
        before = provenance.user_files(Stack({"lower_body": legs}))
        network.write_bytes(network.read_bytes() + b"more")
        after = provenance.user_files(Stack({"lower_body": legs}))
        assert before.keys() == after.keys() and before != after


def test_a_part_that_a_class_of_a_users_file_plays_is_that_file(tmp_path: Path) -> None:
    mine = tmp_path / "mine.py"
    mine.write_text("one = 1\n")
    legs = Choice("handover", {"walk": {"use": f"{mine}:Mine"}, "stand": {"use": "almi"}})
    before = provenance.user_files(Stack({"lower_body": legs}))
    mine.write_text("one = 2\n")
    after = provenance.user_files(Stack({"lower_body": legs}))
    assert before.keys() == after.keys() == {"lower_body/walk/use"} and before != after


def test_what_a_users_file_imports_from_beside_it_is_of_the_configuration(tmp_path: Path) -> None:
    mine, helper = tmp_path / "mine.py", tmp_path / "helper.py"
    mine.write_text("import helper\n")
    helper.write_text("one = 1\n")
    legs = Choice(f"{mine}:Mine")
    before = provenance.user_files(Stack({"lower_body": legs}))
    helper.write_text("one = 2\n")
    after = provenance.user_files(Stack({"lower_body": legs}))
    assert before.keys() == {"lower_body/use", "lower_body/use/helper.py"}
    assert [key for key in after if before[key] != after[key]] == ["lower_body/use/helper.py"]


def test_a_digest_does_not_depend_on_the_order_of_keys() -> None:
    assert provenance.digest({"a": 1, "b": [2]}) == provenance.digest({"b": [2], "a": 1})
    assert provenance.digest({"a": 1}) != provenance.digest({"a": 1.5})


def test_a_module_named_by_its_package_is_a_users_file_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my_package").mkdir()
    (tmp_path / "my_package" / "__init__.py").touch()
    file = tmp_path / "my_package" / "legs.py"
    file.write_text("one = 1\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    stack = Stack({"lower_body": Choice("my_package.legs:Mine")})
    before = provenance.user_files(stack)
    file.write_text("one = 2\n")
    assert before.keys() == {"lower_body/use"} and provenance.user_files(stack) != before


@dataclass(frozen=True)
class Inner:
    level: float = 1.0


@dataclass(frozen=True)
class Command:
    out: str = "runs"
    n: int = 3
    method: tuple[str, ...] = ()
    quick: bool = False
    view: bool = True
    seed: int = 0
    inner: Inner = Inner()


def test_a_command_line_says_what_is_not_the_default_and_what_shall_always_be_said() -> None:
    assert provenance.command_line("golem x", Command(), always=("seed",)) == "golem x --seed 0"
    given = Command("my runs", 4, ("a", "{use: b}"), True, False, 0, Inner(2.5))
    assert provenance.command_line("golem x", given) == (
        "golem x --out 'my runs' -n 4 --method a '{use: b}' --quick --no-view --level 2.5"
    )


def test_changes_are_named_by_where_they_are() -> None:
    old = {"stack": {"latency": 0.02, "use": "a"}, "files": {"x.py": 16 * "a", "gone.py": 16 * "a"}}
    new = {"stack": {"latency": 0.04, "use": "a"}, "files": {"x.py": 16 * "b"}, "seed": 1}
    assert provenance.changes("", old, new) == [
        "stack.latency was 0.02 and is 0.04",
        "files.x.py has changed",
        "files.gone.py has changed",
        "seed was absent and is 1",
    ]
    assert provenance.changes("", old, old) == []
