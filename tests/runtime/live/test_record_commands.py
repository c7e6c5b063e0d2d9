from __future__ import annotations

import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("mcap")
pytest.importorskip("rosbags")

from golem.middleware.bags.base import BagMessage
from golem.middleware.bags.recorder import topic
from golem.middleware.bags.writer import BagConfig, BagWriter
from golem.runtime.live import record_commands
from golem.runtime.live.record_commands import Growth


def test_it_is_said_once_how_fast_a_bag_grows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now, said = 0.0, list[str]()
    monkeypatch.setattr(record_commands, "time", SimpleNamespace(monotonic=lambda: now))
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=600e6))
    bag, text = BagWriter(tmp_path / "bag", BagConfig(chunk=1000)), topic("/text", "std_msgs/msg/String")
    growth = Growth(bag, said.append)
    growth.look()  # nothing came yet: that says nothing
    for second in range(10):
        now = 100.0 + second
        for _ in range(10):
            bag.write(BagMessage(text, int(now * 1e9), int(now * 1e9), bytes(100_000)))
        bag.flush()
        growth.look()
    bag.close()
    (line,) = said
    figures = re.fullmatch(r"The bag grows by (\d+) MB a minute; the disk has room for (\d+) minutes\. .*", line)
    assert figures is not None and [int(figure) for figure in figures.groups()] == [60, 10]
