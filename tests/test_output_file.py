"""What a user asked for is written whole, or refused in one sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

from golem.errors import OutputError
from golem.output_file import write_file


def test_it_makes_the_folder_and_leaves_no_part(tmp_path: Path) -> None:
    path = write_file(tmp_path / "new" / "a.txt", "words")
    assert path.read_text() == "words"
    assert [file.name for file in path.parent.iterdir()] == ["a.txt"]


def test_a_folder_is_refused_in_a_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(OutputError, match=r"^Cannot write \.: .*\.$"):
        write_file(Path("."), "words")
    assert not any(tmp_path.iterdir())
