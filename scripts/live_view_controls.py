"""Whether each control of the live view does what it says: `python scripts/live_view_controls.py [chromium]`.

A browser without a window has the page of a hanging and of a standing robot. Each control is clicked or typed into, as
a person does, and what comes of it is looked for in the page's text, its picture or a file. Printed is a table.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from browser import SLOW, Browser

PORT, SIZE, SCENE = 8096, (1100, 900), 700
"""Of the server; of the page, and of its left part without the panel [px]."""
CHANGED = 60
"""Pixels that differ by more than noise where something came or went."""


class Page:
    """A page under test, and what came of each control."""

    def __init__(self, browser: Browser, folder: Path) -> None:
        self.browser, self.folder, self.rows = browser, folder, list[tuple[str, str, bool]]()

    def check(self, control: str, wanted: str, do: Callable[[], None], seen: Callable[[], object]) -> None:
        """Use a control, and look whether what is wanted comes to be."""
        try:
            do()
            good = self.browser.wait(seen)
        except (TimeoutError, RuntimeError) as error:
            good, wanted = False, f"{wanted} ({error})"
        self.rows.append((control, wanted, good))
        print(f"| {control} | {wanted} | {'yes' if good else 'NO'} |", flush=True)
        if not good:
            print(f"{control}: the page says {self.browser.text[:600]!r}", file=sys.stderr)

    def says(self, word: str) -> Callable[[], bool]:
        """Return whether a word can be read."""
        return lambda: word in self.browser.text

    def changes(self, control: str, wanted: str, do: Callable[[], None]) -> None:
        """Use a control that changes the scene of a robot at rest."""
        before = self.browser.picture(SCENE)
        still = self._different(before)
        self.check(control, wanted, do, lambda: self._different(before) > still + CHANGED)

    def _different(self, before: np.ndarray) -> int:
        now = self.browser.picture(SCENE).astype(int)
        return int((np.abs(now - before).max(axis=2) > 24).sum())

    @property
    def t(self) -> float:
        """Robot time [s]."""
        return self.number(r"robot time ([0-9.]+) s")

    def number(self, pattern: str) -> float:
        """Return a number in the text; NaN without one."""
        found = re.search(pattern, self.browser.text)
        return float(found[1]) if found else np.nan

    def rate(self, seconds: float = 4.0) -> float:
        """Return robot time per time of the wall."""
        t, wall = self.t, time.monotonic()
        time.sleep(seconds)
        return (self.t - t) / (time.monotonic() - wall)

    def pauses(self) -> bool:
        """Return whether robot time stands."""
        t = self.t
        time.sleep(1.5)
        return t == self.t


@contextmanager
def opened(program: str, stack: str) -> Iterator[Page]:
    """Run a stack, and open its page."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "golem", "run", stack, "--operate", "--port", str(PORT)]
        robot = subprocess.Popen(command, stdout=subprocess.DEVNULL, cwd=folder)
        try:
            profile = Path(folder) / "profile"
            with Browser(program, profile, SIZE) as browser:
                end = time.monotonic() + 300.0  # kernels may have to be compiled
                while time.monotonic() < end:
                    with suppress(OSError), urllib.request.urlopen(f"http://127.0.0.1:{PORT}", timeout=5):
                        break
                    time.sleep(1.0)
                browser.open(f"http://127.0.0.1:{PORT}")
                page = Page(browser, Path(folder))
                page.check(f"page of `{stack}`", "commands pass", lambda: None, page.says("commands pass"))
                yield page
                page.check("browser", "no error in the page", lambda: None, lambda: not browser.errors)
                print(*browser.errors, sep="\n", file=sys.stderr)
        finally:
            robot.kill()
            robot.wait(SLOW)


def toggles(page: Page, box: str) -> None:
    """Use a box twice."""
    for word in ("shown", "gone"):
        page.changes(box, word, lambda: page.browser.click(box, "input"))


