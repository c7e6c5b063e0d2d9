"""A bag becomes one stretch of ticks with fresh states and stiff commands, or is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from golem.evaluation.identification import recording
from golem.evaluation.identification.recording import COMMAND, STATE, IdentificationError, read_motion
from golem.interfaces.recorded import public_topics
from golem.middleware.bags.base import BagMessage
from golem.middleware.bags.writer import BagWriter
from golem.middleware.wire.convert import encode_low_command, encode_low_state
from golem.types import TICK, Imu, LowCommand, LowState


def write(folder: Path, ticks: int, limp: tuple[int, ...] = (), topics: tuple[str, ...] = (STATE, COMMAND)) -> Path:
    """Write `ticks` of a robot whose joints and commands are at the tick's number, motors limp in some of them."""
    writer, known = BagWriter(folder), {topic.name: topic for topic in public_topics((STATE, COMMAND))}
    for k in range(ticks):
        q, zero = np.full(27, k * 1e-3), np.zeros(27)
        imu = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))
        stiff = np.full(27, 0.0 if k in limp else 50.0)
        payloads = {
            STATE: encode_low_state(LowState(k * TICK, q, zero, zero, imu), 5),
            COMMAND: encode_low_command(LowCommand(k * TICK, q, zero, zero, stiff, zero), 5),
        }
        for name in topics:
            at = round(k * TICK * 1e9)
            writer.write(BagMessage(known[name], at, at, payloads[name]))
    writer.close()
    return folder


def test_the_longest_stiff_stretch_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording, "SHORTEST", 0.5)
    motion = read_motion(write(tmp_path / "bag", 500, limp=(100,)))
    assert len(motion.q) == pytest.approx(398, abs=2)
    np.testing.assert_allclose(motion.q[0], 0.101, atol=1.5e-3)
    np.testing.assert_allclose(motion.command[:, 0], motion.q, atol=1e-6)
    np.testing.assert_allclose(motion.command[:, 3], 50.0)
    np.testing.assert_allclose(motion.acc[0], [0.0, 0.0, 9.81], atol=1e-6)


def test_what_is_too_little_is_refused(tmp_path: Path) -> None:
    with pytest.raises(IdentificationError, match=r"has 0\.\d s of stiff motors in a row; identification takes 20 s"):
        read_motion(write(tmp_path / "short", 300))
    with pytest.raises(IdentificationError, match="has 0.0 s"):
        read_motion(write(tmp_path / "limp", 100, limp=tuple(range(100))))
    with pytest.raises(IdentificationError, match="has no /lowcmd: it takes /lowstate and /lowcmd"):
        read_motion(write(tmp_path / "half", 10, topics=(STATE,)))
