"""The training loop: the legs against their disturbances, and later against a learned upper body."""

from __future__ import annotations

import csv
import os
import time
from contextlib import closing
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch

from golem.errors import ConfigError
from golem.evaluation.harness.run_folder import make_folder
from golem.native import Records
from golem.provenance import commit
from golem.training.legs.checkpoint import CHECKPOINT, CURVE, cut_curve, read_checkpoint
from golem.training.legs.env import KNOWN, PERIOD, SEEN, TASKS, EnvConfig, Task
from golem.training.legs.export_policy import load_actor
from golem.training.legs.mirror import Mirror, leg_mirror, upper_mirror
from golem.training.legs.ppo import Actor, Ppo, PpoConfig
from golem.training.legs.sharded_env import ShardedEnv

Adversary = Literal["none", "motions", "learned"]
Device = Literal["auto", "cpu", "cuda"]
SAVED = 60.0
"""Time between checkpoints [s]."""
VALUES_FIRST = 5e5
"""Steps in which a critic that begins from nothing learns what an exported network is worth: 40 updates [own]."""
EXPORTED_PUSH = 0.5
"""Share of the largest push with which the training of an exported network begins: what it has met before."""
EXPORTED_NOISE = 0.2
"""Largest exploration noise of such a run: 0.45 undoes what the network can."""
EXPORTED_RAMP = (5e5, 4e6)
"""Steps between which its pushes grow to their full range."""


@dataclass(frozen=True)
class TrainLegsConfig:
    """One training run.

    Attributes:
        out: folder of checkpoint and curve; a run whose folder holds a checkpoint goes on from it.
        seed: of weights, episodes and noise.
        task: what is learned: to walk as told, on even or on rough ground, or to stand against pushes.
        steps: actions of all robots together, those of `start` included.
        robots: how many are simulated at once.
        shards: processes that simulate them, each with draws of its own: one per core is fastest.
        device: of networks and experience; auto is a GPU where PyTorch finds one, else the CPU.
        seconds: of wall clock after which the run is interrupted, its checkpoint written.
        start: what this run begins with, exploring with `noise` or, from an exported one,
            with `EXPORTED_NOISE`: networks and steps of another run's checkpoint, or a
            network that was exported. A run from an exported network counts its steps from none, is at full difficulty
            at once, learned adversary included, but for pushes, which grow from `EXPORTED_PUSH`, and changes the
            network after `VALUES_FIRST` steps only: until then it has no critic worth the name.
        adversary: who works against the legs through the upper body: `none` (it rests at home, ready or straight, its
            hands empty), `motions` (the curriculum of motions and payloads), or `learned` (that, and a policy that
            moves half of the robots once `learned_from` steps are done).
        learned_from: steps after which the learned adversary begins.
        push_ramp, motion_ramp: steps before which pushes, and motions and payloads of the upper body, are light, and
            after which they have their full range. They grow whether or not the robot survives: tied to survival, as
            ALMI has it, the pushes went up and down below half, and beside full pushes the motions never grew.
        strict_ramp: steps between which fast legs get their price where the sum of the rewards is negative, too.
        noise_ramp, noise: steps before the end at which the bound of the legs' exploration noise begins to fall, and
            has fallen, and the bound before and after. How to stand to the millimetre cannot be learned while the
            joints tremble by 0.1 rad.
    """

    out: Path = Path("runs/legs/seed0")
    seed: int = 0
    task: Task = "walk"
    steps: float = 38e6
    robots: int = 512
    shards: int = 1
    device: Device = "auto"
    seconds: float = np.inf
    adversary: Adversary = "learned"
    learned_from: float = 6e6
    start: Path | None = None
    push_ramp: tuple[float, float] = (1e6, 8e6)
    motion_ramp: tuple[float, float] = (3e6, 12e6)
    strict_ramp: tuple[float, float] = (8e6, 10e6)
    noise_ramp: tuple[float, float] = (5e6, 1.5e6)
    noise: tuple[float, float] = (0.45, 0.1)
    ppo: PpoConfig = field(default_factory=PpoConfig)


def train(config: TrainLegsConfig) -> Path:
    """Train, or go on; return the path of the checkpoint.

    Raises:
        ConfigError: fewer than two robots, no steps, no such device, or a checkpoint of another configuration in the
            folder.
        OutputError: the folder cannot be written.
    """
    if config.robots < 2 or config.steps < 1 or config.seconds <= 0.0:
        raise ConfigError("Training needs at least 2 robots, 1 step and more than 0 seconds.")
    found = torch.cuda.is_available()
    if config.device == "cuda" and not found:
        raise ConfigError("--device cuda is not there; auto takes it where it is, cpu is everywhere.")
    config = replace(config, device="cuda" if found and config.device != "cpu" else "cpu")
    make_folder(config.out)
    # Sums of several threads differ in their last bits, and threads of a busy machine wait for each other.
    torch.set_num_threads(1)
    torch.manual_seed(config.seed)
    path = config.out / CHECKPOINT
    with closing(_Run(config)) as run:
        if path.exists():
            run.load(path)
        else:
            if config.start is not None:
                run.begin_with(config.start)
            (config.out / CURVE).unlink(missing_ok=True)  # of a run that died before its first checkpoint
        began = saved = time.monotonic()
        while run.steps < config.steps and time.monotonic() - began < config.seconds:
            run.update()
            if time.monotonic() - saved > SAVED:
                run.save(path)
                saved = time.monotonic()
        run.save(path)
    return path


