"""The documentation is plain: short sentences, narrow lines, and commits named only where results are."""

from __future__ import annotations

import re
from pathlib import Path
from statistics import median

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent
PAGES = sorted([*(REPOSITORY / "docs").rglob("*.md"), *REPOSITORY.glob("*.md")])
LONGEST_SENTENCE = 35
"""Words of the longest sentence on a page."""
MEDIAN_SENTENCE = 22
"""Words of a sentence in the middle of a page's sentences."""
WIDEST_SHELL_LINE = 100
WIDEST_LINE = 120
COMMIT = re.compile(r"\b(?=[0-9a-f]*[a-f])(?=[0-9a-f]*[0-9])[0-9a-f]{7,40}\b")


def name(page: Path) -> str:
    return page.relative_to(REPOSITORY).as_posix()


def without_code(text: str) -> str:
    """Return a page without its blocks of code, generated parts, headings and comments."""
    text = re.sub(r"^( *)```.*?^\1```$", "\n", text, flags=re.S | re.M)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.S)
    return re.sub(r"^(#|:::|!!!|\|[ :|-]+\|$| {4,}options:).*", "", text, flags=re.M)


def plain(text: str) -> str:
    """Return Markdown as it is read: the text of links, no emphasis, one word for a piece of code."""
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", "", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    return re.sub(r"`[^`]+`|<[^>]+>", "code", text).replace("*", "")


def paragraphs(text: str) -> list[str]:
    """Return paragraphs, items of lists and cells of tables, each on one line."""
    found: list[str] = []
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[-*+]|\d+\.) )|\n(?=\|)", without_code(text)):
        cells = re.split(r"(?<!\\)\|", block) if block.startswith("|") else [block]
        found += [" ".join(re.sub(r"^\s*(?:[-*+]|\d+\.) ", "", plain(cell)).split()) for cell in cells]
    return [paragraph for paragraph in found if paragraph]


def sentences(text: str) -> list[int]:
    """Return the number of words of each sentence; one word of a table or a list is no sentence."""
    parts = [part for p in paragraphs(text) for part in re.split(r"(?<=[.!?])\s+(?=[A-Z(\d\"]|code)", p)]
    lengths = [len(re.findall(r"[^\W_][\w'’.,/%-]*", part)) for part in parts]
    return [n for n in lengths if n >= 4]


def test_a_sentence_is_counted_as_it_is_read() -> None:
    text = "# Title of no sentence at all\n\nOne two *three* four. [Five six](a.md) `seven eight` nine ten!\n"
    assert sentences(text + "\n```sh\nno word of this counts at all\n```\n\n- a b c d e\n") == [4, 5, 5]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_sentences_are_short(page: Path) -> None:
    lengths = sentences(page.read_text(encoding="utf-8")) or [0]
    assert max(lengths) <= LONGEST_SENTENCE and median(lengths) <= MEDIAN_SENTENCE


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_lines_are_narrow(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    shell = re.findall(r"^ *```(?:sh|bash|console)\n(.*?)^ *```", text, re.S | re.M)
    assert [line for block in shell for line in block.splitlines() if len(line) > WIDEST_SHELL_LINE] == []
    prose = [
        line for line in text.splitlines() if "|" not in line and "](" not in line and "http" not in line
    ]
    assert [line for line in prose if len(line) > WIDEST_LINE] == []


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_commits_are_named_only_beside_results(page: Path) -> None:
    if not name(page).startswith(("docs/results", "docs/history")):
        assert COMMIT.findall(without_code(page.read_text(encoding="utf-8"))) == []


if __name__ == "__main__":
    for page in PAGES:
        lengths = sorted(sentences(page.read_text(encoding="utf-8"))) or [0]
        print(f"{name(page):44} {len(lengths):5} sentences, median {median(lengths):4}, most {lengths[-1]}")
