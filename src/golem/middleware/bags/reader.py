"""Reads bags: those of `BagWriter`, of rosbag2 and of others, finished or not."""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import IO, cast

from golem.errors import OutputError, needs
from golem.middleware.bags.base import BagError, BagMessage, BagTopic
from golem.middleware.bags.metadata import Contents, parse_qos
from golem.middleware.bags.writer import CUSTOM, BagConfig, McapFile, write_metadata

with needs("", "record"):
    from mcap.exceptions import McapError
    from mcap.reader import SeekingReader
    from mcap.records import Channel, Chunk, McapRecord, Metadata, Schema
    from mcap.records import Message as Record
    from mcap.stream_reader import StreamReader, breakup_chunk
    from zstandard import ZstdError

MAGIC = b"\x89MCAP0\r\n"
CDR = "cdr"
BELOW, LISTED = ("*/*.mcap", "*/*/*.mcap"), 5
"""Where bags are looked for whose folder was not given, and how many are named at most."""
KIND = re.compile(r"\w+/(msg|srv|action)/\w+")
CONVERT = "`rosbags-convert --src {path} --dst FOLDER --dst-storage mcap` turns it into one"
OTHERS = {
    b"#ROSBAG V": f"is a bag of ROS 1, not an MCAP file; {CONVERT}",
    b"SQLite format 3": f"is a bag in SQLite, not an MCAP file; {CONVERT}",
    b"version https://git-lfs": "is a pointer of Git LFS, not the bag itself; `git lfs pull` fetches that",
}
"""What a file that begins so is."""
FRAME = struct.Struct("<BQ")
"""What precedes a record's content: opcode and length."""
END = 2**63
"""After every log time [ns]."""
DAMAGE = (McapError, ZstdError, struct.error, ValueError, LookupError, OverflowError, RuntimeError, MemoryError)
"""What the libraries raise on bytes that are no MCAP."""


class Bag:
    """One bag, open for reading.

    Attributes:
        path: its folder, or its only file.
        topics: every topic of ROS 2, by name.
        foreign: what cannot be played, by the name of its topic, and why.
        custom: what else its writer said about it.
    """

    def __init__(self, path: Path) -> None:
        """Look through the bag at `path`, a folder or an MCAP file. Raises BagError: it is absent or damaged."""
        self.path = path
        self.files = [BagFile(file) for file in _files(path)]
        self.topics = {topic.name: topic for file in self.files for topic in file.topics}
        self.foreign = {name: why for file in self.files for name, why in file.foreign.items()}
        self.custom = {key: value for file in self.files for key, value in file.custom.items()}

    @property
    def finished(self) -> bool:
        """Whether its writer completed it; else it ends with the last chunk that is whole."""
        return all(file.finished for file in self.files)

    def messages(self, topics: Collection[str] | None = None, start: int = 0, end: int = END) -> Iterator[BagMessage]:
        """Iterate over the messages in the order of their log times.

        A file without an index, e.g. one that was not finished, is read in the order in which it was written.

        Args:
            topics: names of those to read; default: all.
            start, end: log times of the first, and of the first that is left out [ns].

        Raises:
            BagError: the bag is damaged here.
        """
        for file in self.files:
            yield from file.messages(topics, start, end)


class BagFile:
    """One MCAP file of a bag; `finished` if its writer completed it; see `Bag`."""

    def __init__(self, path: Path) -> None:
        """Look through it; errors as for `Bag`."""
        self.path = path
        self.custom: dict[str, str] = {}
        self.foreign: dict[str, str] = {}
        self._channels: dict[int, BagTopic] = {}
        with self._open() as file:
            self.finished, self._end = _extent(path, file)
            self._indexed = self.finished and self._read_summary(file)
            if not self._indexed:
                for _ in self._scan(file):
                    pass

    @property
    def topics(self) -> list[BagTopic]:
        """Its topics."""
        return list(self._channels.values())

    def messages(self, topics: Collection[str] | None = None, start: int = 0, end: int = END) -> Iterator[BagMessage]:
        with self._open() as file:
            if not self._indexed:
                scanned = (m for m in self._scan(file) if topics is None or m.topic.name in topics)
                yield from (m for m in scanned if start <= m.log_time < end)
                return
            reader = SeekingReader(file, validate_crcs=True)
            for _, channel, record in reader.iter_messages(topics, starting_at=start, ending_before=end):
                if channel.id in self._channels:
                    yield _message(self._channels[channel.id], record)

    @contextmanager
    def _open(self) -> Iterator[IO[bytes]]:
        try:
            # A map clamps every read to the file: a damaged length cannot ask for memory.
            with self.path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as view:
                yield cast(IO[bytes], view)
        except OSError as error:
            raise BagError(f"Cannot read {self.path}: {error.strerror}.") from error
        except DAMAGE as error:
            raise BagError(f"{self.path} is damaged: {str(error) or type(error).__name__}.") from error

    def _read_summary(self, file: IO[bytes]) -> bool:
        """Take the topics from the summary; return whether there is one that leads to the messages."""
        file.seek(0)
        reader = SeekingReader(file)
        summary = reader.get_summary()
        if summary is None or not summary.chunk_indexes:
            return False
        for channel in summary.channels.values():
            self._add(channel, summary.schemas.get(channel.schema_id))
        for metadata in reader.iter_metadata():
            self._take_metadata(metadata)
        return True

    def _scan(self, file: IO[bytes]) -> Iterator[BagMessage]:
        """Read every record from the beginning to the end of the last whole one."""
        schemas: dict[int, Schema] = {}
        for record in _records(file, self._end):
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                self._add(record, schemas.get(record.schema_id))
            elif isinstance(record, Metadata):
                self._take_metadata(record)
            elif isinstance(record, Record) and record.channel_id in self._channels:
                yield _message(self._channels[record.channel_id], record)

    def _add(self, channel: Channel, schema: Schema | None) -> None:
        why = ""
        if channel.message_encoding != CDR:
            why = f"its messages are '{channel.message_encoding}', not '{CDR}'"
        elif schema is None or not KIND.fullmatch(schema.name):
            why = f"its type is '{'' if schema is None else schema.name}', not of the form package/msg/Name"
        if why:
            self.foreign[channel.topic] = why
        else:
            assert schema is not None
            self._channels[channel.id] = _topic(channel, schema)

    def _take_metadata(self, metadata: Metadata) -> None:
        if metadata.name == CUSTOM:
            self.custom.update(metadata.metadata)


