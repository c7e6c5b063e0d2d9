"""From a domain into a sink and back, over the in-process transport."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("mcap")
pytest.importorskip("rosbags")

from golem.errors import ConfigError
from golem.interfaces.recorded import public_topics
from golem.middleware.bags.base import BagMessage, BagTopic
from golem.middleware.bags.player import PlayConfig, Player
from golem.middleware.bags.reader import Bag
from golem.middleware.bags.recorder import GONE, HOLD, MANY, Recorder, clock_time, offered, topic
from golem.middleware.bags.writer import BagWriter
from golem.middleware.dds.base import DEFAULT, LATCHED, Participant, Qos, Reader
from golem.middleware.dds.discovery import Endpoint
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros import codec, names
from golem.middleware.ros.message import NANO
from golem.middleware.ros.msgs.builtin_interfaces import Time
from golem.middleware.ros.msgs.rosgraph_msgs import Clock
from golem.middleware.ros.msgs.std_msgs import String

WORDS = topic("/words", "std_msgs/msg/String")
MODEL = topic("/robot_description", "std_msgs/msg/String", LATCHED)
CLOCK = topic("/clock", "rosgraph_msgs/msg/Clock")
WALL = 1_700_000_000.0


class Wall:
    """The wall clock of a test."""

    def __init__(self) -> None:
        self.now = WALL

    def __call__(self) -> float:
        return self.now


class Pile:
    """A sink."""

    def __init__(self) -> None:
        self.messages: list[BagMessage] = []

    def write(self, message: BagMessage) -> None:
        self.messages.append(message)

    def close(self) -> None:
        pass

    def said(self) -> list[tuple[str, float, str]]:
        """Return topic, log time [s] and text of the messages that are texts."""
        return [
            (m.topic.name, m.log_time / NANO, codec.deserialize(bytes(m.payload), String).data)
            for m in self.messages
            if m.topic.kind == WORDS.kind
        ]


def say(participant: Participant, where: BagTopic, text: str) -> None:
    writer = participant.writer(names.topic(where.name), codec.dds_name(where.kind), where.qos)
    writer.write(codec.serialize(String(data=text)))


def clock(participant: Participant) -> Callable[[float], None]:
    """Return what sets the domain's time [s]."""
    writer = participant.writer("rt/clock", codec.dds_name(CLOCK.kind), CLOCK.qos)

    def tick(seconds: float) -> None:
        writer.write(codec.serialize(Clock(clock=Time(sec=int(seconds), nanosec=round(seconds % 1 * NANO)))))

    return tick


def settled(domain: LocalDomain, pile: Pile, wall: Wall, *topics: BagTopic) -> Recorder:
    """Return a recorder that has waited long enough for a /clock."""
    recorder = Recorder(domain.participant(), pile, wall)
    recorder.add(topics)
    assert recorder.poll() == 0
    wall.now += HOLD
    return recorder


def test_recorded_by_the_wall_clock_without_clock() -> None:
    wall, pile = Wall(), Pile()
    domain = LocalDomain(wall)
    recorder = settled(domain, pile, wall, WORDS, MODEL)
    other = domain.participant()
    say(other, WORDS, "a")
    wall.now += 0.004
    say(other, MODEL, "b")
    wall.now += 0.006
    say(other, WORDS, "c")
    wall.now += 0.02
    assert recorder.poll() == 3 and recorder.poll() == 0
    assert [(name, round(t - WALL - HOLD, 3), text) for name, t, text in pile.said()] == [
        ("/words", 0.0, "a"),
        ("/robot_description", 0.004, "b"),
        ("/words", 0.01, "c"),
    ]
    assert all(m.publish_time == m.log_time for m in pile.messages)
    assert recorder.received == {"/words": 2, "/robot_description": 1} and not recorder.overruns


def test_recorded_by_the_time_of_the_domain() -> None:
    wall, pile = Wall(), Pile()
    domain = LocalDomain(wall)
    recorder = Recorder(domain.participant(), pile, wall)
    recorder.add([WORDS, CLOCK])
    other = domain.participant()
    tick = clock(other)
    for at, text in ((12.5, "a"), (12.502, "b"), (0.25, "after a restart")):
        wall.now += 0.001
        tick(at)
        wall.now += 0.001
        say(other, WORDS, text)
    recorder.poll()
    assert [(t, text) for _, t, text in pile.said()] == [(12.5, "a"), (12.502, "b"), (0.25, "after a restart")]
    assert {m.publish_time > WALL * NANO for m in pile.messages} == {True}


