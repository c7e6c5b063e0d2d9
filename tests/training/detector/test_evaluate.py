"""Average precision and centre error on cases worked out by hand."""

from __future__ import annotations

import numpy as np

from golem.training.detector.dataset import CONDITIONS, Labelled
from golem.training.detector.evaluate import condition_table, evaluate, table
from golem.training.detector.labels import CLASSES
from golem.types import Detection


def data(*rows: list[float]) -> list[Labelled]:
    """Return one image with these labels."""
    return [Labelled(np.zeros((48, 64, 3), np.uint8), np.array(rows), "head", {})]


def screw(x: float, y: float, ignore: float = 0.0) -> list[float]:
    """Return the label of a screw, 10 px wide."""
    return [0.0, x, y, x - 5, y - 5, x + 5, y + 5, ignore]


def hit(x: float, y: float, score: float) -> Detection:
    """Return a detected screw."""
    return Detection("screw", score, np.zeros(4), np.array([x, y]))


def test_perfect_detections() -> None:
    found = [hit(20, 20, 0.9), hit(40, 20, 0.8)]
    score = evaluate(data(screw(20, 20), screw(40, 21)), lambda image: found)["head", "screw"]
    assert score.ap == 1.0 and score.recall == 1.0 and score.precision == 1.0
    np.testing.assert_allclose(score.error, 0.5)


def test_a_false_one_on_top_a_double_one_and_a_missed_one() -> None:
    # In order of score: wrong, right, second on the same part (wrong), right; one of three parts is missed.
    found = [hit(5, 5, 0.9), hit(20, 20, 0.8), hit(21, 20, 0.7), hit(40, 20, 0.6)]
    score = evaluate(data(screw(20, 20), screw(40, 20), screw(60, 40)), lambda image: found)["head", "screw"]
    np.testing.assert_allclose(score.ap, (0.5 + 0.5) / 3)
    np.testing.assert_allclose([score.recall, score.precision], [2 / 3, 2 / 4])


def test_detections_on_ignored_parts_do_not_count() -> None:
    found = [hit(20, 20, 0.9), hit(40, 20, 0.8)]
    score = evaluate(data(screw(20, 20, 1.0), screw(40, 20)), lambda image: found)["head", "screw"]
    assert score.count == 1 and score.ap == 1.0 and score.precision == 1.0


def test_a_detection_on_what_is_seen_of_an_ignored_part_does_not_count() -> None:
    cut = [0.0, -3.0, 20.0, -20.0, 3.0, 14.0, 37.0, 1.0]  # its middle is outside of the image
    score = evaluate(data(cut, screw(40, 20)), lambda image: [hit(12, 30, 0.9), hit(40, 20, 0.8)])
    assert score["head", "screw"].ap == 1.0


def test_the_table_has_a_row_per_class() -> None:
    text = table(evaluate(data(screw(20, 20)), lambda image: []))
    assert len(text.splitlines()) == 2 + len(CLASSES) and "| head | screw | 1 | 0.000 |" in text


def test_each_condition_has_a_row_per_value_that_occurs() -> None:
    images = [np.full((48, 64, 3), k, np.uint8) for k in range(3)]
    trays: list[str] = ["red", "teal", "teal"]
    places = [{name: tray if name == "tray" else "same" for name in CONDITIONS} for tray in trays]
    held = [Labelled(i, np.array([screw(20, 20)]), "head", place) for i, place in zip(images, places, strict=True)]
    rows = condition_table(held, lambda image: [hit(20, 20, 0.9)] if image[0, 0, 0] else []).splitlines()
    assert "| tray | red | 1 | 0.000 | 0.000 | none | none |" in rows
    assert "| tray | teal | 2 | 1.000 | 1.000 | none | none |" in rows and len(rows) == 2 + 5
