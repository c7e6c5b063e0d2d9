"""Mutated payloads into every decoder of the vendor's messages.

    python tests/middleware/wire/fuzz.py --count 100000

prints, for each decoder, how many payloads it took and refused, the time for one, and how far memory grew.
"""

from __future__ import annotations

import argparse
import random
import resource
import sys
import time
import tracemalloc
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[3]))

from tests.middleware.wire import go, random_images, samples

from golem.interfaces import unitree_api
from golem.interfaces.unitree_api import LOCO_APIS
from golem.middleware.wire import api, convert, hg
from golem.middleware.wire.api import ApiRequest, Response
from golem.middleware.wire.hg import Checksum
from golem.middleware.wire.struct_layout import WireError
from golem.robots.unitree.loco_service import CHECK_MODE, RELEASE_MODE, SELECT_MODE, LocoService, MotionSwitcher

WORDS = (b"\0\0\0\0", b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\xc0\x7f", b"\0\0\x80\xff", b"\1\0\0\0")
"""Lengths, NaN and infinity as they stand in a payload."""


@dataclass(frozen=True)
class Target:
    """A decoder, good payloads, and the checksum to set right again after most mutations."""

    decode: Callable[[bytes], object]
    seeds: list[bytes]
    checksum: Checksum | None = None


def answer(payload: bytes) -> object:
    """Decode a request, have both services answer it, and encode the answers: what a twin does with it."""
    request = api.decode_request(payload)
    loco = LocoService(LOCO_APIS["h1"])
    for service in (loco, MotionSwitcher(loco)):
        api.encode_response(service.answer(request, 0.0))
    return request


def text(read: Callable[[str], object]) -> Callable[[bytes], object]:
    """Return a decoder of JSON payloads, which refuses with ValueError."""

    def decode(payload: bytes) -> object:
        try:
            return read(payload.decode(errors="surrogateescape"))
        except ValueError as error:
            raise WireError(str(error)) from error

    return decode


def targets() -> dict[str, Target]:
    """Return every decoder."""
    rng = np.random.default_rng(0)
    loco = LOCO_APIS["h1"]
    calls = [
        ApiRequest(1, loco.set_velocity, '{"velocity": [0.3, 0.0, -0.2], "duration": 1.0}'),
        ApiRequest(2, loco.set_fsm_id, '{"data": 1}', lease=3, priority=4, noreply=True),
        ApiRequest(3, SELECT_MODE, '{"name": "ai"}', binary=bytes(range(40))),
        ApiRequest(4, CHECK_MODE, "{}"),
        ApiRequest(5, RELEASE_MODE),
    ]
    requests = [api.encode_request(call) for call in calls]
    responses = [
        api.encode_response(Response(1, 1001, 0, '{"form": "0", "name": ""}')),
        api.encode_response(Response(2, 3, -7, "", bytes(9))),
    ]
    states = [convert.encode_low_state(samples.state(rng)) for _ in range(4)]
    commands = [convert.encode_low_command(samples.command(rng), 0) for _ in range(4)]
    json = [call.parameter.encode() for call in calls if call.parameter]
    return {
        "LowState_": Target(convert.decode_low_state, states, hg.STATE_CHECKSUM),
        "LowState_, damaged": Target(convert.decode_low_state, states),
        "LowCmd_": Target(lambda p: convert.decode_low_command(p, 0.0), commands, hg.COMMAND_CHECKSUM),
        "LowCmd_, damaged": Target(lambda p: convert.decode_low_command(p, 0.0), commands),
        "mode_machine": Target(convert.mode_machine, states),
        "answered": Target(convert.answered, commands),
        "IMUState_": Target(hg.IMU_STATE.read, [random_images.payload(hg.IMU_STATE, rng) for _ in range(4)]),
        "SportModeState_": Target(
            go.SPORT_MODE_STATE.read, [random_images.payload(go.SPORT_MODE_STATE, rng) for _ in range(4)]
        ),
        "Request_": Target(api.decode_request, requests),
        "Request_, answered": Target(answer, requests),
        "Response_": Target(api.decode_response, responses),
        "JSON object": Target(text(unitree_api.decode), json),
        "JSON integer": Target(text(unitree_api.decode_int), json),
        "JSON velocity": Target(text(unitree_api.decode_velocity), json),
    }


def mutate(payload: bytes, other: bytes, rng: random.Random) -> bytes:
    """Return `payload` with one to four random changes; `other` is a payload to splice in."""
    out = bytearray(payload)
    for _ in range(rng.randint(1, 4)):
        size = len(out)
        at = rng.randrange(size + 1)
        kind = rng.randrange(8)
        if kind == 0 and size:
            out[at % size] ^= 1 << rng.randrange(8)
        elif kind == 1 and size:
            out[at % size] = rng.randrange(256)
        elif kind == 2:
            word = rng.choice(WORDS)
            at -= at % 4
            out[at : at + len(word)] = word
        elif kind == 3:
            del out[at:]
        elif kind == 4:
            out[at:at] = rng.randbytes(rng.choice((1, 2, 4, 64)))
        elif kind == 5:
            del out[at : at + rng.choice((1, 2, 4, 64))]
        elif kind == 6:
            out[at:] = other[at:]
        elif size:
            start = rng.randrange(size)
            out[at:at] = out[start : start + rng.choice((1, 8, 200))] * rng.choice((1, 2, 50))
    return bytes(out)


def payloads(target: Target, count: int, seed: int) -> Iterator[bytes]:
    """Return `count` mutated payloads."""
    rng = random.Random(seed)
    for _ in range(count):
        payload = mutate(rng.choice(target.seeds), rng.choice(target.seeds), rng)
        if target.checksum is not None and len(payload) == len(target.seeds[0]) and rng.random() < 0.9:
            sealed = bytearray(payload)
            target.checksum.seal(sealed)
            payload = bytes(sealed)
        yield payload


def attack(target: Target, count: int, seed: int = 0) -> tuple[int, int]:
    """Return how many of `count` mutated payloads were taken and refused.

    Raises:
        Exception: the decoder raised something else than WireError.
    """
    taken = refused = 0
    for payload in payloads(target, count, seed):
        try:
            with np.errstate(all="raise"):
                target.decode(payload)
            taken += 1
        except WireError:
            refused += 1
        except BaseException:
            print(f"payload: {payload.hex()}", file=sys.stderr)
            raise
    return taken, refused


def peak(target: Target, count: int, seed: int = 1) -> int:
    """Return the most memory that decoding one of `count` mutated payloads took, beyond what was there [B]."""
    maximum = 0
    tracemalloc.start()
    try:
        for payload in payloads(target, count, seed):
            tracemalloc.reset_peak()
            before = tracemalloc.get_traced_memory()[0]
            try:
                target.decode(payload)
            except WireError:
                pass
            maximum = max(maximum, tracemalloc.get_traced_memory()[1] - before)
    finally:
        tracemalloc.stop()
    return maximum


def main() -> None:
    """Attack every decoder from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--count", type=int, default=100_000, help="payloads per decoder")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    print(f"{'decoder':20} {'taken':>8} {'refused':>8} {'us each':>8} {'peak kB':>8} {'grown kB':>9}")
    for name, target in targets().items():
        attack(target, 100)  # what is made once is there now
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        start = time.process_time()
        taken, refused = attack(target, arguments.count, arguments.seed)
        each = (time.process_time() - start) / arguments.count * 1e6
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        print(f"{name:20} {taken:8} {refused:8} {each:8.1f} {peak(target, 500) / 1024:8.1f} {grown:9}", flush=True)


if __name__ == "__main__":
    main()
