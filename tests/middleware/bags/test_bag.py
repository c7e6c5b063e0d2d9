from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

pytest.importorskip("mcap")
pytest.importorskip("rosbags")

import numpy as np
import yaml
from rosbags.rosbag2 import Reader as RosbagsReader
from rosbags.typesys import Stores, get_typestore

from golem.errors import ConfigError, MissingExtra, OutputError
from golem.middleware.bags.base import BagError, BagMessage, BagTopic
from golem.middleware.bags.metadata import offered_qos, parse_qos
from golem.middleware.bags.reader import Bag, repair
from golem.middleware.bags.writer import BagConfig, BagWriter
from golem.middleware.dds.base import DEFAULT, LATCHED, SENSOR, Qos

STORE = get_typestore(Stores.ROS2_HUMBLE)


def topic(name: str, kind: str, qos: Qos = DEFAULT) -> BagTopic:
    return BagTopic(name, kind, STORE.generate_msgdef(kind, ros_version=2)[0], qos, STORE.hash_rihs01(kind))


WORDS = topic("/words", "std_msgs/msg/String")
NUMBERS = topic("/numbers", "std_msgs/msg/UInt8MultiArray", SENSOR)


def words(i: int) -> BagMessage:
    text = STORE.types["std_msgs/msg/String"](f"word {i}")
    return BagMessage(WORDS, i * 1000, i * 1000 + 7, bytes(STORE.serialize_cdr(text, WORDS.kind)))


def numbers(i: int, n: int = 300) -> BagMessage:
    layout = STORE.types["std_msgs/msg/MultiArrayLayout"]([], 0)
    data = np.random.default_rng(i).integers(0, 255, n, dtype=np.uint8)
    array = STORE.types["std_msgs/msg/UInt8MultiArray"](layout, data)
    return BagMessage(NUMBERS, i * 1000 + 500, i * 1000, memoryview(STORE.serialize_cdr(array, NUMBERS.kind)))


def write(folder: Path, n: int, config: BagConfig | None = None) -> list[BagMessage]:
    """Write n messages of either kind and finish the bag."""
    sent = [m for i in range(n) for m in (words(i), numbers(i))]
    writer = BagWriter(folder, config, {"robot": "H1-2"})
    for message in sent:
        writer.write(message)
    writer.close()
    return sent


def same(read: list[BagMessage], sent: list[BagMessage]) -> bool:
    def plain(messages: list[BagMessage]) -> list[tuple[object, ...]]:
        return [(m.topic, m.log_time, m.publish_time, bytes(m.payload)) for m in messages]

    return plain(read) == plain(sent)


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
def test_a_bag_is_read_as_it_was_written(tmp_path: Path, compression: str) -> None:
    sent = write(tmp_path / "bag", 40, BagConfig(compression=compression, chunk=4000))  # pyright: ignore[reportArgumentType]
    bag = Bag(tmp_path / "bag")
    assert bag.finished
    assert bag.topics == {"/words": WORDS, "/numbers": NUMBERS}
    assert bag.custom == {"robot": "H1-2"}
    assert same(list(bag.messages()), sent)
    assert same(list(bag.messages(["/words"])), [m for m in sent if m.topic is WORDS])


def test_other_software_reads_it(tmp_path: Path) -> None:
    """The official MCAP reader decodes every message; rosbags, an independent rosbag2 reader, takes the metadata."""
    reader = pytest.importorskip("mcap.reader")
    ros2 = pytest.importorskip("mcap_ros2.decoder")
    sent = write(tmp_path / "bag", 25, BagConfig(chunk=3000, split=9000))
    texts, sizes = [], []
    for path in sorted((tmp_path / "bag").glob("*.mcap")):
        with path.open("rb") as file:
            decoded = reader.make_reader(file, True, [ros2.DecoderFactory()]).iter_decoded_messages()
            for _, channel, _, message in decoded:
                texts.append(message.data) if channel.topic == "/words" else sizes.append(len(message.data))
    assert texts == [f"word {i}" for i in range(25)]
    assert sizes == [300] * 25
    with RosbagsReader(tmp_path / "bag") as bag:
        assert [(c.topic, t, bytes(data)) for c, t, data in bag.messages()] == [
            (m.topic.name, m.log_time, bytes(m.payload)) for m in sent
        ]
        assert bag.message_count == 50 and bag.start_time == 0 and bag.end_time == 24_501
        kinds = {c.topic: (c.msgtype, c.digest, c.msgcount) for c in bag.connections}
    assert kinds["/words"] == ("std_msgs/msg/String", WORDS.type_hash, 25)


