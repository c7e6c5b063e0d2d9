"""Who records keeps its priority: an encoder that makes itself real-time would be before the safety gate."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import numpy as np
import pytest

from golem.datasets.own_priority import TASKS, own_priority
from golem.datasets.schema import Feature

pytestmark = pytest.mark.skipif(not TASKS.is_dir(), reason="only Linux says how its threads are scheduled")


def policies() -> set[int]:
    return {os.sched_getscheduler(int(task)) for task in os.listdir(TASKS)}


def test_an_encoder_leaves_no_thread_real_time(tmp_path: Path) -> None:
    pytest.importorskip("av")
    from golem.datasets.episode_writer import Video

    before = policies()
    video = Video(tmp_path / "a.mp4", Feature("video", (64, 96, 3), ["height", "width", "channel"]), 30)
    for shade in range(40):
        video.add(np.full((64, 96, 3), shade, np.uint8))
    assert policies() <= before
    video.finish(40)
    assert policies() <= before and (tmp_path / "a.mp4").stat().st_size > 0


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root may make a thread real-time")
def test_this_thread_and_those_begun_meanwhile_get_it_back() -> None:
    ended = threading.Event()
    first = os.sched_getscheduler(0)
    with own_priority():
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        except PermissionError:
            pytest.skip("this machine lets nobody be real-time")
        other = threading.Thread(target=ended.wait)
        other.start()
        assert other.native_id is not None and os.sched_getscheduler(other.native_id) == os.SCHED_FIFO
    assert os.sched_getscheduler(0) == first == os.sched_getscheduler(other.native_id)
    ended.set()
    other.join()
