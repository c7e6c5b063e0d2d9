"""The portable part of the e-stop firmware, compiled for this machine: its frames and its button."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem.hardware.estop.serial_board import SIZE, BoardFrame, FrameParser, checksum

FIRMWARE = Path(__file__).resolve().parents[2] / "firmware" / "estop"
RELEASE_SAMPLES = 50
"""The release takes 50 ms of a closed contact [1 ms each]."""

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler (cc)")


class Button(ctypes.Structure):
    """As in button.h."""

    _fields_ = [("closed", ctypes.c_uint8)]  # noqa: RUF012


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """The firmware without its main."""
    built = tmp_path_factory.mktemp("firmware") / "estop.so"
    sources = [str(FIRMWARE / name) for name in ("frame.c", "button.c")]
    subprocess.run(["cc", "-std=gnu99", "-Wall", "-Werror", "-shared", "-fPIC", "-o", built, *sources], check=True)
    library = ctypes.CDLL(str(built))
    library.crc16.restype = ctypes.c_uint16
    library.button_sample.restype = ctypes.c_uint8
    return library


def written(library: ctypes.CDLL, sequence: int, pressed: bool, echo: int) -> bytes:
    """Return the frame that the firmware writes."""
    buffer = (ctypes.c_uint8 * SIZE)()
    library.frame_write(buffer, ctypes.c_uint16(sequence), ctypes.c_uint8(pressed), ctypes.c_uint8(echo))
    return bytes(buffer)


def test_the_host_reads_what_the_firmware_writes(library: ctypes.CDLL) -> None:
    parser = FrameParser()
    for sequence in (0, 1, 255, 256, 0x5AA5, 65535):
        for pressed in (False, True):
            for echo in (0, 0x5A, 0xA5, 255):
                frame = written(library, sequence, pressed, echo)
                assert parser.feed(frame) == [BoardFrame(sequence, pressed, echo)]
    assert parser.skipped == 0


def test_checksums_agree(library: ctypes.CDLL) -> None:
    @given(st.binary(max_size=255))
    def agree(data: bytes) -> None:
        assert library.crc16(data, ctypes.c_uint8(len(data))) == checksum(data)

    agree()


def test_a_button_is_pressed_at_once_and_released_after_fifty_closed_samples(library: ctypes.CDLL) -> None:
    @given(st.lists(st.tuples(st.booleans(), st.integers(1, 120)), max_size=20))
    def follows(contact: list[tuple[bool, int]]) -> None:
        button, closed = Button(0), 0
        for is_closed, samples in contact:
            for _ in range(samples):
                closed = closed + 1 if is_closed else 0
                pressed = library.button_sample(ctypes.byref(button), ctypes.c_uint8(is_closed))
                assert bool(pressed) == (closed < RELEASE_SAMPLES)

    follows()
