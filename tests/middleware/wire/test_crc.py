from __future__ import annotations

import numpy as np
import pytest

from golem.middleware.wire import hg
from golem.middleware.wire.hg import REVERSED, crc32


def bitwise(words: bytes) -> int:
    """The definition: polynomial 0x04C11DB7, preset to ones, most significant bit first."""
    crc = 0xFFFFFFFF
    for byte in words:
        for bit in range(7, -1, -1):
            carry = crc >> 31 ^ (byte >> bit & 1)
            crc = crc << 1 & 0xFFFFFFFF ^ (0x04C11DB7 if carry else 0)
    return crc


@pytest.mark.parametrize("size", [0, 4, 8, 200])
def test_it_is_the_crc_it_claims_to_be(size: int) -> None:
    words = np.random.default_rng(size).bytes(size)
    assert crc32(words.translate(REVERSED)) == bitwise(words)


def test_the_check_value_is_that_of_crc_32_mpeg_2() -> None:
    assert crc32(b"123456789".translate(REVERSED)) == 0x0376E6E7


def test_messages_of_the_sdks_defaults_have_its_checksums() -> None:
    command, state = hg.LOW_CMD.blank(), hg.LOW_STATE.blank()
    assert hg.COMMAND_CHECKSUM.of(command) == 0xFE172F9F
    assert hg.STATE_CHECKSUM.of(state) == 0xD64BB04A


def test_padding_does_not_count() -> None:
    command = hg.LOW_CMD.blank()
    state = hg.LOW_STATE.blank()
    # The byte behind the first mode, the three behind the second; the two behind mode_machine.
    for offset in (7, 33, 34, 35):
        command[offset] = 0xFF
    for offset in (14, 15, 75, 129, 130, 131):
        state[offset] = 0xFF
    assert hg.COMMAND_CHECKSUM.of(command) == 0xFE172F9F
    assert hg.STATE_CHECKSUM.of(state) == 0xD64BB04A


def test_every_byte_of_a_field_counts() -> None:
    for layout, checksum in ((hg.LOW_CMD, hg.COMMAND_CHECKSUM), (hg.LOW_STATE, hg.STATE_CHECKSUM)):
        blank = layout.blank()
        good = checksum.of(blank)
        silent = 0
        for offset in range(4, layout.size - 4):
            changed = bytearray(blank)
            changed[offset] ^= 0x40
            silent += checksum.of(changed) == good
        # Padding: one byte behind the first mode, three behind the others, two behind a state's mode_machine.
        assert silent == 1 + 34 * 3 + (2 if layout is hg.LOW_STATE else 0)