def hanging(page: Page) -> None:
    """Controls of a robot in its hoist."""
    b = page.browser
    page.check("Pause", "robot time stands", lambda: b.click("Pause"), lambda: page.says("Resume")() and page.pauses())
    b.click("View")
    for camera in ("hands", "front", "above", "hanging"):
        page.changes(f"camera: {camera}", "another view", lambda camera=camera: b.choose("camera", camera))
    for layer in ("frames", "collision shapes"):
        toggles(page, layer)
    b.click("Arms")
    toggles(page, "gizmos at the hands")
    page.check("Resume", "robot time goes on", lambda: b.click("Resume"), lambda: page.rate(2.0) > 0.0)
    page.check("speed: a tenth", "0.1 x", lambda: b.choose("speed", "a tenth"), lambda: 0.05 < page.rate() < 0.13)
    b.choose("speed", "real time")
    page.check("Start", "a pick begins", lambda: b.click("Start"), page.says("Bringing the hand over it."))
    page.check("Cancel", "it stops", lambda: b.click("Cancel"), page.says("Stopped where it was."))
    b.click("Pause")
    toggles(page, "clouds")
    page.changes("look back [s]", "the past", lambda: b.enter("look back [s]", "-20"))
    b.enter("look back [s]", "0")
    b.click("Resume")
    pictures = lambda: [*(page.folder / "profile").glob("golem*.png")]  # noqa: E731
    page.check("Save a picture", "a PNG file", lambda: b.click("Save a picture"), pictures)
    page.check("Record a film", "it begins", lambda: b.click("Record a film"), page.says("End the film"))
    time.sleep(3.0)
    page.check("End the film", "a file is named", lambda: b.click("End the film"), page.says("Written: "))
    b.click("Plot")
    plots = lambda: b.js("document.querySelectorAll('.uplot canvas').length")  # noqa: E731
    page.check("signal", "a plot", lambda: b.choose("signal", "CoM margin [m], simulator's truth"), plots)
    b.click("joints [rad]")
    page.check(
        "joint slider, Move there", "the arm moves", lambda: move(page), page.says("The arms are where the panel says.")
    )
    page.check("Emergency stop", "says so", lambda: b.click("Emergency stop"), page.says("estop_pressed"))
    page.check("Release, Reset and activate", "commands pass", lambda: revive(b), page.says("commands pass"))
    late = page.t
    page.check("Start over", "another episode", lambda: b.click("Start over"), lambda: 0.0 <= page.t < late)


def revive(browser: Browser) -> None:
    """Let commands pass again after an emergency stop."""
    browser.click("Release emergency stop")
    browser.click("Reset and activate")


def move(page: Page) -> None:
    """Ask for another angle of an elbow."""
    page.browser.enter("right_elbow", "0.9")
    page.browser.click("Move there")


def push(page: Page) -> None:
    """Push it, once it stands still; time goes slowly then: a picture of the page takes longer than it sways."""
    time.sleep(3.0)
    page.browser.click("View")
    page.browser.choose("speed", "a tenth")
    page.browser.click("Push", "button")


def standing(page: Page) -> None:
    """Controls of a robot on its feet."""
    b = page.browser
    speed = r"estimate\s+([+-][0-9.]+) m/s ahead"
    page.check("warning", "an e-stop makes it sink", lambda: None, page.says("a robot on its feet sinks down"))
    walk = lambda: b.enter("forward vx [m/s]", "-0.2")  # noqa: E731 - a pack is before it
    page.check("forward vx", "it walks back", walk, lambda: page.says("stepping")() and page.number(speed) < -0.1)
    page.check("Stop walking", "it stands", lambda: b.click("Stop walking"), page.says(", standing"))
    aside = r"ahead, ([+-][0-9.]+) m/s left\nheight"
    page.check("Push", "it sways", lambda: push(page), lambda: abs(page.number(aside)) > 0.03)


def main(program: str) -> bool:
    """Print the table; return whether all do what they say."""
    print("| control | what is to come | seen |\n|---|---|---|")
    rows: list[tuple[str, str, bool]] = []
    for stack, controls in (("tether", hanging), ("stand", standing)):
        with opened(program, stack) as page:
            controls(page)
        rows += page.rows
    print(f"\n{sum(good for *_, good in rows)} of {len(rows)} do what they say.")
    return all(good for *_, good in rows)


sys.exit(not main(*sys.argv[1:] or ["chromium"]))
