"""Which domain is whose: what is refused before anybody joins, and with which words."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from queue import Empty, SimpleQueue

import pytest
import tyro

from golem.errors import ConfigError
from golem.interfaces import public
from golem.middleware.dds import discovery
from golem.middleware.dds.base import Qos
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.wire import hg
from golem.runtime.live.exclusive_writers import LAUNCH, owner, refuse_second
from golem.runtime.live.launch import LaunchConfig, commands, run_launch
from golem.runtime.live.node_setup import company, member
from golem.runtime.live.process import TwinConfig, run_twin
from golem.runtime.live.topic_stats import survey

ROBOT = DdsConfig(domain=0, interface="eth7", robot=True)


@pytest.fixture
def here(domain: int) -> DdsConfig:
    """A domain that no other test uses."""
    pytest.importorskip("cyclonedds")
    return DdsConfig(domain=domain)


def test_domain_0_is_refused_unless_the_robot_is_meant() -> None:
    with pytest.raises(ConfigError, match=r"domain 0 is the real robot's.*--robot"):
        DdsConfig(domain=0)


def test_a_twin_never_joins_the_robots_domain() -> None:
    with pytest.raises(ConfigError, match="A twin never joins domain 0"):
        run_twin(TwinConfig(dds=ROBOT))
    with pytest.raises(ConfigError, match="golem launch starts a simulation"):
        run_launch(LaunchConfig(dds=ROBOT))


def test_a_second_launch_ends_with_a_sentence(here: DdsConfig) -> None:
    with member(LAUNCH, here), pytest.raises(ConfigError, match="a launched robot on domain .* golem launch"):
        run_launch(LaunchConfig(dds=here))


def test_nothing_is_launched_beside_a_part_of_a_robot(here: DdsConfig) -> None:
    with member("safety", here) as (participant, _):
        row = public.topic("/lowcmd")
        writer = participant.writer("rt/lowcmd", hg.LOW_CMD.type_name, row.qos)
        with pytest.raises(ConfigError, match="a safety gate on domain .* golem safety"):
            run_launch(LaunchConfig(dds=here))
        writer.close()


@pytest.mark.slow
def test_a_stack_asks_for_a_robot_only_where_nobody_starts_one(here: DdsConfig) -> None:
    program = (
        "import golem.runtime.live.process as p; from golem.middleware.dds.domain import DdsConfig; p.ALONE = 0.3;"
        f"p.run_up(p.UpConfig(dds=DdsConfig(domain={here.domain})))"
    )
    lines: SimpleQueue[str] = SimpleQueue()
    with member(LAUNCH, here):
        command = [sys.executable, "-u", "-c", program]
        up = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        assert up.stdout is not None
        threading.Thread(target=lambda out=up.stdout: [lines.put(line) for line in out], daemon=True).start()
        assert "is on domain" in lines.get(timeout=60)
        with pytest.raises(Empty):
            lines.get(timeout=1.5)
    assert "No robot on domain" in lines.get(timeout=60)
    up.kill()
    up.wait()


def test_the_robot_is_demanded_by_name_and_by_number() -> None:
    with pytest.raises(ConfigError, match="add --domain 0"):
        DdsConfig(domain=1, robot=True)
    with pytest.raises(ConfigError, match="not on this machine: add --interface"):
        DdsConfig(domain=0, robot=True)
    assert ROBOT.domain == 0


def test_a_wrong_stack_file_is_found_before_anything_is_started() -> None:
    with pytest.raises(ConfigError, match="No stack file 'nonsense'"):
        run_launch(LaunchConfig("nonsense"))
    with pytest.raises(ConfigError, match="No stack file 'nonsense'"):
        run_twin(TwinConfig("nonsense"))


def test_a_command_line_says_what_is_not_the_default() -> None:
    assert DdsConfig().command("safety") == "golem safety"
    robot = DdsConfig(0, "eth0", ("10.0.0.2", "10.0.0.3"), robot=True, distro="humble")
    assert robot.command("up stand") == (
        "golem up stand --domain 0 --interface eth0 --peers 10.0.0.2 10.0.0.3 --robot --distro humble"
    )
    assert tyro.cli(DdsConfig, args=robot.words()) == robot


def test_every_process_is_told_what_concerns_it() -> None:
    dds = DdsConfig(domain=7, interface="eth7", peers=("10.0.0.2",))
    words = commands(LaunchConfig("stand", world="rubble", profile="ideal", seed=3, dds=dds))
    where = ["--domain", "7", "--interface", "eth7", "--peers", "10.0.0.2"]
    assert words["twin"] == ["twin", "stand", "--seed", "3", "--profile", "ideal", "--world", "rubble", *where]
    assert words["safety"] == ["safety", "--limits", "urdf", "--stand", "--still", *where]
    assert words["up"] == ["up", "stand", "--profile", "ideal", *where]
    strict = commands(LaunchConfig(strict=True, dds=dds))
    assert strict["safety"] == ["safety", "--limits", "urdf", "--strict", *where]


def test_who_else_is_there_is_said_with_what_to_look_at(here: DdsConfig) -> None:
    with member("one", here) as (participant, _):
        assert company(participant, here) == "nobody else is there"
        elsewhere = replace(here, interface="eth0")
        assert "--peers" in company(participant, elsewhere)
        with member("two", here):
            end = time.monotonic() + 10.0
            while (said := company(participant, here)) != "one other is there":
                assert time.monotonic() < end, said
                time.sleep(0.05)


@pytest.mark.slow
@pytest.mark.parametrize("words", [["record", "BAG", "--topics", "/lowcmd"], ["view", "--port", "0"]])
def test_who_reads_for_golem_is_known_by_name_recorders_and_viewers_too(
    words: list[str], here: DdsConfig, tmp_path: Path
) -> None:
    """The gate asks whether the motors hear: a recorder is none of them."""
    for module in ("mcap", "rosbags", "foxglove"):
        pytest.importorskip(module)
    words = [word.replace("BAG", str(tmp_path / "bag")) for word in words]
    with member("looker", here) as (participant, _):
        command = [sys.executable, "-m", "golem", *words, "--domain", str(here.domain)]
        with subprocess.Popen(command) as process:
            try:
                end = time.monotonic() + 30.0
                while not (others := discovery.others(participant)):
                    assert time.monotonic() < end
                    time.sleep(0.05)
                assert owner(participant, others[0].guid).startswith(f"golem {words[0]}, ")
            finally:
                process.kill()


def test_rates_and_bytes_of_a_topic_are_measured(here: DdsConfig) -> None:
    stop = threading.Event()
    with member("talker", here) as (talker, _), member("listener", here) as (listener, _):
        writer = talker.writer("rt/lowcmd", hg.LOW_CMD.type_name, Qos(depth=1))

        def talk() -> None:
            while not stop.wait(0.01):
                writer.write(hg.LOW_CMD.blank())

        thread = threading.Thread(target=talk)
        thread.start()
        try:
            (row,) = survey(listener, 1.0)
        finally:
            stop.set()
            thread.join()
    assert (row.name, row.type_name, row.readers) == ("/lowcmd", hg.LOW_CMD.type_name, 0)
    assert row.writers[0].startswith("golem talker, ")
    assert 10.0 < row.rate < 110.0 and row.size == pytest.approx(row.rate * hg.LOW_CMD.size)


def test_a_second_gate_is_refused_before_it_joins_and_a_robots_own_writer_is_left_to_the_first(here: DdsConfig) -> None:
    kind, qos = hg.LOW_CMD.type_name, Qos(depth=1)
    with member("looker", here) as (participant, _):
        with closing(connect(here, "another make")) as stranger:
            stranger.writer("rt/lowcmd", kind, qos)
            refuse_second(participant, here, "/lowcmd")
        with member("safety", here) as (ours, _):
            ours.writer("rt/lowcmd", kind, qos)
            with pytest.raises(ConfigError, match=r"There is a safety gate on .* already: golem safety, .*"):
                refuse_second(participant, here, "/lowcmd")