def test_what_comes_before_the_first_clock_waits_for_it() -> None:
    """Else a bag of a simulation would begin in another time than it goes on in."""
    wall, pile = Wall(), Pile()
    domain = LocalDomain(wall)
    recorder = Recorder(domain.participant(), pile, wall)
    recorder.add([WORDS])
    other = domain.participant()
    say(other, WORDS, "a")
    assert recorder.poll() == 0
    wall.now += 0.5
    clock(other)(7.25)
    wall.now += 0.1
    say(other, WORDS, "b")
    assert recorder.poll() == 2  # /clock itself is not asked for, it tells the time all the same
    assert pile.said() == [("/words", 7.25, "a"), ("/words", 7.25, "b")]


def test_a_recording_that_ends_at_once_holds_what_came() -> None:
    wall, pile = Wall(), Pile()
    domain = LocalDomain(wall)
    recorder = Recorder(domain.participant(), pile, wall)
    recorder.add([WORDS])
    say(domain.participant(), WORDS, "a")
    assert recorder.poll(last=True) == 1


def test_a_stranger_to_the_time_is_taken_at_its_arrival() -> None:
    """The clock of the writer's machine may be wrong by years."""
    wall, pile = Wall(), Pile()
    domain = LocalDomain(lambda: -5.0)
    recorder = settled(domain, pile, wall, WORDS)
    say(domain.participant(), WORDS, "a")
    recorder.poll()
    assert pile.said() == [("/words", WALL + HOLD, "a")]


def test_too_much_to_keep_is_counted_and_bounded() -> None:
    wall, pile = Wall(), Pile()
    domain = LocalDomain(wall)
    recorder = settled(domain, pile, wall, WORDS)
    writer = domain.participant().writer("rt/words", codec.dds_name(WORDS.kind), WORDS.qos)
    for _ in range(MANY + 500):
        writer.write(codec.serialize(String(data="x")))
    recorder.poll()
    assert len(pile.messages) == MANY and recorder.overruns == {"/words": 1}
    recorder.remove("/words")
    writer.write(codec.serialize(String(data="x")))
    assert recorder.poll() == 0


def test_of_two_clocks_the_first_counts_until_it_stops() -> None:
    wall, pile = Wall(), Pile()
    domain = LocalDomain(wall)
    recorder = Recorder(domain.participant(), pile, wall)
    recorder.add([WORDS, CLOCK])
    other = domain.participant()
    first, second = clock(other), clock(domain.participant())

    def told(*ticks: Callable[[], None]) -> float:
        for each in ticks:
            wall.now += 0.001
            each()
        say(other, WORDS, "now")
        recorder.poll()
        return pile.said()[-1][1]

    assert told(lambda: first(12.5), lambda: second(3.0), lambda: first(12.502), lambda: second(3.002)) == 12.502
    assert recorder.received["/clock"] == 2
    wall.now += GONE
    assert told(lambda: second(4.0)) == 4.0


def test_foreign_bytes_on_clock_are_no_time() -> None:
    assert clock_time(codec.serialize(Clock(clock=Time(sec=3, nanosec=7)))) == 3_000_000_007
    assert clock_time(bytes((0, 0, 0, 0)) + bytes((0, 0, 0, 3)) + bytes((0, 0, 0, 7))) == 3_000_000_007
    for foreign in (b"", b"\x00\x01\x00\x00", b"\x00\x07\x00\x00" + bytes(8), bytes(13)):
        assert clock_time(foreign) is None


def bag_of(folder: Path, messages: list[tuple[BagTopic, float, str]]) -> Bag:
    writer = BagWriter(folder)
    for where, t, text in messages:
        at = round(t * NANO)
        writer.write(BagMessage(where, at, at, codec.serialize(String(data=text))))
    writer.close()
    return Bag(folder)


class Played:
    """What readers hear of a bag that is played as fast as possible."""

    def __init__(self, bag: Bag, config: PlayConfig, stop: threading.Event | None = None) -> None:
        domain = LocalDomain()
        words, clock = (
            domain.participant().reader(names.topic(t.name), codec.dds_name(t.kind), Qos(depth=None))
            for t in (WORDS, CLOCK)
        )
        player = Player(bag, domain.participant(), config)
        self.written = player.run(stop or threading.Event())
        self.words = texts(words)
        self.ticks = [(clock_time(s.payload) or 0) / NANO for s in clock.take(1000)]
        late = domain.participant().reader("rt/robot_description", codec.dds_name(MODEL.kind), LATCHED)
        self.model = texts(late)
        player.close()


def texts(reader: Reader) -> list[str]:
    return [codec.deserialize(bytes(s.payload), String).data for s in reader.take(1000) if s.alive]


FAST = PlayConfig(rate=1e6, wait=0.0)


