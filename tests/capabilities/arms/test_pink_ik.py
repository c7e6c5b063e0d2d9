from __future__ import annotations

import sys

import numpy as np
import pytest

from golem.capabilities.arms.diff_ik import DiffIK
from golem.capabilities.arms.pink_ik import PinkIK
from golem.capabilities.arms.postures import downward, posture
from golem.capabilities.arms.task_space import TaskSpaceConfig
from golem.errors import MissingExtra
from golem.types import NUM_JOINTS, UPPER


def test_pink_and_the_lean_program_agree() -> None:
    pytest.importorskip("pink", reason="needs the extra 'pink'")
    lean, reference = DiffIK(TaskSpaceConfig(collision_rows=0)), PinkIK()
    q = np.zeros(NUM_JOINTS)
    q[UPPER] = posture("ready")
    goals = [
        (downward(0.45, 0.2, 0.15, 1.4), downward(0.47, -0.15, 0.10, -1.7)),
        (None, downward(0.52, 0.0, 0.06, -np.pi / 2)),
        (downward(0.9, 0.2, 0.2, 1.0), None),
        (None, None),
    ]
    for left, right in goals:
        lean.reset(q)
        reference.reset(q)
        for _ in range(60):
            a = lean.step(left, right, q, 0.01)
            b = reference.step(left, right, q, 0.01)
            np.testing.assert_allclose(b.q, a.q, atol=1e-6)
        np.testing.assert_allclose(b.error_position, a.error_position, atol=1e-6)


def test_without_pink_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pink", None)
    with pytest.raises(MissingExtra, match=r"golem-humanoid\[pink\]"):
        PinkIK()
