from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from tests.hardware.drivers.board_frames import frame_bytes

from golem.hardware.estop.serial_board import SIZE, BoardFrame, FrameParser, checksum

FRAMES = st.lists(st.builds(BoardFrame, st.integers(0, 65535), st.booleans(), st.integers(0, 255)), max_size=20)
SYNC_FREE = st.binary(max_size=30).map(lambda data: data.replace(b"\xa5", b"\x00"))


def test_the_checksum_is_the_published_one() -> None:
    assert checksum(b"123456789") == 0x29B1  # the check value of CRC-16/CCITT-FALSE


def test_a_frame_of_the_firmware_is_read() -> None:
    # As the firmware sent it under simavr: its first frame, after the byte 0x77.
    assert FrameParser().feed(bytes.fromhex("a55a0000c377d2b2")) == [BoardFrame(0, True, 0x77)]
    assert FrameParser().feed(bytes.fromhex("a55a04003c77dc7b")) == [BoardFrame(4, False, 0x77)]


@given(FRAMES, st.lists(st.integers(1, 12), min_size=1, max_size=40))
def test_frames_come_out_however_the_stream_is_cut(frames: list[BoardFrame], cuts: list[int]) -> None:
    data = b"".join(map(frame_bytes, frames))
    parser, seen = FrameParser(), list[BoardFrame]()
    for i in range(len(data)):
        size = cuts[i % len(cuts)]
        seen += parser.feed(data[:size])
        data = data[size:]
    assert seen == frames and parser.skipped == 0


@given(FRAMES, SYNC_FREE)
def test_the_frames_after_garbage_are_found(frames: list[BoardFrame], garbage: bytes) -> None:
    parser = FrameParser()
    data = garbage + b"".join(map(frame_bytes, frames))
    assert parser.feed(data) == frames
    assert parser.skipped == (len(garbage) if frames else max(len(garbage) - SIZE + 1, 0))


@given(st.builds(BoardFrame, st.integers(0, 65535), st.booleans(), st.integers(0, 255)), st.data())
def test_a_frame_with_up_to_three_wrong_bits_is_no_frame(frame: BoardFrame, data: st.DataObject) -> None:
    bits = data.draw(st.sets(st.integers(0, 8 * SIZE - 1), min_size=1, max_size=3))
    spoiled = bytearray(frame_bytes(frame))
    for bit in bits:
        spoiled[bit // 8] ^= 1 << bit % 8
    assert FrameParser().feed(bytes(spoiled)) == []


@given(FRAMES.filter(bool), st.binary(min_size=1, max_size=7))
def test_a_cut_frame_costs_itself_alone(frames: list[BoardFrame], _: bytes) -> None:
    cut = frame_bytes(BoardFrame(7, False, 9))[:5]
    assert FrameParser().feed(cut + b"".join(map(frame_bytes, frames))) == frames


@given(st.binary(max_size=300))
def test_nothing_is_kept_of_bytes_that_cannot_begin_a_frame_any_more(data: bytes) -> None:
    parser = FrameParser()
    frames = parser.feed(data)
    assert len(data) - SIZE < parser.skipped + SIZE * len(frames) <= len(data)
