"""The environment in several processes, each with robots of its own, over one table in shared memory."""

from __future__ import annotations

import signal
import time
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any

import numpy as np

from golem.errors import ConfigError, GolemError
from golem.native import Records
from golem.training.legs.disturbances import NUM_UPPER, Difficulty
from golem.training.legs.env import KNOWN, SEEN, EnvConfig, LegsEnv
from golem.types import LEGS

GRACE = 5.0
"""Time that a process has to end by itself [s]."""
ROW = np.dtype(
    [
        ("observed", "f8", (SEEN.size,)),
        ("known", "f8", (KNOWN,)),
        ("action", "f8", (LEGS.stop,)),
        ("speeds", "f8", (NUM_UPPER,)),
        ("steered", "?"),
        *((name, "f8") for name in ("reward", "age", "error")),
        *((name, "?") for name in ("ended", "truncated", "walking", "stepping")),
    ],
    align=True,
)
"""One robot: what legs and critic see now; what legs and, where it is `steered`, upper body are to do next; and of the
last step the reward, the age of the episode [s], the distance from the commanded velocity [m/s], and flags."""


class ShardedEnv:
    """`n` robots in `shards` processes, or in this one if there is one; shard k is a `LegsEnv` of its own.

    Attributes:
        rows: (n,) of `ROW`, those of the first shard first.
        difficulty: of the disturbances, from the next step on.
        terms: mean of each reward term in the last step.
        cpu: time that the processes have taken, this one not included [s].
    """

    def __init__(self, n: int, config: EnvConfig, seed: int, shards: int) -> None:
        """Start every robot; shard k begins with `(seed, k)`. Raises ConfigError: they cannot be shared out evenly."""
        if shards < 1 or n % shards:
            raise ConfigError(f"--shards is a divisor of the number of robots, {n}, not {shards}.")
        # Not forked: threads of PyTorch would be missing in the child.
        context, size = get_context("spawn"), n // shards
        memory = context.RawArray("b", n * ROW.itemsize)
        self.rows: Records = np.frombuffer(memory, ROW)
        self.difficulty = Difficulty()
        self.terms: dict[str, float] = {}
        self.cpu = 0.0
        self._alone = _Shard(self.rows, config, (seed, 0)) if shards == 1 else None
        self._links: list[Connection] = []
        self._processes: list[SpawnProcess] = []
        for k in range(shards if shards > 1 else 0):
            link, theirs = context.Pipe()
            rows = slice(k * size, (k + 1) * size)
            process = context.Process(target=_work, args=(memory, rows, config, (seed, k), theirs), daemon=True)
            process.start()
            theirs.close()
            self._links.append(link)
            self._processes.append(process)
        self._hear()

    def step(self) -> None:
        """Let every robot act as its row says, or start anew after its episode. Raises GolemError: a process died."""
        self._tell(None)

    def reseed(self, steps: int) -> None:
        """Begin with other draws, those of a run that goes on after `steps`. Raises GolemError: a process has died."""
        self._tell(steps)

    def close(self) -> None:
        """End the processes; calling it again does nothing."""
        for link in self._links:
            link.close()
        for process in self._processes:
            process.join(GRACE)
            if process.is_alive():
                process.kill()
                process.join()

    def _tell(self, steps: int | None) -> None:
        if self._alone is not None:
            self.terms = self._alone.turn(self.difficulty, steps)
            return
        for link in self._links:
            with suppress(OSError):  # it says so below
                link.send((self.difficulty, steps))
        self._hear()

    def _hear(self) -> None:
        heard = list[tuple[dict[str, float], float]]()
        for k, (link, process) in enumerate(zip(self._links, self._processes, strict=True)):
            try:
                heard.append(link.recv())
            except (EOFError, OSError) as error:
                process.join(GRACE)
                raise GolemError(
                    f"Shard {k + 1} of {len(self._links)} of the training has died (exit code {process.exitcode}); "
                    f"the same command goes on from the last checkpoint."
                ) from error
        if heard:
            self.terms = {name: float(np.mean([terms[name] for terms, _ in heard])) for name in heard[0][0]}
            self.cpu = sum(cpu for _, cpu in heard)


class _Shard:
    """Some of the robots, and their `rows`."""

    def __init__(self, rows: Records, config: EnvConfig, seed: tuple[int, int]) -> None:
        self._rows, self._seed = rows, seed
        self._env = LegsEnv(len(rows), config, seed, 1)
        self._look()

    def turn(self, difficulty: Difficulty, steps: int | None) -> dict[str, float]:
        """Act once, or begin anew after `steps`; return the mean of each reward term."""
        env, rows = self._env, self._rows
        env.difficulty, terms = difficulty, dict[str, float]()
        if steps is None:
            steered = np.flatnonzero(rows["steered"])
            step = env.step(rows["action"], steered, rows["speeds"][steered])
            rows["reward"], rows["ended"], rows["truncated"] = step.reward, step.ended, step.truncated
            terms = step.terms
            rows["age"], rows["walking"], rows["stepping"] = env.age, env.walking, env.gait.stepping
            rows["error"] = np.linalg.norm((env.world.truth.heading_velocity() - env.twist)[:, :2], axis=1)
            env.restart(np.flatnonzero(step.ended | step.truncated))
        else:
            env.reseed((self._seed[0], steps, self._seed[1]))
        self._look()
        return terms

    def _look(self) -> None:
        self._rows["observed"], self._rows["known"] = self._env.observe()


def _work(memory: Any, rows: slice, config: EnvConfig, seed: tuple[int, int], link: Connection) -> None:
    """Take turns until the trainer hangs up."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the trainer, which then hangs up
    shard, terms = _Shard(np.frombuffer(memory, ROW)[rows], config, seed), dict[str, float]()
    with suppress(EOFError, OSError):
        while True:
            link.send((terms, time.process_time()))
            terms = shard.turn(*link.recv())
