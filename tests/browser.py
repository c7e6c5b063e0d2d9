"""A real browser of the Chromium family, driven by its DevTools protocol: pages as people see them."""

from __future__ import annotations

import base64
import itertools
import json
import os
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
SLOW = 60.0
"""What a loaded machine may take to show something [s of the wall clock]."""


def find_browser() -> str | None:
    """Return the program of `$BROWSER_BINARY`, or the first one that is installed."""
    return os.environ.get("BROWSER_BINARY") or next(filter(None, map(shutil.which, NAMES)), None)


class Browser:
    """One page without a window; its errors are kept in `errors`."""

    def __init__(self, program: str, profile: Path, size: tuple[int, int] = (1280, 1000)) -> None:
        from websockets.sync.client import connect

        args = ["--headless=new", "--no-sandbox", "--enable-unsafe-swiftshader", "--remote-debugging-port=0"]
        args += [f"--user-data-dir={profile}", f"--window-size={size[0]},{size[1]}", "about:blank"]
        self._process = subprocess.Popen([program, *args], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        said = profile / "DevToolsActivePort"
        self._until(lambda: said.exists() and said.read_text().count("\n"), "the browser to start")
        port = said.read_text().split()[0]
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json", timeout=SLOW) as answer:
            tabs = json.load(answer)
        address = next(tab["webSocketDebuggerUrl"] for tab in tabs if tab["type"] == "page")
        self._socket = connect(address, max_size=None, proxy=None)
        self._numbers, self.errors = itertools.count(1), list[str]()
        for domain in ("Page", "Runtime", "Log"):
            self.do(f"{domain}.enable")
        size_of = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": False}
        self.do("Emulation.setDeviceMetricsOverride", **size_of)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):
            self._socket.close()
        self._process.kill()
        self._process.wait()

    def do(self, method: str, **params: Any) -> dict[str, Any]:
        """Call a method of the protocol; raises RuntimeError where the browser refuses."""
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            said = json.loads(self._socket.recv(timeout=SLOW))
            if said.get("method") == "Runtime.exceptionThrown":
                self.errors.append(str(said["params"]["exceptionDetails"])[:500])
            if said.get("method") == "Log.entryAdded" and said["params"]["entry"]["level"] == "error":
                self.errors.append(str(said["params"]["entry"])[:500])
            if said.get("id") == number:
                if "error" in said:
                    raise RuntimeError(f"{method}: {said['error']}")
                return said["result"]

    def js(self, code: str) -> Any:
        """Return what an expression comes to in the page."""
        return self.do("Runtime.evaluate", expression=code, returnByValue=True)["result"].get("value")

    def open(self, url: str) -> None:
        """Go to an address, and wait for the page."""
        self.do("Page.navigate", url=url)
        self._until(lambda: self.js("document.readyState") == "complete", url)

    @property
    def text(self) -> str:
        """What can be read."""
        return self.js("document.body.innerText")

    def until(self, word: str, seconds: float = SLOW) -> None:
        """Wait until something can be read."""
        self._until(lambda: word in self.text, repr(word), seconds)

    def click(self, label: str) -> None:
        """Click what is named, by its text or by the label before it, in the middle, as a mouse does."""
        find = (
            "(() => {const all = [...document.querySelectorAll('button, label, legend, [role=option], p, span')];"
            f"const it = all.filter(e => e.innerText && e.innerText.trim() === {json.dumps(label)}).at(-1);"
            "if (!it) return null; it.scrollIntoView({block: 'center'});"
            "const r = it.getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]})()"
        )
        self._until(lambda: self.js(find) is not None, f"a control {label!r}")
        time.sleep(0.3)  # what scrolls comes to rest
        x, y = self.js(find)
        for kind in ("mousePressed", "mouseReleased"):
            self.do("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def key(self, code: str, *, down: bool) -> None:
        """Press or let go a key by its code, `KeyR`."""
        self.do("Input.dispatchKeyEvent", type="rawKeyDown" if down else "keyUp", code=code)

    def picture(self, path: Path) -> None:
        """Write what is seen as PNG."""
        path.write_bytes(base64.b64decode(self.do("Page.captureScreenshot", format="png")["data"]))

    def _until(self, condition: Callable[[], object], what: str, seconds: float = SLOW) -> None:
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError(f"Waited {seconds:g} s for {what}.")
            time.sleep(0.2)
