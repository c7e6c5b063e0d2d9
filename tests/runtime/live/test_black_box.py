"""A stop leaves a bag of what the gate heard and said around it; a writer that keeps the motors is an alarm."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.runtime.live.conftest import Live

from golem.hardware.estop.estop_config import VirtualEstop
from golem.hardware.safety.base import SafetyLimits
from golem.interfaces import public
from golem.interfaces.payloads import GateState
from golem.interfaces.ros_convert import to_gate_status
from golem.middleware.bags.reader import Bag
from golem.middleware.ros import codec
from golem.middleware.ros.msgs.golem_interfaces import SafetyStatus
from golem.middleware.wire import hg
from golem.middleware.wire.convert import encode_low_command
from golem.runtime.live.black_box import BlackBox
from golem.runtime.live.safety_process import SafetyProcess
from golem.types import LowCommand


@pytest.mark.slow
def test_a_stop_leaves_a_bag_of_the_seconds_around_it(live: Live, tmp_path: Path) -> None:
    said: list[str] = []
    box = BlackBox(tmp_path, said.append, run=lambda write: write())
    live.leave("safety")
    live.gate = SafetyProcess(
        *live.member("safety"),
        SafetyLimits.from_profile().still(),
        VirtualEstop(),
        clock=lambda: live.clock,
        black_box=box,
    )
    live.activate()
    live.run(6.0)
    assert not box.written, "nothing has stopped"
    stopped = live.clock
    assert live.ask("stop")[0]
    live.run(2.5)
    (folder,) = box.written
    assert "stop_requested" in folder.name and str(folder) in said[0]
    messages = list(Bag(folder).messages())
    times = np.array([message.log_time for message in messages]) * 1e-9
    assert stopped - 5.1 < times.min() < stopped - 4.9 and stopped + 1.9 < times.max() < stopped + 2.1
    counts = {name: sum(m.topic.name == name for m in messages) for name in ("/lowstate", "/lowcmd")}
    assert all(abs(n - 3500) < 20 for n in counts.values()), counts
    (status,) = [codec.deserialize(m.payload, SafetyStatus) for m in messages if m.topic.name == "/safety/status"]
    assert to_gate_status(status).state is GateState.STOP1


def test_a_stop_under_which_the_motors_follow_another_writer_is_an_alarm(live: Live) -> None:
    live.activate()
    stranger, _ = live.member("stranger")
    writer = stranger.writer("rt/lowcmd", hg.LOW_CMD.type_name, public.topic("/lowcmd").qos)
    zeros = np.zeros(27)
    for _ in range(50):
        writer.write(encode_low_command(LowCommand(0.0, zeros, zeros, zeros, zeros, zeros), 0))
        live.run(0.002)
    assert live.gate is not None
    assert (live.state, live.reason) == (GateState.STOP1, "not_in_control")
    assert "ALARM" in live.gate.status.detail and "two_writers" in live.gate.status.detail
    stranger.close()
    live.run(0.2)
    assert (live.state, live.reason) == (GateState.STOP1, "two_writers")
