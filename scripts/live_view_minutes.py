"""What the live view costs beside a standing robot: `python scripts/live_view_minutes.py 30 [chromium]`.

A client that speaks the browser's protocol, or a browser of that family without a window, looks on for so many minutes,
then nobody does for three. Printed are the CPU time per robot second of both, and the memory of the process at the
beginning and at the end, and that of all processes of the browser.
"""

from __future__ import annotations

import asyncio
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import msgspec
import viser
from websockets import connect

PORT = 8097
AT = re.compile(rb"robot time ([0-9.]+) s")
LOOK = {
    "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [2.0, 1.0, 1.5], "fov": 0.75, "near": 0.1,
    "far": 100.0, "image_height": 800, "image_width": 1280, "look_at": [0.0, 0.0, 1.0], "up_direction": [0.0, 0.0, 1.0],
}  # fmt: skip
"""What a browser says before it counts as one that looks."""


def used(pid: int) -> tuple[float, float]:
    """Return CPU time [s] and memory [MB] of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"), pages * os.sysconf("SC_PAGE_SIZE") / 1e6


async def look(pid: int, seconds: float) -> list[tuple[float, float, float]]:
    """Look on; return robot time [s], CPU time [s] and memory [MB] at the beginning and at the end."""
    found = list[tuple[float, float, float]]()
    loop = asyncio.get_running_loop()
    begin = loop.time() + 2.0  # what is sent at first is of when somebody looked last
    address, protocol = f"ws://127.0.0.1:{PORT}", f"viser-v{viser.__version__}"
    async with connect(address, subprotocols=[protocol], max_size=None, origin=f"http://127.0.0.1:{PORT}") as socket:  # pyright: ignore[reportArgumentType]
        await socket.send(msgspec.msgpack.encode(LOOK))
        while loop.time() < begin + seconds or not found:
            message = await socket.recv()
            said = AT.search(message) if isinstance(message, bytes) else None
            if said is not None and loop.time() > begin:
                found[1:] = [(float(said.group(1)), *used(pid))]
    return found


def tree(pid: int) -> list[int]:
    """Return the ids of a process and of all that it began."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [pid, *(each for child in children for each in tree(int(child)))]


async def browse(robot: int, seconds: float, browser: str) -> list[tuple[float, float, float]]:
    """Keep the page open in a browser; return what `look` returns."""
    size = ("--window-size=640,400", "--enable-unsafe-swiftshader")
    with tempfile.TemporaryDirectory() as profile:
        args = [browser, "--headless=new", "--no-sandbox", *size, f"--user-data-dir={profile}"]
        page = subprocess.Popen([*args, f"http://127.0.0.1:{PORT}"], stderr=subprocess.DEVNULL)
        await asyncio.sleep(60.0)
        first = (await look(robot, 1.0))[0]
        mb = [sum(used(pid)[1] for pid in tree(page.pid))]
        await asyncio.sleep(seconds)
        mb.append(sum(used(pid)[1] for pid in tree(page.pid)))
        last = (await look(robot, 1.0))[0]
        page.terminate()
        page.wait()
    print(f"{browser}: {mb[0]:.0f} to {mb[1]:.0f} MB, of all its processes")
    return [first, last]


async def main(minutes: float, browser: Sequence[str]) -> None:
    """Print the two costs."""
    robot = subprocess.Popen(["golem", "run", "stand", "--port", str(PORT)], stdout=subprocess.DEVNULL)
    try:
        while True:  # kernels may have to be compiled
            await asyncio.sleep(5.0)
            with suppress(OSError):
                await look(robot.pid, 30.0)
                break
        looked = browse(robot.pid, 60.0 * minutes, *browser) if browser else look(robot.pid, 60.0 * minutes)
        first, last = (await looked)[:2]
        await asyncio.sleep(180.0)
        alone = (await look(robot.pid, 1.0))[0]
    finally:
        robot.kill()
    for what, (t0, cpu0, mb0), (t1, cpu1, mb1) in (("looked at", first, last), ("alone", last, alone)):
        print(f"{what}: {t1 - t0:.0f} robot s, {(cpu1 - cpu0) / (t1 - t0):.3f} CPU s each, {mb0:.0f} to {mb1:.0f} MB")


asyncio.run(main(float(sys.argv[1]), sys.argv[2:]))
