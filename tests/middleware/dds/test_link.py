"""Two network namespaces joined by a cable that is pulled out and put back."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from tests.cable import End, NoNamespaces, cable

pytest.importorskip("cyclonedds")

pytestmark = pytest.mark.slow

WRITER = """
import json, sys, time
from golem.middleware.dds.base import ENCAPSULATION, SENSOR, Qos
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
participant = connect(DdsConfig(7, sys.argv[1]))
states, images = participant.writer("rt/state", "T", Qos(depth=8)), participant.writer("rt/image", "T", SENSOR)
while not (states.matched() and images.matched()):
    time.sleep(0.01)
print("matched", flush=True)
longest, sent = 0.0, 0
end = time.monotonic() + 5.0 + float(sys.argv[2])
i = 0
while time.monotonic() < end:
    start = time.monotonic()
    states.write(ENCAPSULATION + str(i).encode().ljust(2088))
    if i % 30 == 0:
        images.write(ENCAPSULATION + bytes(921_600))
        sent += 1
    longest = max(longest, time.monotonic() - start)
    i += 1
    time.sleep(0.002)
print(json.dumps({"longest": longest, "images": sent}))
"""
READER = """
import json, sys, time
from golem.middleware.dds.base import SENSOR, Qos
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
participant = connect(DdsConfig(7, sys.argv[1]))
times, images = [], []

def on_state():
    times.extend(time.monotonic() for sample in reader.take() if sample.alive)

def on_image():
    images.extend(len(sample.payload) for sample in image_reader.take() if sample.alive)

reader = participant.reader("rt/state", "T", Qos(depth=64), on_data=on_state)
image_reader = participant.reader("rt/image", "T", SENSOR, on_data=on_image)
while not reader.matched():
    time.sleep(0.01)
while reader.matched():
    time.sleep(0.02)
gaps = [later - earlier for earlier, later in zip(times, times[1:])]
at = gaps.index(max(gaps))
print(json.dumps({"gap": gaps[at], "after": len(times) - at, "images": len(images)}))
"""
FINDER = """
import sys, time
from golem.middleware.dds.base import Qos
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
_, interface, kind, *peers = sys.argv
participant = connect(DdsConfig(7, interface, tuple(peers)))
print("joined", flush=True)
endpoint = getattr(participant, kind)("rt/state", "T", Qos())
while not endpoint.matched():
    time.sleep(0.01)
print("found", flush=True)
time.sleep(20.0)
"""


@pytest.fixture
def ends() -> Iterator[tuple[End, End]]:
    """Give the ends of a cable between two namespaces."""
    with ExitStack() as stack:
        try:
            pair = stack.enter_context(cable())
        except NoNamespaces as error:
            pytest.skip(str(error))
        yield pair


def run(end: End, script: str, *arguments: str) -> subprocess.Popen[str]:
    command = [*end.inside, sys.executable, "-c", script, end.interface, *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


@pytest.mark.parametrize("seconds", [1.0, 5.0])
def test_a_cut_link_neither_holds_up_the_writer_nor_ends_the_stream(ends: tuple[End, End], seconds: float) -> None:
    here, there = ends
    reader, writer = run(there, READER), run(here, WRITER, str(seconds))
    try:
        assert writer.stdout is not None and writer.stdout.readline().strip() == "matched"
        time.sleep(1.5)
        there.plug(False)
        time.sleep(seconds)
        there.plug(True)
        wrote = json.loads(writer.communicate(timeout=30.0)[0])
        read = json.loads(reader.communicate(timeout=30.0)[0])
    finally:
        writer.kill()
        reader.kill()
    assert wrote["longest"] < 0.6, "the writer waited for the link"  # 1 to 2 s with the default send buffer
    assert read["gap"] > seconds - 0.3, "the link was not cut"
    assert read["after"] > 200 and read["images"] > wrote["images"] / 6


def test_where_multicast_does_not_pass_one_side_has_to_name_the_other_which_may_come_late(
    ends: tuple[End, End],
) -> None:
    here, there = ends
    for end in ends:
        rule = [*end.inside, "iptables", "-A", "INPUT", "-d", "224.0.0.0/4", "-j", "DROP"]
        try:
            subprocess.run(rule, check=True, capture_output=True)
        except (subprocess.CalledProcessError, OSError):
            pytest.skip("needs iptables")
    finders = [run(here, FINDER, "writer", "10.77.0.2")]
    try:
        assert finders[0].stdout is not None and finders[0].stdout.readline().strip() == "joined"
        finders.append(run(there, FINDER, "reader"))
        for finder in finders:
            assert finder.stdout is not None
            assert "found" in (line.strip() for line in finder.stdout)
    finally:
        for finder in finders:
            finder.kill()
            finder.wait()
