"""A browser of the Chromium family without a window, driven by its DevTools protocol: pages as people see them."""

from __future__ import annotations

import base64
import itertools
import json
import subprocess
import time
import urllib.request
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import cv2
import numpy as np
from numpy.typing import NDArray

SLOW = 60.0
"""What a loaded machine may take to show something [s of the wall clock]."""
ROW = """((label, inside) => {
  const named = [...document.querySelectorAll('button, label, legend, [role=option], p, span, div')]
    .filter(e => e.innerText && e.innerText.trim() === label && e.getBoundingClientRect().width > 0);
  let it = named.at(-1);
  while (it && inside && !it.querySelector(inside)) it = it.parentElement;
  if (it && inside) it = it.querySelector(inside);
  if (!it) return null;
  it.scrollIntoView({block: 'center'});
  const r = it.getBoundingClientRect(), x = r.x + r.width / 2, y = r.y + r.height / 2;
  const there = document.elementFromPoint(x, y);
  return there && (it.contains(there) || there.contains(it)) ? [x, y] : null;
})"""
"""Where the last thing is that has a text, or what is `inside` its row [px]; null while something else is there."""


class Browser:
    """One page; what went wrong in it is kept in `errors`."""

    def __init__(self, program: str, profile: Path, size: tuple[int, int]) -> None:
        """Start `program` with a window of a `size` [px], and a `profile` of its own, which holds what it downloads."""
        from websockets.sync.client import connect

        args = ["--headless=new", "--no-sandbox", "--enable-unsafe-swiftshader", "--remote-debugging-port=0"]
        args += [f"--user-data-dir={profile}", f"--window-size={size[0]},{size[1]}", "about:blank"]
        self._process = subprocess.Popen([program, *args], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        said = profile / "DevToolsActivePort"
        self.wait(lambda: said.exists() and said.read_text().count("\n"))
        with urllib.request.urlopen(f"http://127.0.0.1:{said.read_text().split()[0]}/json", timeout=SLOW) as answer:
            tabs = json.load(answer)
        address = next(tab["webSocketDebuggerUrl"] for tab in tabs if tab["type"] == "page")
        self._socket = connect(address, max_size=None, proxy=None)
        self._numbers, self.errors = itertools.count(1), list[str]()
        for domain in ("Page", "Runtime", "Log"):
            self.do(f"{domain}.enable")
        for domain in ("Browser", "Page"):  # newer and older browsers
            self.do(f"{domain}.setDownloadBehavior", behavior="allow", downloadPath=str(profile))
        shape = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": False}
        self.do("Emulation.setDeviceMetricsOverride", **shape)

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
        self.wait(lambda: self.js("document.readyState") == "complete")

    @property
    def text(self) -> str:
        """What can be read."""
        return self.js("document.body.innerText")

    def click(self, label: str, inside: str = "", seconds: float = SLOW) -> None:
        """Click what has a text, or what `inside` (a CSS selector) its row is meant, as a mouse does."""
        find = f"{ROW}({json.dumps(label)}, {json.dumps(inside)})"
        places: list[Any] = [None]

        def rests() -> bool:
            places.append(self.js(find))
            return places[-1] is not None and places[-1] == places[-2]

        if not self.wait(rests, seconds):
            raise TimeoutError(f"no control '{label}'")
        x, y = places[-1]
        for kind in ("mousePressed", "mouseReleased"):
            self.do("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def choose(self, label: str, option: str) -> None:
        """Choose of a list, which a folder that still opens shuts again."""
        for _ in range(3):
            self.click(label, "input")
            with suppress(TimeoutError):
                return self.click(option, seconds=10.0)
        raise TimeoutError(f"no '{option}' in '{label}'")

    def enter(self, label: str, value: str) -> None:
        """Write a number beside a slider, again where a folder that still opens has dropped it."""
        for _ in range(3):
            self.click(label, "input:not([type=hidden]):not([type=range])")
            self.js("(window.entered = document.activeElement).select()")
            self.do("Input.insertText", text=value)
            for kind in ("rawKeyDown", "keyUp"):
                self.do("Input.dispatchKeyEvent", type=kind, code="Enter", key="Enter", windowsVirtualKeyCode=13)
            self.js("document.activeElement.blur()")
            time.sleep(1.0)
            if self.js(f"window.entered.isConnected && Number(window.entered.value) === {float(value)}"):
                return
        raise TimeoutError(f"'{label}' does not keep {value}")

    def picture(self, width: int) -> NDArray[np.uint8]:
        """Return (h, width, 3) BGR, the left part of what is seen."""
        shot = base64.b64decode(self.do("Page.captureScreenshot", format="png")["data"])
        return np.asarray(cv2.imdecode(np.frombuffer(shot, np.uint8), cv2.IMREAD_COLOR), np.uint8)[:, :width]

    @staticmethod
    def wait(condition: Callable[[], object], seconds: float = SLOW) -> bool:
        """Wait until something is so; return whether it came to be."""
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                return False
            time.sleep(0.2)
        return True
