"""The actions of a policy as time passes: chunks that are asked for ahead, and come as late as they are declared."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from golem.capabilities.policies.onnx_policy import OnnxPolicy
from golem.capabilities.policies.openpi import PolicyLinkConfig, PolicyServer
from golem.capabilities.policies.vectors import TWIST, ActionRefused, check_actions
from golem.errors import ServiceUnavailable
from golem.types import Array

C = TypeVar("C", bound=PolicyLinkConfig)
DRIVEN = 0.5
"""Time for which the base goes on without an answer [s]: as long as legs follow a twist that nobody repeats."""


class ActionPolicy(Protocol):
    """Whoever answers observations."""

    def infer(self, observation: Mapping[str, Any]) -> Any:
        """Return a chunk of actions (n, 25) for an observation; see `vectors`. Raises ServiceUnavailable: no answer."""
        ...


def open_policy(config: C) -> tuple[PolicyServer | OnnxPolicy, C]:
    """Return the policy that `config` names, and the options with what its file says.

    Raises:
        ConfigError: the file is none.
        MissingExtra: the extra `policy` is not installed.
    """
    if not config.file:
        return PolicyServer(config), config
    policy = OnnxPolicy(Path(config.file))
    return policy, replace(config, cameras=(policy.camera,), fps=policy.fps)


def check_near(goal: Array, pose: Array, far: float) -> None:
    """Check that a hand at `pose` may go to `goal`, (4, 4) each. Raises ActionRefused: it is over `far` [m] away."""
    away = float(np.linalg.norm(goal[:3, 3] - pose[:3, 3]))
    if away > far:
        raise ActionRefused(f"The policy sends a hand {away:.2f} m away in one step; {far:g} m is the most.")


class ActionStream:
    """Asks a policy on a thread of its own, and says which action is due.

    On the clock the answer to an observation of time t counts from t + latency on, whatever the machine needed; live it
    counts when it comes. Its i-th action is for t + i / fps: those that are over by then are left out. The last of a
    chunk stays, its twist only until the next answer is late.
    """

    def __init__(self, policy: ActionPolicy, config: PolicyLinkConfig, prompt: str = "") -> None:
        self._policy, self._config, self._prompt = policy, config, prompt
        self._pool = ThreadPoolExecutor(1, "policy")
        self._job: tuple[Future[Any], float] | None = None
        self._chunk: Array | None = None
        self._begun = 0.0

    def step(self, t: float, observe: Callable[[], dict[str, Any] | None], live: bool) -> Array | None:
        """Return the action (25,) of time `t` [s]; None before the first chunk.

        Args:
            t: time [s].
            observe: makes the observation of this moment; None where not everything has spoken yet.
            live: whether time passes by itself, so that nobody may wait here.

        Raises:
            ServiceUnavailable: the server is not there, refuses, or takes longer than it may.
            ActionRefused: what it answered is no action.
        """
        c = self._config
        if self._job is not None:
            job, asked = self._job
            if live and not job.done():
                if t - asked > c.timeout:
                    raise ServiceUnavailable(f"The policy has not answered for {c.timeout:g} s.")
            elif t >= asked + (0.0 if live else c.latency) - 1e-9:
                self._job = None
                self._chunk, self._begun = check_actions(job.result()), asked
        index = math.floor((t - self._begun) * c.fps + 1e-6)
        if self._job is None and (self._chunk is None or index >= min(c.n_action_steps, len(self._chunk))):
            seen = observe()
            if seen is not None:
                self._job = self._pool.submit(self._policy.infer, {**seen, "prompt": self._prompt}), t
                if not live and c.latency == 0.0:
                    return self.step(t, observe, live)
        if self._chunk is None:
            return None
        action = self._chunk[min(max(index, 0), len(self._chunk) - 1)].copy()
        waited = math.inf if self._job is None else t - self._job[1]
        if index >= len(self._chunk) and waited > max(c.latency, DRIVEN):
            action[TWIST] = 0.0
        return action

    def close(self) -> None:
        """Ask no more."""
        self._pool.shutdown(wait=False, cancel_futures=True)
