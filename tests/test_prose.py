"""The documentation is plain: short sentences, narrow lines, and commits named only where results are."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from statistics import median

REPOSITORY = Path(__file__).resolve().parent.parent
PAGES = sorted([*(REPOSITORY / "docs").rglob("*.md"), *REPOSITORY.glob("*.md")])
LONGEST, MEDIAN = 30, 20
"""Words of the longest sentence on a page, and of one in the middle of its sentences."""
HISTORY_LONGEST, HISTORY_MEDIAN = 35, 22
"""The same for the pages under docs/history, which are left as they were written."""
WIDEST_SHELL_LINE = 100
WIDEST_LINE = 120
COMMIT = re.compile(r"\b(?=[0-9a-f]*[a-f])(?=[0-9a-f]*[0-9])[0-9a-f]{7,40}\b")


def name(page: Path) -> str:
    return page.relative_to(REPOSITORY).as_posix()


@cache
def read(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def without_code(text: str) -> str:
    """Return a page without its blocks of code, generated parts, headings and comments."""
    text = re.sub(r"^( *)```.*?^\1```$", "\n", text, flags=re.S | re.M)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.S)
    return re.sub(r"^(#|!!!|\|[ :|-]+\|$).*", "", text, flags=re.M)


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


def wide_lines(text: str) -> list[str]:
    """Return the lines of a page that are too wide, those of shell blocks and those of prose."""
    shell = re.findall(r"^ *```(?:sh|bash|console)\n(.*?)^ *```", text, re.S | re.M)
    prose = [line for line in text.splitlines() if "|" not in line and "](" not in line and "http" not in line]
    commands = [line for block in shell for line in block.splitlines() if len(line) > WIDEST_SHELL_LINE]
    return commands + [line for line in prose if len(line) > WIDEST_LINE]


def test_a_wide_line_is_found() -> None:
    wide = 101 * "x"
    assert wide_lines(f"{wide}\n```sh\n{wide}\n```\n{20 * wide} | {wide}\n{121 * 'y'}\n") == [wide, 121 * "y"]


def test_sentences_are_short() -> None:
    assert len(PAGES) > 40
    for history, longest, middle in ((False, LONGEST, MEDIAN), (True, HISTORY_LONGEST, HISTORY_MEDIAN)):
        pages = [page for page in PAGES if name(page).startswith("docs/history") == history]
        lengths = {name(page): sentences(read(page)) or [0] for page in pages}
        assert {page: max(n) for page, n in lengths.items() if max(n) > longest} == {}
        assert {page: median(n) for page, n in lengths.items() if median(n) > middle} == {}


def test_lines_are_narrow() -> None:
    found = {name(page): wide_lines(read(page)) for page in PAGES}
    assert {page: lines for page, lines in found.items() if lines} == {}


def test_commits_are_named_only_beside_results() -> None:
    found = {
        name(page): COMMIT.findall(without_code(read(page)))
        for page in PAGES
        if not name(page).startswith(("docs/results", "docs/history"))
    }
    assert {page: commits for page, commits in found.items() if commits} == {}


if __name__ == "__main__":
    for page in PAGES:
        lengths = sorted(sentences(read(page))) or [0]
        print(f"{name(page):44} {len(lengths):5} sentences, median {median(lengths):4}, most {lengths[-1]}")
