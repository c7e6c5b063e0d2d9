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

from golem.errors import OutputError
from golem.middleware.bags.base import BagError, BagMessage, BagTopic, missing
from golem.middleware.bags.metadata import Contents, parse_qos
from golem.middleware.bags.writer import CUSTOM, BagConfig, McapFile, write_metadata

try:
    from mcap.exceptions import McapError
    from mcap.reader import SeekingReader
    from mcap.records import Channel, Chunk, McapRecord, Metadata, Schema
    from mcap.records import Message as Record
    from mcap.stream_reader import StreamReader, breakup_chunk
    from zstandard import ZstdError
except ModuleNotFoundError as error:
    raise missing(error) from error

MAGIC = b"\x89MCAP0\r\n"
FRAME = struct.Struct("<BQ")
"""What precedes a record's content: opcode and length."""
DAMAGE = (
    McapError,
    ZstdError,
    struct.error,
    ValueError,
    LookupError,
    OverflowError,
    RuntimeError,
    MemoryError,
)
"""What the libraries raise on bytes that are no MCAP."""


class Bag:
    """One bag, open for reading.

    Attributes:
        path: its folder, or its only file.
        topics: every topic, by name.
        custom: what else its writer said about it.
    """

    def __init__(self, path: Path) -> None:
        """Look through the bag at `path`, a folder or an MCAP file.

        Raises:
            BagError: there is none, or it is damaged.
        """
        self.path = path
        self.files = [BagFile(file) for file in _files(path)]
        self.topics = {topic.name: topic for file in self.files for topic in file.topics}
        self.custom = {key: value for file in self.files for key, value in file.custom.items()}

    @property
    def finished(self) -> bool:
        """Whether its writer completed it; else it ends with the last chunk that is whole."""
        return all(file.finished for file in self.files)

    def messages(self, topics: Collection[str] | None = None) -> Iterator[BagMessage]:
        """Iterate over the messages in the order of their log times.

        A file without an index, e.g. one that was not finished, is read in the order in which it was written.

        Args:
            topics: names of those to read; default: all.

        Raises:
            BagError: the bag is damaged here.
        """
        for file in self.files:
            yield from file.messages(topics)


class BagFile:
    """One MCAP file of a bag.

    Attributes:
        path: where it is.
        finished: whether its writer completed it.
        custom: what its writer said about the bag.
    """

    def __init__(self, path: Path) -> None:
        """Look through it; errors as for `Bag`."""
        self.path = path
        self.custom: dict[str, str] = {}
        self._channels: dict[int, BagTopic] = {}
        with self._open() as file:
            self.finished, self._end = _extent(file)
            self._indexed = self.finished and self._read_summary(file)
            if not self._indexed:
                for _ in self._scan(file):
                    pass

    @property
    def topics(self) -> list[BagTopic]:
        """Its topics."""
        return list(self._channels.values())

    def messages(self, topics: Collection[str] | None = None) -> Iterator[BagMessage]:
        """Iterate over its messages; see `Bag`."""
        with self._open() as file:
            if not self._indexed:
                yield from (m for m in self._scan(file) if topics is None or m.topic.name in topics)
                return
            for _, channel, record in SeekingReader(file, validate_crcs=True).iter_messages(topics):
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
            self._channels[channel.id] = _topic(channel, summary.schemas.get(channel.schema_id))
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
                self._channels[record.id] = _topic(record, schemas.get(record.schema_id))
            elif isinstance(record, Metadata):
                self._take_metadata(record)
            elif isinstance(record, Record):
                yield _message(self._channels[record.channel_id], record)

    def _take_metadata(self, metadata: Metadata) -> None:
        if metadata.name == CUSTOM:
            self.custom.update(metadata.metadata)


def repair(folder: Path) -> list[Path]:
    """Finish every file of the bag in `folder` that its writer did not, and write the table of contents.

    Such a file is replaced by a copy of its whole chunks, which needs as much space on the disk.

    Returns:
        The files that were finished.

    Raises:
        BagError: there is no such folder, or the bag is damaged.
        OutputError: it cannot be written.
    """
    if not folder.is_dir():
        raise BagError(f"{folder} is no folder; the parts of a bag are in one.")
    bag = Bag(folder)
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


def _files(path: Path) -> list[Path]:
    """Return the files of a bag in the order in which they were written."""
    if path.is_file():
        return [path]
    found = sorted(path.glob("*.mcap"), key=lambda p: [int(n) for n in re.findall(r"\d+", p.stem)[-1:]])
    if not found:
        raise BagError(f"No bag at {path}; give an MCAP file, or the folder that holds its *.mcap files.")
    return found


def _extent(file: IO[bytes]) -> tuple[bool, int]:
    """Return whether a file is finished, and where its last whole record ends."""
    file.seek(0, os.SEEK_END)
    size = file.tell()
    file.seek(0)
    if file.read(len(MAGIC)) != MAGIC:
        raise McapError("it is no MCAP file")
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


def _topic(channel: Channel, schema: Schema | None) -> BagTopic:
    return BagTopic(
        channel.topic,
        "" if schema is None else schema.name,
        "" if schema is None else schema.data.decode(),
        parse_qos(channel.metadata.get("offered_qos_profiles", "")),
        channel.metadata.get("topic_type_hash", ""),
    )


def _message(topic: BagTopic, record: Record) -> BagMessage:
    return BagMessage(topic, record.log_time, record.publish_time, record.data)
