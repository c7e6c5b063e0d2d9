"""Pages in a real browser: what is clicked and typed does what it says."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.error import URLError

import pytest
from tests.browser import SLOW, Browser, find_browser

pytest.importorskip("viser")
pytestmark = [
    pytest.mark.alone,  # a robot, its server and a browser that renders share the machine
    pytest.mark.skipif(find_browser() is None, reason="needs Chromium, or $BROWSER_BINARY"),
]


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    program = find_browser()
    assert program is not None
    with Browser(program, tmp_path / "profile") as browser:
        yield browser


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


@contextmanager
def golem(*args: str) -> Iterator[None]:
    process = subprocess.Popen([sys.executable, "-m", "golem", *args], stdout=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(SLOW)


def robot_time(browser: Browser) -> float:
    return float(re.search(r"robot time ([0-9.]+) s", browser.text)[1])  # pyright: ignore[reportOptionalSubscript]


def ready(browser: Browser, url: str, word: str) -> None:
    """Open a page as soon as it is served, and wait until it says something."""
    end = time.monotonic() + SLOW
    while time.monotonic() < end:
        with suppress(URLError), urllib.request.urlopen(url, timeout=5):
            break
        time.sleep(0.5)
    browser.open(url)
    browser.until(word)


def test_buttons_of_the_live_view_do_what_they_say(browser: Browser) -> None:
    port = free_port()
    with golem("run", "tether", "--port", str(port)):
        ready(browser, f"http://127.0.0.1:{port}", "commands pass")

        browser.click("Pause")
        browser.until("Resume")
        stood = robot_time(browser)
        time.sleep(1.0)
        assert robot_time(browser) == stood
        browser.click("Resume")
        browser.until("Pause")

        browser.click("Start")
        browser.until("Looking for a screw")
        browser.click("Cancel")
        browser.until("Stopped where it was.")

        browser.click("Emergency stop")
        browser.until("estop_pressed")
        browser.until("stopped:")
        browser.click("Release emergency stop")
        browser.click("Reset and activate")
        browser.until("commands pass")

        late = robot_time(browser)
        browser.click("Start over")
        end = time.monotonic() + SLOW
        while robot_time(browser) > late and time.monotonic() < end:
            time.sleep(0.5)
        assert robot_time(browser) < late
    assert not browser.errors


def test_a_hand_is_driven_by_keys_and_what_is_driven_is_a_demonstration(browser: Browser, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    from golem.datasets.store import DatasetFolder

    port, driven = free_port(), tmp_path / "driven"
    with golem("teleop", "tether", "--port", str(port), "--dataset", str(driven), "--seed", "1"):
        ready(browser, f"http://127.0.0.1:{port + 1}", "nobody drives")
        browser.click("record")
        browser.until("recording")
        browser.key("Space", down=True)
        browser.key("KeyR", down=True)
        browser.until("you drive")
        time.sleep(5.0)
        browser.key("KeyR", down=False)
        browser.key("Space", down=False)
        browser.until("nobody drives")
        browser.click("keep")
        browser.until("1 episodes")
    assert not browser.errors
    kept = DatasetFolder(driven)
    names = kept.info["features"]["action"]["names"]
    height = kept.values(kept.episode(0), "action")[:, names.index("right_palm.z")]
    assert height[-1] - height[0] > 0.05
