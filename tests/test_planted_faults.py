"""The faults that `plant_faults` plants are of today's sources: a line that is gone would find nothing."""

from __future__ import annotations

from tests.plant_faults import FAULTS, REPOSITORY


def test_every_line_to_be_spoiled_is_there_once_and_its_tests_are() -> None:
    wrong = {
        name: fault.file
        for name, fault in FAULTS.items()
        if (REPOSITORY / "src" / "golem" / fault.file).read_text(encoding="utf-8").count(fault.line) != 1
        or not all((REPOSITORY / test).exists() for test in fault.tests)
    }
    assert not wrong and len(FAULTS) >= 20
