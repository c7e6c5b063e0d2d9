"""Tables that terminal, page and document share."""

from __future__ import annotations

from golem.evaluation.metrics.text_table import TextTable, short_names


def test_figures_are_set_flush_right_and_words_left() -> None:
    table = TextTable("Pushes", ("method", "level", "lost in"), (("a|b", ">= 20", "fall 2"), ("c", "5", "-")), "Note.")
    assert table.figures == (False, True, False)
    assert table.markdown() == (
        "**Pushes**\n\n"
        "| method | level | lost in |\n"
        "|--------|------:|---------|\n"
        "| a\\|b   | >= 20 | fall 2  |\n"
        "| c      |     5 | -       |\n\n"
        "Note."
    )


def test_names_are_short_where_that_tells_them_apart() -> None:
    options = "{use: almi, walk: a/x.onnx}"
    assert short_names(["a/x.py:L", "almi", options]) == {"a/x.py:L": "x.py:L", "almi": "almi", options: options}
    assert short_names(["a/x.py:L", "b/x.py:L"]) == {"a/x.py:L": "a/x.py:L", "b/x.py:L": "b/x.py:L"}
    assert short_names(["policy:almi_open:../w/net.pt"]) == {"policy:almi_open:../w/net.pt": "policy:almi_open:net.pt"}


def test_a_table_without_rows_is_its_head() -> None:
    table = TextTable("", ("a", "b"), ())
    assert table.figures == (False, False) and table.markdown() == "| a | b |\n|---|---|"


def test_a_terminal_gets_lines_that_fit_and_loses_no_word() -> None:
    words = "a hand reaches a loose screw and the tray without a touch"
    table = TextTable("Why", ("metric", "method", "n"), ((words, "centroid", "12"),), words)
    said = table.terminal(50)
    assert max(map(len, said.splitlines())) <= 50
    assert all(said.split().count(word) >= 2 for word in words.split())
    assert said.splitlines()[1].split() == ["metric", "method", "n"] and said.splitlines()[3].endswith("12")


def test_latex_is_escaped_and_figures_are_flush_right() -> None:
    table = TextTable("A & B", ("use_it", "rate [%]"), (("{x: 1}", "< 0.5"),), "p < 0.05.")
    assert table.latex().splitlines() == [
        r"\begin{table}",
        r"\centering",
        r"\caption{A \& B. p $<$ 0.05.}",
        r"\begin{tabular}{lr}",
        r"\toprule",
        r"use\_it & rate [\%] \\",
        r"\midrule",
        r"\{x: 1\} & $<$ 0.5 \\",
        r"\bottomrule",
        r"\end{tabular}",
        r"\end{table}",
    ]