def test_metadata_has_what_rosbag2_asks_for(tmp_path: Path) -> None:
    """The keys that rosbag2's yaml.hpp reads without a default, at version 8; the copy inside the file is equal."""
    from mcap.reader import make_reader

    write(tmp_path / "bag", 3)
    about = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert about["version"] == 8 and about["storage_identifier"] == "mcap"
    assert about["duration"] == {"nanoseconds": 2500} and about["message_count"] == 6
    assert about["relative_file_paths"] == ["bag_0.mcap"] == [f["path"] for f in about["files"]]
    metadata = about["topics_with_message_count"][0]["topic_metadata"]
    assert metadata["name"] == "/words" and metadata["type_description_hash"].startswith("RIHS01_")
    assert yaml.safe_load(metadata["offered_qos_profiles"])[0]["reliability"] == 1
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as file:
        inside = {m.name: m.metadata for m in make_reader(file).iter_metadata()}
    assert yaml.safe_load(inside["rosbag2"]["serialized_metadata"]) == about


@pytest.mark.parametrize("qos", [DEFAULT, SENSOR, LATCHED, Qos(depth=None)])
def test_qos_returns(qos: Qos) -> None:
    assert parse_qos(offered_qos(qos)) == qos


def test_qos_of_newer_rosbag2_is_read() -> None:
    text = "- history: keep_last\n  depth: 5\n  reliability: best_effort\n  durability: volatile\n"
    assert parse_qos(text) == SENSOR
    assert parse_qos("nonsense") == parse_qos("") == parse_qos("[1]") == DEFAULT


def test_split_files_follow_each_other(tmp_path: Path) -> None:
    sent = write(tmp_path / "bag", 200, BagConfig(chunk=1000, split=6000))
    assert len(list((tmp_path / "bag").glob("*.mcap"))) > 10  # so that names sort by number, not by letter
    assert same(list(Bag(tmp_path / "bag").messages()), sent)


def test_an_unfinished_bag_is_read_up_to_its_last_chunk(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "bag", BagConfig(chunk=2000), {"robot": "H1-2"})
    sent = [m for i in range(20) for m in (words(i), numbers(i))]
    for message in sent:
        writer.write(message)
    writer.flush()
    writer.write(words(99))  # still in memory
    bag = Bag(tmp_path / "bag")
    assert not bag.finished and bag.custom == {"robot": "H1-2"}
    assert same(list(bag.messages()), sent)
    whole = (tmp_path / "bag" / "bag_0.mcap").read_bytes()
    for cut in range(0, len(whole), 97):
        (tmp_path / "cut.mcap").write_bytes(whole[:cut])
        if cut < 8:
            with pytest.raises(BagError):
                Bag(tmp_path / "cut.mcap")
            continue
        read = list(Bag(tmp_path / "cut.mcap").messages())
        assert same(read, sent[: len(read)])


def test_an_unfinished_bag_can_be_repaired(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "bag", BagConfig(chunk=1000, split=5000), {"robot": "H1-2"})
    sent = [m for i in range(20) for m in (words(i), numbers(i))]
    for message in sent:
        writer.write(message)
    writer.flush()
    (tmp_path / "bag" / "metadata.yaml").unlink()
    last = sorted((tmp_path / "bag").glob("*.mcap"))[-1]
    assert repair(tmp_path / "bag") == [last]
    assert repair(tmp_path / "bag") == []
    bag = Bag(tmp_path / "bag")
    assert bag.finished and bag.custom == {"robot": "H1-2"} and same(list(bag.messages()), sent)
    with RosbagsReader(tmp_path / "bag") as other:
        assert other.message_count == 40