class _Run:
    """Everything that changes while a run goes on."""

    def __init__(self, config: TrainLegsConfig) -> None:
        self.config = config
        self._exported = config.start is not None and config.start.suffix == ".onnx"
        self._codes = [commit()]
        self.steps = 0
        self.updates = 0
        self._cpu = 0.0
        seen, ppo, half, on = Mirror(SEEN.components), config.ppo, config.robots // 2, config.device
        legs, upper = Actor(seen, leg_mirror(), ppo.hidden, ppo.noise), Actor(seen, upper_mirror(), ppo.hidden, 0.6)
        self.legs = Ppo(legs, KNOWN, config.robots, ppo, config.seed, on)
        self.upper = Ppo(upper, KNOWN, half, ppo, config.seed + 1, on)
        self._survival = self._seconds = 0.0
        self.env = ShardedEnv(config.robots, TASKS[config.task], config.seed, config.shards)
        self._harden()
        self._log: list[dict[str, float]] = []

    def update(self) -> None:
        """Let every robot act `ppo.steps` times, then improve both players."""
        config, env, rows = self.config, self.env, self.env.rows
        began, spent, clock = time.process_time(), env.cpu, time.monotonic()
        learned = config.adversary == "learned" and self._progress >= config.learned_from
        steered = rows[: config.robots // 2]
        steered["steered"] = learned
        self.legs.bound_noise(self._largest_noise)
        meter = _Meter(TASKS[config.task].episode)
        for _ in range(config.ppo.steps):
            rows["action"] = self.legs.act(rows["observed"], rows["known"])
            if learned:
                steered["speeds"] = self.upper.act(steered["observed"], steered["known"])
            env.step()
            meter.add(rows, env.terms)
            self.legs.learn_of(rows["reward"], rows["ended"], rows["truncated"])
            if learned:
                self.upper.learn_of(-steered["reward"], steered["ended"], steered["truncated"])
        sound = not self._exported or self.steps >= VALUES_FIRST
        stats = self.legs.update(rows["observed"], rows["known"], sound)
        if learned:
            self.upper.update(steered["observed"], steered["known"])
        self.steps += config.ppo.steps * config.robots
        self.updates += 1
        if meter.finished:
            share = min(1.0, meter.finished / 64.0)
            self._survival += share * 0.5 * (meter.lasted / meter.finished - self._survival)
        self._harden()
        self._cpu += time.process_time() - began + env.cpu - spent
        self._seconds += time.monotonic() - clock
        row = {"steps": self.steps, "cpu_s": self._cpu, "wall_s": self._seconds, "survival": self._survival}
        row |= {"learned_adversary": float(learned)} | asdict(env.difficulty) | stats | meter.row()
        self._log.append({name: float(value) for name, value in row.items()})
        if self.updates % 10 == 0:
            self._write()

    def close(self) -> None:
        """End the processes of the environment."""
        self.env.close()

    def save(self, path: Path) -> None:
        """Write the checkpoint, whole or not at all."""
        self._write()
        part = path.with_suffix(".part")
        torch.save(
            {
                "legs": self.legs.state(),
                "upper": self.upper.state(),
                "steps": self.steps,
                "updates": self.updates,
                "cpu": self._cpu,
                "wall": self._seconds,
                "survival": self._survival,
                "config": _plain(self.config),
                "env": _plain(TASKS[self.config.task]),
                "codes": self._codes,
            },
            part,
        )
        os.replace(part, path)

    def load(self, path: Path) -> None:
        """Go on from a checkpoint, with new episodes. Raises ConfigError: of another seed, network, task or reward."""
        saved = read_checkpoint(path)
        free = ("out", "steps", "device", "seconds")
        mine = {k: v for k, v in _plain(self.config).items() if k not in free}
        if mine != {k: v for k, v in saved["config"].items() if k not in free}:
            raise ConfigError(f"{path} was made with another configuration; choose another --out.")
        if saved.get("env") != _plain(TASKS[self.config.task]):
            raise ConfigError(
                f"{path} was made with other rewards or another world; choose another --out, or the code of then."
            )
        before = saved.get("codes", ["unknown"])
        if before[-1] != self._codes[-1]:
            print(f"This run was begun by the code of commit {before[-1]} and goes on with that of {self._codes[-1]}.")
            self._codes = [*before, *self._codes]
        else:
            self._codes = before
        cut_curve(self.config.out / CURVE, saved["steps"])
        self.legs.load(saved["legs"])
        self.upper.load(saved["upper"])
        self.steps, self.updates, self._cpu = saved["steps"], saved["updates"], saved["cpu"]
        self._survival, self._seconds = saved["survival"], saved["wall"]
        self._harden()
        self.env.reseed(self.steps)

    def begin_with(self, path: Path) -> None:
        """Take over networks and steps of another run's checkpoint, or a network that was exported.

        Configuration, draws and noise are this run's own. Raises ConfigError: it has other layers, as many steps as
        this run is to have, or this run is too short to change anything.
        """
        actor = load_actor(path).state_dict()
        if {k: v.shape for k, v in actor.items()} != {k: v.shape for k, v in self.legs.actor.state_dict().items()}:
            raise ConfigError(f"{path} has other layers than this run; give it those with --ppo.hidden.")
        if self._exported:
            if self.config.steps <= VALUES_FIRST:
                raise ConfigError(
                    f"From an exported network --steps is more than {VALUES_FIRST:g}: until then only a critic learns."
                )
            self.legs.actor.load_state_dict(actor)
            self.legs.set_noise(EXPORTED_NOISE)
            return
        saved = read_checkpoint(path)
        self.steps = saved["steps"]
        if self.steps >= self.config.steps:
            raise ConfigError(
                f"{path} has {self.steps:.4g} steps already; --steps, which counts them, is {self.config.steps:.4g}."
            )
        self.legs.take_networks(saved["legs"])
        self.upper.take_networks(saved["upper"])
        self.legs.set_noise(self.config.noise[0])
        self._harden()

    @property
    def _largest_noise(self) -> float:
        """Bound of the standard deviation of the legs' actions."""
        start, end = self.config.noise
        begins, ends = self.config.noise_ramp
        left = self.config.steps - self.steps
        if left > begins:
            return np.inf
        return float(np.interp(left, (ends, begins), (end, EXPORTED_NOISE if self._exported else start)))

    @property
    def _progress(self) -> float:
        """Steps by which the difficulty goes; who was trained before meets it in full."""
        return np.inf if self._exported else self.steps

    def _harden(self) -> None:
        """Set the difficulty of the disturbances by the steps that were done."""
        config, difficulty = self.config, self.env.difficulty
        if self._exported:
            difficulty.push = float(np.interp(self.steps, EXPORTED_RAMP, (EXPORTED_PUSH, 1.0)))
        else:
            difficulty.push = float(np.interp(self._progress, config.push_ramp, (0.05, 1.0)))
        difficulty.strictness = float(np.interp(self._progress, config.strict_ramp, (0.0, 1.0)))
        motion = float(np.interp(self._progress, config.motion_ramp, (0.05, 1.0)))
        motion = 0.0 if config.adversary == "none" else motion
        difficulty.amplitude = difficulty.speed = difficulty.payload = motion

    def _write(self) -> None:
        if not self._log:
            return
        path = self.config.out / CURVE
        new = not path.exists()
        with path.open("a", newline="") as file:
            writer = csv.DictWriter(file, list(self._log[0]))
            if new:
                writer.writeheader()
            for row in self._log:
                writer.writerow({name: f"{value:.5g}" for name, value in row.items()})
        shown = ("steps", "cpu_s", "falls", "error_moving", "error_standing", "survival", "push", "std", "reward")
        print("  ".join(f"{name} {self._log[-1][name]:.4g}" for name in shown), flush=True)
        self._log.clear()


class _Meter:
    def __init__(self, episode: float) -> None:
        self._episode = episode
        self.finished, self.lasted = 0, 0.0
        self._falls = 0
        self._seconds = 0.0
        self._moving: list[float] = []
        self._standing: list[float] = []
        self._stepping: list[float] = []
        self._rewards: list[float] = []
        self._terms: list[dict[str, float]] = []

    def add(self, rows: Records, terms: dict[str, float]) -> None:
        """Count one step of all robots."""
        self._falls += int(rows["ended"].sum())
        over = rows["ended"] | rows["truncated"]
        self.lasted += float(rows["age"][over].sum() / self._episode)
        self.finished += int(over.sum())
        self._seconds += PERIOD * len(rows)
        moving, error = rows["walking"], rows["error"]
        known = np.isfinite(error)
        for errors, who in ((self._moving, moving & known), (self._standing, ~moving & known)):
            errors.append(float(error[who].mean()) if who.any() else 0.0)
        self._stepping.append(float(rows["stepping"][~moving].mean()) if (~moving).any() else 0.0)
        self._rewards.append(float(rows["reward"].mean()))
        self._terms.append(terms)

    def row(self) -> dict[str, float]:
        """Return the means; falls per robot second, errors in m/s."""
        out = {
            "falls": self._falls / self._seconds,
            "error_moving": float(np.mean(self._moving)),
            "error_standing": float(np.mean(self._standing)),
            "steps_standing": float(np.mean(self._stepping)),
            "reward": float(np.mean(self._rewards)),
        }
        return out | {f"r_{name}": float(np.mean([terms[name] for terms in self._terms])) for name in self._terms[0]}


def _plain(config: TrainLegsConfig | EnvConfig) -> dict[str, Any]:
    """Return `config` as data that any later version can read."""

    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: plain(inner) for name, inner in value.items()}
        if isinstance(value, tuple):
            return [plain(inner) for inner in value]
        return str(value) if isinstance(value, Path) else value

    return plain(asdict(config))