def repair(folder: Path) -> list[Path]:
    """Finish the files of the bag in `folder` that its writer did not, write its table of contents; return the files.

    Such a file is replaced by a copy of its whole chunks, which needs as much space on the disk.

    Raises:
        BagError: there is no such folder, or the bag is damaged.
        OutputError: it cannot be written.
    """
    if not folder.is_dir():
        raise BagError(f"{folder} is no folder; the parts of a bag are in one.")
    bag = Bag(folder)
    if bag.foreign:
        raise BagError(f"{folder} holds more than messages of ROS 2, which a repair would lose: {told(bag)}.")
    files: dict[str, Contents] = {}
    repaired: list[Path] = []
    try:
        for file in bag.files:
            contents = files[file.path.name] = Contents()
            if file.finished:
                for message in file.messages():
                    contents.add(message.topic, message.log_time)
                continue
            part = file.path.with_name(file.path.name + ".part")
            part.unlink(missing_ok=True)
            copy = McapFile(part, BagConfig(), contents, file.custom)
            for message in file.messages():
                copy.write(message)
            copy.finish(file.path.name)
            os.replace(part, file.path)
            repaired.append(file.path)
        write_metadata(folder, files, bag.custom)
    except OSError as error:
        raise OutputError(f"Cannot repair {folder}: {error.strerror}.") from error
    return repaired


def told(bag: Bag) -> str:
    """Return which topics cannot be played, and why."""
    return "; ".join(f"{name}: {why}" for name, why in sorted(bag.foreign.items()))


def _files(path: Path) -> list[Path]:
    """Return the files of a bag in the order in which they were written."""
    if path.is_file():
        return [path]
    found = sorted(path.glob("*.mcap"), key=lambda p: [int(n) for n in re.findall(r"\d+", p.stem)[-1:]])
    if not found:
        other = next(iter([*path.glob("*.db3"), *path.glob("*.bag")]), None)
        if other is not None:
            return [other]
        below = ", ".join(map(str, sorted({b.parent for d in BELOW for b in path.glob(d)})[-LISTED:]))
        ways = f"one of {below}" if below else "an MCAP file, or the folder that holds its *.mcap files"
        raise BagError(f"No bag at {path}; give {ways}.")
    # The disk was full, or the power gone, before one that was just begun got its first bytes.
    return [file for file in found if file.stat().st_size] or found


def _extent(path: Path, file: IO[bytes]) -> tuple[bool, int]:
    """Return whether a file is finished, and where its last whole record ends."""
    file.seek(0, os.SEEK_END)
    size = file.tell()
    file.seek(0)
    head = file.read(32)
    if not head.startswith(MAGIC):
        is_ = next((what for start, what in OTHERS.items() if head.startswith(start)), "is no MCAP file")
        raise BagError(f"{path} {is_.format(path=path)}.")
    file.seek(max(0, size - len(MAGIC)))
    if size > 2 * len(MAGIC) and file.read(len(MAGIC)) == MAGIC:
        return True, size
    end = len(MAGIC)
    while end + FRAME.size <= size:
        file.seek(end)
        length = FRAME.size + FRAME.unpack(file.read(FRAME.size))[1]
        if end + length > size:
            break
        end += length
    return False, end


def _records(file: IO[bytes], end: int) -> Iterator[McapRecord]:
    """Yield the records of a file, those in chunks included, up to byte `end`."""
    if end == len(MAGIC):
        return
    file.seek(len(MAGIC))
    reader = StreamReader(file, skip_magic=True, emit_chunks=True, record_size_limit=end)
    for record in reader.records:
        if isinstance(record, Chunk):
            yield from breakup_chunk(record, validate_crc=True)
        else:
            yield record
        if file.tell() >= end:
            return


def _topic(channel: Channel, schema: Schema) -> BagTopic:
    about, definition = channel.metadata, schema.data.decode()
    qos = parse_qos(about.get("offered_qos_profiles", ""))
    return BagTopic(channel.topic, schema.name, definition, qos, about.get("topic_type_hash", ""))


def _message(topic: BagTopic, record: Record) -> BagMessage:
    return BagMessage(topic, record.log_time, record.publish_time, record.data)
