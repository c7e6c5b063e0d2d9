"""The same two sides as `loop`, by the vendor's own classes: a script that needs unitree_sdk2py, and not GOLEM.

It runs in any Python that can import the SDK, so it imports nothing else. The SDK has no checks to leave out: states
go without checksum, as in the vendor's simulator, commands with it, as in its examples. States of number 0 come before
those that are measured, as there.
"""

# pyright: reportMissingImports=false

import argparse
import json
import sys
import time

from unitree_sdk2py.core.channel import ChannelFactoryInitialize, ChannelPublisher, ChannelSubscriber
from unitree_sdk2py.idl.default import unitree_hg_msg_dds__LowCmd_, unitree_hg_msg_dds__LowState_
from unitree_sdk2py.idl.unitree_hg.msg.dds_ import LowCmd_, LowState_
from unitree_sdk2py.utils.crc import CRC

PERIOD_NS = 2_000_000


def main() -> None:
    """Run the side that the arguments name."""
    parser = argparse.ArgumentParser()
    parser.add_argument("side", choices=("robot", "controller"))
    parser.add_argument("--domain", type=int, required=True)
    parser.add_argument("--interface", required=True)
    parser.add_argument("--seconds", type=float, required=True)
    arguments = parser.parse_args()
    ChannelFactoryInitialize(arguments.domain, arguments.interface)
    result = robot(arguments.seconds) if arguments.side == "robot" else controller()
    print(json.dumps(result), flush=True)


def robot(seconds: float) -> dict:
    """Write states at 500 Hz; return when each began to be encoded, and which commands came."""
    answered: list = []
    publisher = ChannelPublisher("rt/lowstate", LowState_)
    publisher.Init()
    subscriber = ChannelSubscriber("rt/lowcmd", LowCmd_)
    subscriber.Init(lambda command: answered.append(command.reserve[0]), 10)
    state = unitree_hg_msg_dds__LowState_()
    end = time.monotonic() + 20.0
    while not answered and time.monotonic() < end:
        publisher.Write(state)
        time.sleep(0.02)
    count = int(seconds * 1e9 / PERIOD_NS)
    began = []
    cpu, start = time.process_time(), time.monotonic_ns()
    for i in range(count):
        time.sleep(max(0, start + i * PERIOD_NS - time.monotonic_ns()) * 1e-9)
        began.append(time.monotonic_ns())
        state.tick = i + 1
        publisher.Write(state)
    spent, wall = time.process_time() - cpu, (time.monotonic_ns() - start) * 1e-9
    time.sleep(0.5)
    return {"began": began, "answered": answered, "cpu": spent, "wall": wall, "images": {}}


def controller() -> dict:
    """Read and answer every state until standard input ends.

    Returns when each had been decoded [ns], and how long that was after it was written [us].
    """
    came = []
    command, crc = unitree_hg_msg_dds__LowCmd_(), CRC()
    publisher = ChannelPublisher("rt/lowcmd", LowCmd_)
    publisher.Init()

    def on_state(state: LowState_) -> None:
        way = (time.time() - state.sample_info.source_timestamp * 1e-9) * 1e6
        came.append((state.tick, time.monotonic_ns(), way))
        command.reserve[0] = state.tick
        command.crc = crc.Crc(command)
        publisher.Write(command)

    subscriber = ChannelSubscriber("rt/lowstate", LowState_)
    subscriber.Init(on_state, 10)
    print("ready", flush=True)
    sys.stdin.readline()
    cpu = time.process_time()
    sys.stdin.read()
    return {"came": came, "cpu": time.process_time() - cpu}


if __name__ == "__main__":
    main()
