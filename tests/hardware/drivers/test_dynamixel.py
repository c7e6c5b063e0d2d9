from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from golem.hardware.drivers.dynamixel import StatusPacket, StatusParser, read_packet, sync_write_packet

PACKETS = st.lists(
    st.builds(StatusPacket, st.integers(0, 253), st.integers(0, 127), st.binary(max_size=14)), max_size=10
)


def status_bytes(packet: StatusPacket) -> bytes:
    body = bytes((packet.id, len(packet.parameters) + 2, packet.error)) + packet.parameters
    return b"\xff\xff" + body + bytes((255 - sum(body) % 256,))


def test_instructions_are_those_of_the_manual() -> None:
    assert read_packet(1, 43, 1).hex(" ") == "ff ff 01 04 02 2b 01 cc"
    values = {
        i: bytes.fromhex(data) for i, data in enumerate(("10 00 50 01", "20 02 60 03", "30 00 70 01", "20 02 80 03"))
    }
    assert sync_write_packet(30, values).hex(" ") == (
        "ff ff fe 18 83 1e 04 00 10 00 50 01 01 20 02 60 03 02 30 00 70 01 03 20 02 80 03 12"
    )


def test_a_status_of_the_manual_is_read() -> None:
    (packet,) = StatusParser().feed(bytes.fromhex("ff ff 01 03 00 20 db"))
    assert packet == StatusPacket(1, 0, b"\x20") and packet.trouble == ""
    assert StatusPacket(1, 0x24, b"").trouble == "overheated, overload"


@given(PACKETS, st.lists(st.integers(1, 9), min_size=1, max_size=20))
def test_packets_come_out_however_the_stream_is_cut(packets: list[StatusPacket], cuts: list[int]) -> None:
    data = b"".join(map(status_bytes, packets))
    parser, seen, i = StatusParser(), list[StatusPacket](), 0
    while data:
        seen += parser.feed(data[: cuts[i % len(cuts)]])
        data, i = data[cuts[i % len(cuts)] :], i + 1
    assert seen == packets and parser.skipped == 0


@given(PACKETS.filter(bool), st.binary(max_size=40).map(lambda data: data.replace(b"\xff", b"\x00")))
def test_the_packets_after_garbage_are_found(packets: list[StatusPacket], garbage: bytes) -> None:
    parser = StatusParser()
    assert parser.feed(garbage + b"".join(map(status_bytes, packets))) == packets
    assert parser.skipped == len(garbage)


@given(st.builds(StatusPacket, st.integers(1, 2), st.just(0), st.binary(min_size=8, max_size=8)), st.data())
def test_no_single_wrong_bit_makes_another_packet(packet: StatusPacket, data: st.DataObject) -> None:
    sound = status_bytes(packet)
    bit = data.draw(st.integers(0, 8 * len(sound) - 1))
    spoiled = (int.from_bytes(sound, "little") ^ 1 << bit).to_bytes(len(sound), "little")
    assert all(found.id not in (1, 2) or len(found.parameters) != 8 for found in StatusParser().feed(spoiled))


@given(st.lists(st.binary(max_size=60), max_size=10))
def test_a_parser_keeps_less_than_one_packet(chunks: list[bytes]) -> None:
    parser = StatusParser()
    for chunk in chunks:
        parser.feed(chunk)
    assert len(parser._rest) < 56
