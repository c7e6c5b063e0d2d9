"""Words of the benches' command lines."""

from __future__ import annotations

from pathlib import Path

import pytest

from golem.errors import ConfigError
from golem.evaluation.harness.arguments import replaced_modules, robot_options
from golem.evaluation.subject import Subject


def test_options_of_the_robot_are_words_and_numbers() -> None:
    assert robot_options(["feet=box", "payload=[1, 2]"]) == {"feet": "box", "payload": [1, 2]}
    for word, sentence in (
        ("feet", "option=value"),
        ("payload=2024-01-01", "a value is a word"),
        ("latency=0", "--latency"),
    ):
        with pytest.raises(ConfigError, match=sentence):
            robot_options([word])


def test_a_module_is_replaced_once() -> None:
    assert replaced_modules(["estimator={use: x, y: z=1}"]) == {"estimator": "{use: x, y: z=1}"}
    for words, sentence in ((["estimator"], "slot=implementation"), (["a=b", "a=c"], "names the a twice")):
        with pytest.raises(ConfigError, match=sentence):
            replaced_modules(words)


def test_a_lower_body_is_tested_beside_the_modules_that_were_asked_for(tmp_path: Path) -> None:
    mine = tmp_path / "mine.py"
    mine.write_text("class Mine: ...\n")
    subjects = [
        Subject.of("almi", "bench", {}, use)
        for use in (None, {"estimator": "invariant_ekf"}, {"estimator": f"{mine}:Mine"})
    ]
    used = [subject.stack().choice("estimator").use for subject in subjects]
    assert used == ["random_walk_kf", "invariant_ekf", f"{mine}:Mine"]
    before = subjects[2]
    mine.write_text("class Mine: changed = True\n")
    assert Subject.of("almi", "bench", {}, before.use).files != before.files
    with pytest.raises(ConfigError, match="brings its own lower_body"):
        Subject.of("almi", "bench", {}, {"lower_body": "wbc"})
