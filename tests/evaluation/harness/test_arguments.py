"""Words of the command line."""

from __future__ import annotations

from pathlib import Path

import pytest

from golem.errors import ConfigError
from golem.evaluation.harness.arguments import replaced_modules, robot_options
from golem.evaluation.rungs.push import PushRung


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
    text = "class Mine:\n    def reset(self, state): ...\n    def step(self, state, dt): ...\n"
    mine.write_text(text)
    rung, use = PushRung(), {"estimator": f"{mine}:Mine"}
    used = [rung.stack("almi", "bench", u).choice("estimator").use for u in ({}, use)]
    assert used == ["random_walk_kf", f"{mine}:Mine"]
    before = rung.config("almi", "bench", use)
    mine.write_text(f"{text}    changed = True\n")
    assert rung.config("almi", "bench", use) != before
    with pytest.raises(ConfigError, match="brings its own lower_body"):
        rung.config("almi", "bench", {"lower_body": "wbc"})