def test_played_in_order_with_a_clock(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", [(WORDS, 5.0, "a"), (MODEL, 5.03, "m"), (WORDS, 5.2, "c")])
    played = Played(bag, FAST)
    assert played.words == ["a", "c"] and played.model == ["m"] and played.written == 3
    assert played.ticks == [pytest.approx(5.0 + 0.01 * i) for i in range(21)]


def test_played_at_the_asked_rate(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", [(WORDS, 5.0, "a"), (WORDS, 7.0, "b")])
    begin = time.monotonic()
    Played(bag, PlayConfig(rate=10.0, wait=0.1))
    assert time.monotonic() - begin >= 0.3


def test_a_part_is_played_with_what_holds_at_its_start(tmp_path: Path) -> None:
    said = [(MODEL, 1.0, "old"), (MODEL, 1.5, "new"), *((WORDS, 2.0 + i, str(i)) for i in range(5))]
    bag = bag_of(tmp_path / "bag", said)
    played = Played(bag, replace(FAST, start=2.5, stop=4.5))
    assert played.words == ["2", "3"] and played.model == ["new"]
    assert played.ticks == [pytest.approx(4.0 + 0.01 * i) for i in range(101)]  # not from 1.5 s on, in one burst
    assert Played(bag, replace(FAST, topics=("/words",))).model == []
    with pytest.raises(ConfigError, match="Did you mean '/words'"):
        Played(bag, replace(FAST, topics=("/word",)))


def test_a_recorded_clock_is_played_and_none_is_made(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "bag")
    for i in range(3):
        payload = codec.serialize(Clock(clock=Time(sec=i, nanosec=5)))
        writer.write(BagMessage(CLOCK, i * NANO, i * NANO, payload))
    writer.close()
    assert Played(Bag(tmp_path / "bag"), FAST).ticks == [i + 5e-9 for i in range(3)]


def test_a_bag_in_which_time_jumped_back_is_played_through(tmp_path: Path) -> None:
    """A twin that is restarted begins at 0: the writer begins a new file, and nothing is reordered."""
    said = [(WORDS, 50.0, "a"), (WORDS, 51.0, "b"), (WORDS, 0.5, "c"), (WORDS, 1.5, "d")]
    bag = bag_of(tmp_path / "bag", said)
    assert len(bag.files) == 2
    assert Played(bag, FAST).words == ["a", "b", "c", "d"]
    assert Played(bag, replace(FAST, start=1.5)).words == ["d"]


def test_a_loop_goes_on_until_it_is_stopped(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", [(WORDS, 5.0, "a"), (WORDS, 5.02, "b")])
    stop = threading.Event()
    timer = threading.Timer(0.3, stop.set)
    timer.start()
    played = Played(bag, PlayConfig(rate=2.0, loop=True, wait=0.0), stop)
    timer.join()
    assert played.words[:5] == ["a", "b", "a", "b", "a"]


def test_recording_what_is_played_gives_the_bag_again(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", [(WORDS, 5.0 + 0.01 * i, str(i)) for i in range(10)])
    domain, pile = LocalDomain(), Pile()
    recorder = Recorder(domain.participant(), pile)
    recorder.add([CLOCK, WORDS])
    Player(bag, domain.participant(), PlayConfig(rate=10.0, wait=0.0)).run(threading.Event())
    recorder.poll()
    assert [(round(t, 6), text) for _, t, text in pile.said()] == [
        (round(5.0 + 0.01 * i, 6), str(i)) for i in range(10)
    ]


def test_public_topics_are_chosen_by_name() -> None:
    every = {t.name: t for t in public_topics()}
    assert {"/lowstate", "/clock", "/realsense/head/color/image_raw"} <= set(every)
    assert every["/lowstate"].kind == "unitree_hg/msg/LowState"
    assert "MSG: unitree_hg/MotorState" in every["/lowstate"].definition
    assert not any(name.endswith("compressed") for name in every)
    assert [t.name for t in public_topics(["/tf", "/tf", "/somebody/elses"])] == ["/tf"]


def found(topic: str, type_name: str, qos: Qos) -> Endpoint:
    return Endpoint(topic, type_name, qos, bytes(16), bytes(16), "")


def test_what_is_found_on_a_domain_is_recorded_as_it_is_offered() -> None:
    writers = [
        found("rt/chatter", "std_msgs::msg::dds_::String_", LATCHED),
        found("rt/skill/pick/_action/feedback", "golem_interfaces::action::dds_::Pick_FeedbackMessage_", DEFAULT),
        found("rt/secret", "their_msgs::msg::dds_::Unknown_", DEFAULT),
        found("rt/plain", "Plain", DEFAULT),
        found("rq/somethingRequest", "std_srvs::srv::dds_::Trigger_Request_", DEFAULT),
        found("ros_discovery_info", "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_", DEFAULT),
    ]
    chatter, feedback = offered(writers)
    assert chatter == topic("/chatter", "std_msgs/msg/String", LATCHED)
    assert feedback.name == "/skill/pick/_action/feedback"


@pytest.mark.parametrize("wrong", [{"rate": 0.0}, {"rate": float("inf")}, {"start": 3.0, "stop": 2.0}, {"start": -1.0}])
def test_impossible_plays_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        PlayConfig(**wrong)  # pyright: ignore[reportArgumentType]
