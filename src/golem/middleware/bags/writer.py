"""Writes bags: a folder of MCAP files and rosbag2's metadata.yaml.

A file is a sequence of chunks. One that was begun but never finished, because its process was killed, holds every chunk
that was written: `Bag` reads it up to there, and `repair` finishes it.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Literal

from golem.errors import ConfigError, OutputError, needs
from golem.middleware.bags.base import BagMessage, BagTopic
from golem.middleware.bags.metadata import Contents, dump, information, offered_qos
from golem.middleware.ros.message import NANO

with needs("", "record"):
    from mcap.writer import CompressionType, Writer

METADATA = "metadata.yaml"
CUSTOM = "golem"
"""Name of the MCAP metadata record with what else the writer says about a bag."""
JUMP = NANO
"""Step back in time that begins a new file [ns] [own]: a simulation was restarted. In a file messages are read in the
order of their log times, files one after the other."""
Compression = Literal["none", "lz4", "zstd"]


@dataclass(frozen=True)
class BagConfig:
    """How a bag is written.

    Attributes:
        compression: of the chunks: none, lz4 or zstd.
        chunk: bytes that are collected in memory before they are written.
        split: bytes after which the next file is begun; it bounds the index that a file's writer holds in memory.
    """

    compression: Compression = "none"
    chunk: int = 2**20
    split: int = 2**31

    def __post_init__(self) -> None:
        if self.chunk < 1 or self.split < self.chunk:
            raise ConfigError(
                f"A bag of chunks of {self.chunk} bytes cannot be split every {self.split}; "
                "chunks have at least one byte, files at least one chunk."
            )


class BagWriter:
    """Writes one bag; see `Sink`."""

    def __init__(self, folder: Path, config: BagConfig | None = None, custom: Mapping[str, str] | None = None) -> None:
        """Create `folder`, with `custom` in the bag's metadata. Raises OutputError: it exists, or cannot be created."""
        self.folder = folder
        self._config = config or BagConfig()
        self._custom = dict(custom or {})
        self._files: dict[str, Contents] = {}
        self._file: McapFile | None = None
        self._newest = 0
        self._closed = False
        try:
            folder.mkdir(parents=True)
        except FileExistsError as error:
            raise OutputError(f"The bag {folder} exists already; give another name.") from error
        except OSError as error:
            raise OutputError(f"Cannot create the bag {folder}: {error.strerror}.") from error

    @property
    def messages(self) -> int:
        """How many messages were written."""
        return sum(contents.messages for contents in self._files.values())

    @property
    def size(self) -> int:
        """Bytes on the disk."""
        return sum(file.stat().st_size for file in self.folder.iterdir())

    def __str__(self) -> str:
        """Say what is in it, and how much of the disk it takes."""
        return f"{self.messages} messages, {self.size / 1e6:.1f} MB, in {self.folder}"

    def write(self, message: BagMessage) -> None:
        if self._closed:
            raise OutputError(f"The bag {self.folder} is closed.")
        try:
            if self._file is None or message.log_time < self._newest - JUMP:
                self._end()
                self._begin()
            self._newest = max(message.log_time, self._newest)
            assert self._file is not None
            self._file.write(message)
            if self._file.size > self._config.split:
                self._end()
        except OSError as error:
            raise self._unwritable(error) from error

    def flush(self) -> None:
        """Hand everything to the operating system: it survives the death of this process, not that of the machine."""
        try:
            if self._file is not None:
                self._file.flush()
        except OSError as error:
            raise self._unwritable(error) from error

    def close(self) -> None:
        """Finish the file and write the table of contents; see `Sink`."""
        if self._closed:
            return
        self._closed = True
        try:
            if not self._files:
                self._begin()
            self._end()
        except OSError as error:
            raise self._unwritable(error) from error

    def _begin(self) -> None:
        name = f"{self.folder.name}_{len(self._files)}.mcap"
        self._files[name] = Contents()
        self._newest = 0
        self._file = McapFile(self.folder / name, self._config, self._files[name], self._custom)

    def _end(self) -> None:
        if self._file is None:
            return
        self._file.finish(list(self._files)[-1])
        self._file = None
        write_metadata(self.folder, self._files, self._custom)

    def _unwritable(self, error: OSError) -> OutputError:
        """Leave the file as it is, unfinished: whatever came after half a chunk could not be read."""
        self._closed = True
        if self._file is not None:
            self._file.abandon()
            self._file = None
        return OutputError(f"Cannot write the bag {self.folder}: {error.strerror}.")


class McapFile:
    """One MCAP file in the making; all errors are OSError."""

    def __init__(self, path: Path, config: BagConfig, contents: Contents, custom: Mapping[str, str]) -> None:
        """Create the file at `path`; `contents` is kept up to date, `custom` goes to its beginning."""
        self._contents, self._custom = contents, custom
        self._out: IO[bytes] = path.open("xb")
        self._mcap = Writer(self._out, config.chunk, CompressionType[config.compression.upper()])
        self._mcap.start(profile="ros2")
        if custom:
            self._mcap.add_metadata(CUSTOM, dict(custom))
        self._out.flush()
        self._channels: dict[BagTopic, int] = {}
        self._schemas: dict[tuple[str, str], int] = {}

    @property
    def size(self) -> int:
        """Bytes that were written."""
        return self._out.tell()

    def write(self, message: BagMessage) -> None:
        """Add one message."""
        topic = message.topic
        channel = self._channels.get(topic)
        if channel is None:
            key = (topic.kind, topic.definition)
            if key not in self._schemas:
                self._schemas[key] = self._mcap.register_schema(topic.kind, "ros2msg", topic.definition.encode())
            about = {"offered_qos_profiles": offered_qos(topic.qos), "topic_type_hash": topic.type_hash}
            channel = self._channels[topic] = self._mcap.register_channel(topic.name, "cdr", self._schemas[key], about)
        self._mcap.add_message(
            channel,
            message.log_time,
            message.payload,  # pyright: ignore[reportArgumentType]  # any buffer will do
            message.publish_time,
        )
        self._contents.add(topic, message.log_time)

    def flush(self) -> None:
        """Complete the chunk and hand it to the operating system."""
        self._mcap.flush()

    def finish(self, name: str) -> None:
        """Write the index and close; the file is to be called `name`."""
        # rosbag2 reads a single file without its metadata.yaml by a copy of it inside.
        about = information({name: self._contents}, self._custom)
        self._mcap.add_metadata("rosbag2", {"serialized_metadata": dump(about)})
        self._mcap.finish()
        self._out.close()

    def abandon(self) -> None:
        """Close without an index."""
        with suppress(OSError):
            self._out.close()


def write_metadata(folder: Path, files: Mapping[str, Contents], custom: Mapping[str, str]) -> None:
    """Write the table of contents of a bag whole or not at all. Raises OSError: it cannot be written."""
    part = folder / f"{METADATA}.part"
    part.write_text(dump({"rosbag2_bagfile_information": information(files, custom)}), encoding="utf-8")
    os.replace(part, folder / METADATA)
