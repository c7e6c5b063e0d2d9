"""What the table of rungs says of them without importing them is so, and what cannot be is refused by it."""

from __future__ import annotations

import subprocess
import sys

import pytest

from golem.errors import ConfigError
from golem.evaluation.base import RUNGS, rung_class
from golem.evaluation.rung_table import COMPARED, PROFILES, refuse_early
from golem.registry import names
from golem.robots.sensors import profiles


def test_the_methods_of_a_rung_are_the_modules_of_its_slot() -> None:
    slots = {rung: slot for slot, rungs in COMPARED.items() for rung in rungs}
    for rung in RUNGS:
        methods = rung_class(rung)().methods()
        assert rung not in slots or set(methods) == set(names(slots[rung])), rung
    assert tuple(profiles.PROFILES) == PROFILES


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("-n ten", "-n is a whole number, not 'ten'."),
        ("--seed=1.5", "--seed is a whole number, not '1.5'."),
        ("--limit soon", "--limit is a number, not 'soon'."),
        ("--rung=teter", "Did you mean 'tether'"),
        ("--method centroid centriod -n 3", "Did you mean 'centroid'"),
        ("--rung push --method=alm", "Did you mean 'almi'"),
        ("--profile feild", "Did you mean 'field'"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(line: str, sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        refuse_early(line.split())


@pytest.mark.parametrize(
    "line",
    [
        "--rung push --method almi my.py:Legs policy:a:b -n 3 -j 2 --seed 0",
        "--rung base-estimation --method whatever",
        "--method {use: visual_servo, gain: 3}",
        "--rung memory --profile ideal --help",
    ],
)
def test_what_may_be_is_left_to_the_rung(line: str) -> None:
    refuse_early(line.replace(": ", ":").replace(", ", ",").split())


def test_a_refused_line_imports_neither_the_twin_nor_numba() -> None:
    program = (
        "import sys\n"
        "from golem.evaluation.rung_table import refuse_early\n"
        "try:\n refuse_early(['--method', 'centriod'])\n"
        "except Exception: pass\n"
        "print(sorted({'mujoco', 'numba', 'scipy', 'pinocchio'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
