"""The vendor's Python SDK and our own reader on one robot at a time: `python -m tests.interop.vendor_sdk --seconds 60`.

Starts a twin with legs on board, reads rt/lowstate with both, calls LocoClient, and prints what each got. What is lost
is seen by the ticks, which count milliseconds. Needs GOLEM_UNITREE_SDK, a checkout of unitree_sdk2_python.
"""

# pyright: reportMissingImports=false

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from tests.domains import free_domain

PERIOD = 2
"""Ticks from one state to the next [ms]."""


def figures(ticks: list[int], wrong: int, cpu: float) -> dict[str, float]:
    """Return what came of the states: how many, share lost, longest gap in robot time [ms], checksums, CPU share."""
    gaps = np.diff(ticks)
    expected = (ticks[-1] - ticks[0]) // PERIOD + 1
    lost = round(100.0 * (1.0 - len(ticks) / expected), 3)
    return {"states": len(ticks), "lost_percent": lost, "longest_gap_ms": int(gaps.max()), "bad_checksums": wrong,
            "cpu_percent": round(cpu, 1)}  # fmt: skip


def timed(seconds: float, work: Callable[[], None]) -> float:
    """Have `work` done for `seconds`, and return the share of a core that it took [%]."""
    cpu, end = time.process_time(), time.monotonic() + seconds
    while time.monotonic() < end:
        work()
    return 100.0 * (time.process_time() - cpu) / seconds


def read_with_sdk(domain: int, seconds: float) -> dict[str, float]:
    """Read as the vendor's examples do: a handler on the SDK's own thread, with its queue of ten.

    Every 50th state is checked.
    """
    sys.path.insert(0, os.environ["GOLEM_UNITREE_SDK"])
    from unitree_sdk2py.core.channel import ChannelFactoryInitialize, ChannelSubscriber
    from unitree_sdk2py.idl.unitree_hg.msg.dds_ import LowState_
    from unitree_sdk2py.utils.crc import CRC

    ChannelFactoryInitialize(domain, "lo")
    ticks: list[int] = []
    wrong, checksum = 0, CRC()

    def take(state: LowState_) -> None:
        nonlocal wrong
        ticks.append(state.tick)
        if len(ticks) % 50 == 0:
            wrong += checksum.Crc(state) != state.crc

    subscriber = ChannelSubscriber("rt/lowstate", LowState_)
    subscriber.Init(take, 10)
    cpu = timed(seconds, lambda: time.sleep(0.05))
    return figures(ticks, wrong, cpu)


def call_loco(domain: int, calls: int) -> dict[str, float]:
    """Call the loco service with the vendor's client; time of a call [ms]."""
    sys.path.insert(0, os.environ["GOLEM_UNITREE_SDK"])
    from unitree_sdk2py.core.channel import ChannelFactoryInitialize
    from unitree_sdk2py.h1.loco.h1_loco_client import LocoClient

    ChannelFactoryInitialize(domain, "lo")
    client = LocoClient()
    client.SetTimeout(5.0)
    client.Init()
    times, failed = [], 0
    for _ in range(calls):
        start = time.monotonic()
        failed += client.GetServerApiVersion()[0] != 0
        times.append(1e3 * (time.monotonic() - start))
    return {"calls": calls, "failed": failed, "median_ms": round(float(np.median(times)), 2),
            "longest_ms": round(max(times), 1)}  # fmt: skip


def read_with_ours(domain: int, seconds: float) -> dict[str, float]:
    """Read with golem.middleware, which checks every state."""
    from golem.middleware.dds.base import Qos
    from golem.middleware.dds.connect import connect
    from golem.middleware.dds.domain import DdsConfig
    from golem.middleware.wire import convert, hg
    from golem.middleware.wire.struct_layout import WireError

    participant = connect(DdsConfig(domain))
    reader = participant.reader("rt/lowstate", hg.LOW_STATE.type_name, Qos(depth=200))
    ticks: list[int] = []
    wrong = 0

    def take() -> None:
        nonlocal wrong
        for sample in reader.take():
            try:
                ticks.append(round(1e3 * convert.decode_low_state(sample.payload).t))
            except WireError:
                wrong += 1
        time.sleep(0.005)

    cpu = timed(seconds, take)
    participant.close()
    return figures(ticks, wrong, cpu)


PARTS = {"sdk": read_with_sdk, "ours": read_with_ours}


def main() -> None:
    """Start twin and readers, and print what they got."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--calls", type=int, default=200)
    parser.add_argument("--part", choices=[*PARTS, "loco"], help="what a process of its own does")
    parser.add_argument("--domain", type=int)
    options = parser.parse_args()
    if options.part == "loco":
        print(json.dumps(call_loco(options.domain, options.calls)))
        return
    if options.part:
        print(json.dumps(PARTS[options.part](options.domain, options.seconds)))
        return
    with free_domain() as domain, TemporaryDirectory() as folder:
        stack = Path(folder) / "vendor_legs.yaml"
        shipped = resources.files("golem").joinpath("stacks/stand.yaml").read_text()
        stack.write_text(shipped.replace("{use: almi}", "{use: vendor}"))
        command = [sys.executable, "-m", "golem", "twin", str(stack), "--world", "open", "--domain", str(domain)]
        twin = subprocess.Popen(command)
        time.sleep(20.0)
        command = [sys.executable, "-m", "tests.interop.vendor_sdk", "--domain", str(domain)]
        command += ["--seconds", str(options.seconds), "--calls", str(options.calls), "--part"]
        try:
            readers = {part: subprocess.Popen([*command, part], stdout=subprocess.PIPE, text=True) for part in PARTS}
            for part, process in readers.items():
                print(part, process.communicate()[0].strip(), flush=True)
            print("loco", subprocess.run([*command, "loco"], capture_output=True, text=True).stdout.strip())
        finally:
            twin.terminate()
            twin.wait(20.0)


if __name__ == "__main__":
    main()
