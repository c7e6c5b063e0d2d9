"""A robot that is driven over the socket of the pilot's page, paced by the wall clock, beside the live view."""

from __future__ import annotations

import json
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from golem.runtime.lockstep import LockstepRunner
from golem.teleop.pilot import PilotConfig
from golem.teleop.session import Teleop, TeleopConfig

client = pytest.importorskip("websockets.sync.client")
pytest.importorskip("viser")


class Over(Exception):
    """Ends a session."""


def drive(
    teleop: Teleop, running: LockstepRunner, until: float, script: Any, seen: list[tuple[float, np.ndarray]]
) -> None:
    """Let `script(teleop)` drive from a thread of its own, up to a robot time."""
    thread = threading.Thread(target=script, args=(teleop,), daemon=True)
    watch, arm = teleop.watch, running.context.arms["right"]

    def both() -> None:
        watch()
        t = running.executor.t
        if t > 0.5 and thread.ident is None:
            thread.start()
        seen.append((t, arm.pose[:3, 3].copy()))
        if t >= until:
            raise Over

    with pytest.raises(Over):
        teleop.view.run(teleop.driving, None, watch=both)
    thread.join(10)


def say(socket: Any, running: LockstepRunner, seconds: float, orders: tuple[str, ...] = (), **words: Any) -> None:
    """Say the same 25 times a second for a while of robot time, as the page does."""
    end, words["hold"] = running.executor.t + seconds, words.get("hold", True)
    left = list(orders)
    while running.executor.t < end:
        socket.send(json.dumps(words | ({"order": left.pop(0)} if left else {})))
        socket.recv(timeout=5)
        time.sleep(0.04)


DOWN = {"v": [0.0, 0.0, -1.0, 0.0, 0.0, 0.0]}


@pytest.mark.slow
def test_a_window_drives_the_hand_and_a_second_one_stops_it(twin: tuple[LockstepRunner, Any], tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    pytest.importorskip("av")
    running, robot = twin
    config = TeleopConfig(port=0, dataset=tmp_path / "driven", pilot=PilotConfig(speed=0.2))
    teleop = Teleop(config, running, robot)
    marks: dict[str, float] = {}

    def script(teleop: Teleop) -> None:
        url = teleop.page.url.replace("http", "ws")
        with client.connect(url, proxy=None) as one, client.connect(url, proxy=None) as two:
            say(one, running, 1.0, ("record",), right=DOWN)
            marks["driven"] = running.executor.t
            one.send(json.dumps({"hold": True, "right": DOWN}))
            say(two, running, 0.5, right=DOWN)
            marks["fought"] = running.executor.t
            say(two, running, 0.3, hold=False)
            say(one, running, 0.3, ("keep",), hold=False)

    seen: list[tuple[float, np.ndarray]] = []
    try:
        drive(teleop, running, 5.0, script, seen)
        t, z = np.array([t for t, _ in seen]), np.array([p[2] for _, p in seen])
        driven = np.interp(marks["driven"], t, z) - np.interp(0.45, t, z)
        assert driven < -0.06
        # Within the 0.3 s that it takes to stop, and what the hoist sways, it stays.
        still = z[(t > marks["driven"] + 0.6)]
        assert np.ptp(still) < 0.012
    finally:
        teleop.close()
    from golem.datasets.store import DatasetFolder

    assert DatasetFolder(tmp_path / "driven").episodes[0].length > 5
