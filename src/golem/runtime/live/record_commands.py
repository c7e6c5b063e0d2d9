"""`golem record` and `golem replay`: a domain into a bag, a bag onto a domain."""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from tyro.conf import OmitArgPrefixes, Positional

from golem.errors import ConfigError
from golem.interfaces.recorded import public_topics
from golem.middleware.bags.player import PlayConfig, Player
from golem.middleware.bags.reader import Bag, repair, told
from golem.middleware.bags.recorder import Recorder, offered
from golem.middleware.bags.writer import BagConfig, BagWriter, Compression
from golem.middleware.dds import discovery
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.interrupt import interrupted
from golem.runtime.live.exclusive_writers import SOLE, identity, refuse_second
from golem.runtime.live.node_setup import log_line

LOOK = 3.0
"""Time over which is watched how fast a bag grows [s]."""


@dataclass(frozen=True)
class RecordConfig:
    """Record a domain into a bag, until Ctrl-C."""

    bag: Positional[Path | None] = None
    """Folder to create; default: runs/bags/ and the time."""
    topics: tuple[str, ...] = ()
    """Topics to record, by their ROS names; default: all public ones, images as they are."""
    all: bool = False
    """Record every topic of a known type, compressed images included."""
    compression: Compression = "none"
    """Of the messages: none, lz4 or zstd. zstd makes an image smaller for about 1 ms of CPU."""
    split: int = 2048
    """Size at which the next file of the bag is begun [MiB]."""
    seconds: float = math.inf
    """Time to record."""
    repair: bool = False
    """Record nothing: finish a bag whose recorder was killed."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


@dataclass(frozen=True)
class ReplayBagConfig:
    """Play a bag onto a domain, with /clock."""

    bag: Positional[Path]
    """Folder of a bag, or an MCAP file."""
    rate: float = 1.0
    """How much faster than it was recorded."""
    loop: bool = False
    """Begin again at its end, until Ctrl-C."""
    start: float = 0.0
    """Where to begin [s from the beginning of the bag]."""
    stop: float = math.inf
    """Where to end [s from the beginning of the bag]."""
    topics: tuple[str, ...] = ()
    """Topics to play; default: all in the bag."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


class Growth:
    """Says once how fast a bag grows, and how long the disk has room for it."""

    def __init__(self, bag: BagWriter, say: Callable[[str], None] = log_line) -> None:
        self._bag, self._say = bag, say
        self._since: tuple[float, int] | None = None
        self._said = False

    def look(self) -> None:
        """Look at the bag, which was flushed."""
        if self._said or self._bag.messages == 0:
            return
        now, size = time.monotonic(), self._bag.size
        if self._since is None:
            self._since = now, size
            return
        took, grown = now - self._since[0], size - self._since[1]
        if took < LOOK or grown <= 0:
            return
        self._said = True
        rate, room = grown / took, shutil.disk_usage(self._bag.folder).free
        self._say(
            f"The bag grows by {rate * 60e-6:.0f} MB a minute; the disk has room for {room / rate / 60.0:.0f} minutes. "
            "--topics and --compression make it smaller."
        )


def run_record(config: RecordConfig) -> int:
    """Record, and say what; return how many messages.

    Raises:
        ConfigError: a topic or an option is wrong.
        OutputError: the bag cannot be written.
        DdsError: the domain cannot be joined.
    """
    if config.repair:
        return _repair(config)
    folder = config.bag or Path("runs/bags") / time.strftime("%Y_%m_%d-%H_%M_%S")
    with closing(connect(config.dds, identity("record"))) as participant, interrupted() as stop:
        bag = BagWriter(folder, BagConfig(config.compression, split=config.split * 2**20))
        with closing(bag), closing(Recorder(participant, bag)) as recorder:
            recorder.add(public_topics(config.topics))

            growth = Growth(bag)

            def every_second() -> None:
                bag.flush()
                growth.look()
                if config.topics or config.all:
                    found = offered(discovery.writers(participant))
                    recorder.add(t for t in found if config.all or t.name in config.topics)

            print(f"Recording {config.dds} to {folder}. Ctrl-C ends it.", flush=True)
            recorder.run(stop, every_second, config.seconds)
    for name in sorted({*recorder.received, *config.topics}):
        lost = "  more than could be kept; some were lost" if name in recorder.overruns else ""
        print(f"{recorder.received.get(name, 0):9d}  {name}{lost}")
    what = "these topics" if config.topics else "anything"
    nothing = f" Nobody published {what} on {config.dds}." if bag.messages == 0 else ""
    print(f"{bag}.{nothing}", flush=True)
    return bag.messages


def run_replay(config: ReplayBagConfig) -> int:
    """Play, and say what; return how many messages were written.

    Raises:
        BagError: there is no bag, or it is damaged.
        ConfigError: an option is wrong, or the bag would be played to the real robot, or beside another one.
        DdsError: the domain cannot be joined.
    """
    if config.dds.robot:
        raise ConfigError("A bag is not played to the real robot: it would move to commands of another time.")
    play = PlayConfig(config.rate, config.loop, config.start, config.stop, config.topics)
    bag = Bag(config.bag)
    if not bag.finished:
        print("The recorder of this bag was killed; it is played up to the last chunk that is whole.", flush=True)
    if bag.foreign:
        print(f"Left out: {told(bag)}.", flush=True)
    with closing(connect(config.dds, identity("replay"))) as participant, interrupted() as stop:
        # Whatever is played, it is played with a clock.
        played = play.topics or tuple(bag.topics)
        refuse_second(participant, config.dds, *(topic for topic in SOLE if topic in (*played, "/clock")))
        with closing(Player(bag, participant, play)) as player:
            print(f"Playing {config.bag} on {config.dds}. Ctrl-C ends it.", flush=True)
            written = player.run(stop)
    print(f"{written} messages.", flush=True)
    return written


def _repair(config: RecordConfig) -> int:
    if config.bag is None:
        raise ConfigError("Say which bag to repair: golem record BAG --repair.")
    for file in repair(config.bag):
        print(f"Finished {file}.")
    bag = Bag(config.bag)
    count = sum(1 for _ in bag.messages())
    print(f"{count} messages of {len(bag.topics)} topics in {config.bag}.", flush=True)
    return count
