"""Twin and stack in two networks, with a cable that is pulled out and put back."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.cable import NoNamespaces
from tests.runtime.live.conftest import BLIND
from tests.runtime.live.two_networks import Config, prove

pytest.importorskip("cyclonedds")


@pytest.mark.slow
@pytest.mark.alone
@pytest.mark.timeout(300)
def test_a_cut_cable_stops_the_robot_and_everything_goes_on_once_it_is_back(tmp_path: Path) -> None:
    (tmp_path / "blind.py").write_text(BLIND)
    stack = tmp_path / "stack.yaml"
    stack.write_text(f"robot: {{use: mujoco, world: open}}\nlocalizer: {tmp_path / 'blind.py'}:Blind\nprofile: ideal\n")
    try:
        proof = prove(Config(str(stack), cuts=(1.0, 5.0)))
    except NoNamespaces as error:
        pytest.skip(str(error))
    assert [(cut.seconds, cut.where) for cut in proof.cuts] == [(1.0, "robot"), (5.0, "table")]
    assert all(cut.after < cut.seconds for cut in proof.cuts)  # the gate's limit of 50 ms is tested in simulated time
