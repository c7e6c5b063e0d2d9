"""What the tables of a run say beside the figures."""

from __future__ import annotations

from dataclasses import replace

from golem.evaluation.harness.records import SCHEMA, TrialRecord
from golem.evaluation.metrics.statistics import wilson
from golem.evaluation.metrics.summary import summarise
from golem.evaluation.metrics.tables import all_cases, comparisons, losses, metrics, run_tables

RECORD = TrialRecord(
    SCHEMA, "fake", "one", "field", 0, 0, {}, {}, {}, "c", "d", "e", {}, True, "done", None, "", {}, {}, None, None
)  # fmt: skip


def record(method: str, index: int, success: bool, moved: str = "", **series: float) -> TrialRecord:
    lost = {} if success else {"stage": "grasp", "module": "localizer: onnx", "detail": f"{index} mm beside"}
    case = {"moved": moved} if moved else {}
    return replace(RECORD, method=method, index=index, success=success, case=case, series=series, **lost)


def test_few_trials_are_said_to_prove_nothing() -> None:
    for n, said in ((4, True), (6, False)):
        records = [record(m, i, m == "one") for m in ("one", "two") for i in range(n)]
        table = comparisons(summarise(records, ("one", "two")))
        assert table is not None
        assert table.note.startswith("With n = 4 no difference can be significant: p is 0.12 even") is said


def test_two_cases_of_one_scene_are_no_two_scenes() -> None:
    records = [record("one", i, i < 6, moved) for moved in ("no", "yes") for i in range(10)]
    summary = summarise(records, ("one",))
    (pooled,) = summary.pooled
    assert (pooled.successes, pooled.n, pooled.scenes) == (12, 20, 10)
    assert pooled.interval == wilson(6, 10), "ten scenes, each seen twice with one end"
    table = all_cases(summary)
    assert table is not None and table.rows[0][1:3] == ("12/20", "60.0 %") and table in run_tables(summary)
    assert all_cases(summarise(records[:10], ("one",))) is None


def test_losses_name_the_module_and_a_reason_the_most_frequent_first() -> None:
    records = [record("one", i, i < 3) for i in range(6)] + [
        replace(record("one", 9, False), stage="drop", module=None, detail="")
    ]
    table = losses(records)
    assert table is not None
    assert table.rows == (
        ("one", "grasp", "localizer: onnx", "3", "3 mm beside"),
        ("one", "drop", "(no module to blame)", "1", "-"),
    )
    assert losses(records[:3]) is None


def test_no_interval_says_what_cannot_be() -> None:
    records = [
        record("one", i, True, claim_picked=float(i), touch_force=70.0 * i, goal_x=i - 0.2, said_picked=1.0)
        for i in range(2)
    ]
    table = metrics(summarise(records, ("one",)), brief=True)
    assert table is not None
    found = {row[0]: row[5] for row in table.rows}
    assert table.columns[5] == "95 % interval"
    assert found["right when it says a screw is in the tray [%]"] == "[9.45, 90.5]"
    assert found["said picked [%]"] == "[34.2, 100]"
    assert found["largest force on pack or tray [N]"].startswith("[0, ")
    assert found["error at the goal along the line [mm]"].startswith("[-")