def test_a_full_disk_is_named_and_what_was_written_is_kept(tmp_path: Path) -> None:
    """The limit on the size of files stands for a full disk: the same error, in the middle of a chunk."""
    resource = pytest.importorskip("resource")
    writer = BagWriter(tmp_path / "bag", BagConfig(chunk=2000))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    sent = [numbers(i) for i in range(100)]
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))
    try:
        with pytest.raises(OutputError, match="Cannot write the bag .*: File too large"):
            for message in sent:
                writer.write(message)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    writer.close()
    with pytest.raises(OutputError, match="is closed"):
        writer.write(sent[0])
    bag = Bag(tmp_path / "bag")
    read = list(bag.messages())
    assert not bag.finished and len(read) > 10 and same(read, sent[: len(read)])


def test_an_empty_bag_is_a_bag(tmp_path: Path) -> None:
    write(tmp_path / "bag", 0)
    bag = Bag(tmp_path / "bag")
    assert bag.finished and not bag.topics and not list(bag.messages())


def test_a_file_that_got_nothing_leaves_the_others_readable(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    sent = write(folder, 3)
    (folder / "bag_1.mcap").touch()
    assert same(list(Bag(folder).messages()), sent)
    assert repair(folder) == [] and same(list(Bag(folder).messages()), sent)


def test_damage_is_named(tmp_path: Path) -> None:
    """Whatever happens to the bytes: a bag, perhaps with fewer messages, or a BagError."""
    write(tmp_path / "bag", 10, BagConfig(chunk=2000, compression="zstd"))
    whole = (tmp_path / "bag" / "bag_0.mcap").read_bytes()
    rng = np.random.default_rng(0)
    file, errors = tmp_path / "damaged.mcap", 0
    for _ in range(300):
        damaged = bytearray(whole)
        for place in rng.integers(0, len(whole), 3):
            damaged[place] = rng.integers(256)
        file.write_bytes(damaged)
        try:
            list(Bag(file).messages())
        except BagError:
            errors += 1
    assert 50 < errors < 300


def test_what_a_user_can_do_wrong(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    with pytest.raises(OutputError, match="exists already"):
        BagWriter(tmp_path / "bag")
    with pytest.raises(BagError, match="No bag at .*give an MCAP file"):
        Bag(tmp_path / "bag")
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "one.mcap").touch()
    with pytest.raises(BagError, match=f"give one of {tmp_path / 'below'}"):
        Bag(tmp_path)
    (tmp_path / "text").write_text("this is text")
    with pytest.raises(BagError, match="no MCAP file"):
        Bag(tmp_path / "text")
    with pytest.raises(BagError, match="is no folder"):
        repair(tmp_path / "text")
    with pytest.raises(OutputError, match="Cannot create"):
        BagWriter(tmp_path / "text" / "bag")
    with pytest.raises(ConfigError, match="at least one chunk"):
        BagConfig(chunk=10, split=5)
    writer = BagWriter(tmp_path / "closed")
    writer.close()
    writer.close()
    with pytest.raises(OutputError, match="is closed"):
        writer.write(words(0))


@pytest.mark.parametrize(
    ("module", "absent", "extra"),
    [
        ("writer", "mcap.writer", "record"),
        ("reader", "mcap.reader", "record"),
        ("foxglove_server", "foxglove", "foxglove"),
    ],
)
def test_a_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch, module: str, absent: str, extra: str) -> None:
    name = f"golem.middleware.bags.{module}"
    monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setitem(sys.modules, absent, None)
    with pytest.raises(MissingExtra, match=rf"golem-humanoid\[{extra}\]"):
        importlib.import_module(name)
