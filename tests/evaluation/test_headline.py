"""The README's headline still holds: the screws are picked in the hoist and standing, with the errors of `field`."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests import golden

from golem.evaluation.harness.ladder import LadderConfig, run_ladder

TRIALS = 8

CLOSE = 1e-6
"""Share by which arithmetic in another order may change what no contact amplifies; below 1e-3, of 1e-3."""
PLACE, TIME = 2e-3, 0.1
"""For what a contact amplifies [m, rad or 1; s]. One joint moved by 1e-12 rad at the start changes where the screw
falls into the tray by 0.04 mm, where a standing robot grasps by up to 1.2 mm, and no time."""
AMPLIFIED = {"tether": ("drop_inside", "pull_beside", "pull_turn")}
"""What contacts amplify, where it is not everything: a robot in its hoist touches nothing before it pulls."""
COUNTS = ("claim", "said", "doable", "touches", "self_contacts", "steps", "below_zero")


@pytest.mark.slow
def test_a_robot_stands_to_the_last_digits_as_it_did() -> None:
    found = golden.standing()
    for kept in golden.records()["standing"].values():
        assert found == pytest.approx(kept, rel=CLOSE, abs=1e-3 * CLOSE)


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("rung", ["tether", "stand"])
def test_a_pick_comes_to_what_it_did(rung: str) -> None:
    """If it is meant to come to something else: `python -m tests.golden`."""
    found, kept, mine = golden.picked(rung), golden.records()[rung], golden.processor()
    others = {who: changed(rung, found, record) for who, record in kept.items()}
    if all(others.values()):
        assert mine not in kept, others[mine]
        pytest.skip(f"Nobody has made a record on a processor of this kind: {mine}.")


def changed(rung: str, found: golden.Record, kept: golden.Record) -> list[str]:
    """Return the names of the figures that are not as they are kept."""
    # Another processor's last digits may bring a try more, and with it another claim.
    off = sorted(found.keys() ^ kept.keys())
    for name, value in kept.items():
        if name not in found:
            continue
        if name.startswith(COUNTS):
            same = found[name] == value
        elif name in AMPLIFIED.get(rung, kept):
            same = found[name] == pytest.approx(value, abs=TIME if name in ("total", "detect_to_grasp") else PLACE)
        else:
            same = found[name] == pytest.approx(value, rel=CLOSE, abs=1e-3 * CLOSE)
        off += [] if same else [name]
    return off


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.alone  # uses both processors itself
@pytest.mark.timeout(900)
@pytest.mark.parametrize("rung", ["tether", "stand"])
def test_the_screws_are_picked_as_the_readme_says(rung: str, tmp_path: Path) -> None:
    config = LadderConfig(
        rung=rung, method=("visual_servo",), n=TRIALS, profile="field", seed=golden.SEED, out=tmp_path, j=2
    )
    records = run_ladder(config).records
    assert len(records) == TRIALS
    lost = [
        f"{record.index}: {record.stage}, {record.module}: {record.detail}" for record in records if not record.success
    ]
    # Claimed are 99 and 98 %: with these, two losses of eight come in one run of a hundred.
    assert len(lost) <= 1, lost
