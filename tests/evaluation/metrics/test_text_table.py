"""Tables that terminal, page and document share."""

from __future__ import annotations

from golem.evaluation.metrics.text_table import TextTable, short_names


def test_figures_are_set_flush_right_and_words_left() -> None:
    table = TextTable(
        "Pushes", ("method", "level", "lost in"), (("a|b", ">= 20", "fall 2"), ("c", "5", "-")), "Note."
    )
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
    assert short_names(["a/x.py:L", "almi", options]) == {
        "a/x.py:L": "x.py:L",
        "almi": "almi",
        options: options,
    }
    assert short_names(["a/x.py:L", "b/x.py:L"]) == {"a/x.py:L": "a/x.py:L", "b/x.py:L": "b/x.py:L"}
    assert short_names(["policy:almi_open:../w/net.pt"]) == {
        "policy:almi_open:../w/net.pt": "policy:almi_open:net.pt"
    }


def test_a_table_without_rows_is_its_head() -> None:
    table = TextTable("", ("a", "b"), ())
    assert table.figures == (False, False) and table.markdown() == "| a | b |\n|---|---|"
