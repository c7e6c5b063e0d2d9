"""Picks for a while beside ROS that listens to everything: `python -m tests.interop.soak --minutes 30`.

Prints what came of every topic, what was lost of it by its rate in robot time, how late it was, and the memory of each
process every few minutes.
"""

from __future__ import annotations

import argparse
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

from tests.domains import free_domain
from tests.interop.peers import SETUPS, Ros
from tests.interop.rows import cdr

from golem.interfaces import public
from golem.middleware.ros import codec

EVERY = 300.0
"""Time between two looks at the memory [s]."""
PATIENCE = 300.0
"""Time that a pick may take by the clock of the wall [s]."""
IN_REACH = 3
"""Loose screws of a new robot that the right hand brings to the tray: after so many it has a new robot again."""
PICKED = "succeeded"
PICK, ACTION = "golem_interfaces/action/Pick", "/skill/pick"


class Robot:
    """`golem launch tether`, whose lines go to a file."""

    def __init__(self, domain: int) -> None:
        """Start it, and wait until it may move."""
        self._domain, self._log = domain, Path("soak.log")
        command = [sys.executable, "-m", "golem", "launch", "tether", "--domain", str(domain)]
        with self._log.open("w") as log:
            self.launch = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)
        while "Safety gate: active" not in self._log.read_text():
            if self.launch.poll() is not None:
                raise RuntimeError("golem launch has ended, see soak.log")
            time.sleep(0.5)

    def golem(self, *words: str) -> int:
        """Run `golem WORDS` on its domain, and return the exit code."""
        command = [sys.executable, "-m", "golem", *words, "--domain", str(self._domain)]
        return subprocess.run(command, capture_output=True, check=False).returncode

    def renew(self) -> None:
        """Put a new robot in the place of this one, with all its screws."""
        self.golem("restart", "twin")
        for _ in range(20):
            self.golem("safety", "reset")
            if self.golem("safety", "activate") == 0:
                return
            time.sleep(2.0)

    def memory(self) -> dict[str, float]:
        """Return the resident memory of its processes [MB]."""
        told: dict[str, float] = {}
        for status in Path("/proc").glob("[0-9]*/status"):
            try:
                words = (status.parent / "cmdline").read_text().split("\0")
                found = re.search(r"VmRSS:\s+(\d+)", status.read_text())
            except OSError:
                continue
            if "golem" in words and str(self._domain) in words and found is not None:
                told[" ".join(words[words.index("golem") :][1:3])] = int(found[1]) / 1024
        return told

    def close(self) -> None:
        """End it."""
        self.launch.send_signal(signal.SIGINT)
        self.launch.wait(60)


def main() -> None:
    """Pick, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--setup", choices=list(map(str, SETUPS)), default=str(SETUPS[0]))
    options = parser.parse_args()
    setup = next(setup for setup in SETUPS if str(setup) == options.setup)
    with free_domain() as domain:
        robot = Robot(domain)
        ros = Ros(setup, domain)
        try:
            rows = {row.name: row for row in public.TOPICS}
            for row in rows.values():
                qos: dict[str, Any] = {"reliable": row.qos.reliable, "transient_local": row.qos.transient_local}
                ros.do("listen", name=row.name, type=row.type, keep=0, depth=row.qos.depth, **qos)
            memory, ended = [robot.memory()], Counter[str]()
            goal = cdr(codec.action(PICK).Goal("screw", "tray", "right"))
            begin, taken = time.monotonic(), 0
            end = begin + 60.0 * options.minutes
            while time.monotonic() < end:
                given = ros.do("give", name=ACTION, type=PICK, goal=goal)
                if not given.get("accepted"):
                    ended[f"not accepted: {given}"] += 1
                    break
                ros.tell("outcome", name=ACTION, timeout=PATIENCE)
                answer = ros.hear(timeout=PATIENCE + 30.0)
                how = f"no outcome came within {PATIENCE:g} s"
                if answer["done"]:
                    told = bytes.fromhex(answer["result"])
                    result = codec.deserialize(told, codec.action(PICK).Result).result
                    how = PICKED if result.success else f"{result.stage}: {result.reason}"
                ended[how] += 1
                print(f"{time.monotonic() - begin:7.1f} s: {how}", file=sys.stderr)
                taken = taken + 1 if how == PICKED else IN_REACH
                if taken == IN_REACH:
                    robot.renew()
                    taken = 0
                if time.monotonic() > begin + EVERY * len(memory):
                    memory.append(robot.memory())
            memory.append(robot.memory())
            clock = ros.do("came", name="/clock")["robot_time"]
            print(f"{setup}, {options.minutes:g} min by the clock of the wall, {clock:.0f} s of robot time heard\n")
            print("\n".join(f"- {count} x {text}" for text, count in ended.items()))
            print(
                "\n| topic | came | of | longest gap [s] | latency: median [ms] | p99 [ms] |\n|---|---|---|---|---|---|"
            )
            for row in rows.values():
                came = ros.do("came", name=row.name)
                if came["count"]:
                    due = "" if row.rate is None else f"{row.rate * (came['robot_time'] or clock):.0f}"
                    late = (f"{1e3 * came[what]:.1f}" for what in ("median", "p99"))
                    print(f"| `{row.name}` | {came['count']} | {due} | {came['gap']:.2f} | {' | '.join(late)} |")
            print(f"\n| process | memory [MB], every {EVERY:g} s, and at the end |\n|---|---|")
            for name in memory[0]:
                print(f"| {name} | {', '.join(f'{at.get(name, 0.0):.0f}' for at in memory)} |")
        finally:
            ros.close()
            robot.close()


if __name__ == "__main__":
    main()
