"""`golem bench legs`: standing, working, walking, stopping, rough ground and endurance of the lower bodies."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from rich.console import Console
from rich.table import Table
from tyro.conf import arg

from golem.errors import ConfigError, ModuleFault, unknown_name
from golem.evaluation.campaign import Done, Result, run_campaign, write_files
from golem.evaluation.episodes.episode import LATENCY, legs_stack
from golem.evaluation.harness.arguments import replaced_modules, robot_options
from golem.evaluation.leg_tests import LOST, MISSED, TESTS, lost_in, plans
from golem.evaluation.subject import Subject, labels
from golem.provenance import commit
from golem.robots.sensors.profiles import load_profile
from golem.skills.runner import FAULT

HOUR = 3600.0


@dataclass(frozen=True)
class LegBenchConfig:
    """Test lower bodies beyond pushes; every test prints n, how many robots were lost, and what it measured.

    quiet: 60 s of standing. arms: the same with both arms sweeping and 1 kg in each hand. tracking: one twist of the
    envelope per trial, its 26 ends, edges and corners first. endurance: 60 s of random twists and shoves up to 30 N s
    per trial. slope, rubble: 10 s ahead on rough ground. stopping: at a pose 2 m away. plans: rate of the
    planner of --method mpc with several numbers of samples, one per trial.
    """

    test: tuple[str, ...] = ("quiet", "tracking", "stopping")
    """Tests to run."""
    method: tuple[str, ...] = ("almi",)
    """Lower bodies: names, file.py:Class, policy:DESCRIPTION:NETWORK, or with options "{use: NAME, option: value}"."""
    n: Annotated[int, arg(aliases=("-n",))] = 10
    """Trials per test and method."""
    profile: str = "bench"
    """Realism of sensors and actuators: ideal, bench or field."""
    latency: float = LATENCY
    """Delay of motor commands on top of the profile's [s]."""
    robot: tuple[str, ...] = ()
    """Further options of the twin, e.g. feet=box cone=elliptic, or mjcf=../h1_2.xml."""
    use: tuple[str, ...] = ()
    """Replace other modules of the stack: slot=implementation, e.g. estimator=invariant_ekf, or =mine.py:Mine."""
    seed: int = 0
    """Seed; trial i of every method meets the same draws."""
    out: Path = Path("runs/leg-bench")
    """Folder for jobs.jsonl and results.json; the same command continues an interrupted run."""
    j: Annotated[int, arg(aliases=("-j",))] = 1
    """Processes."""
    json: bool = False
    """Print the results as a last line of JSON."""


@dataclass(frozen=True, slots=True)
class LegTrial:
    """One trial of one test.

    Attributes:
        test: its name in `TESTS`.
        subject: what is tested.
        seed, index: the draws.
    """

    test: str
    subject: Subject
    seed: int
    index: int

    def run(self) -> Result:
        """Return the figures; a module that breaks its contract loses the robot."""
        try:
            found: Result = dict(TESTS[self.test](self.subject, self.seed, self.index))
        except ModuleFault as fault:
            found = {**lost_in(FAULT), "fault": str(fault)}
        return {**MISSED.get(self.test, {}), **found} if found["lost"] else found


def run_leg_bench(config: LegBenchConfig) -> list[dict[str, Any]]:
    """Run the tests, write and print the figures.

    Returns:
        One entry per test and method, see `summarise`.

    Raises:
        GolemError: an option is wrong, the folder cannot be written, or a method cannot run.
        CampaignInterrupted: Ctrl-C.
    """
    load_profile(config.profile)
    for name in config.test:
        if name not in TESTS:
            raise unknown_name("test", name, TESTS)
    if config.n < 1 or not config.test or not config.method or config.seed < 0:
        raise ConfigError("Give at least one --test, one --method, -n 1 and --seed 0.")
    for option, names in (("test", config.test), ("method", config.method)):
        if len(set(names)) < len(names):
            raise ConfigError(f"--{option} names one of them twice.")
    if plans.__name__ in config.test and (config.j, config.test, len(config.method)) != (1, ("plans",), 1):
        raise ConfigError("The test plans times the machine: give it alone, with one --method and -j 1.")
    if (
        plans.__name__ in config.test
        and legs_stack(config.method[0], config.profile).choice("lower_body").use != "mpc"
    ):
        raise ConfigError('The test plans is of the MPC: give --method mpc, or "{use: mpc, option: value}".')
    robot = {"latency": config.latency, **robot_options(config.robot)}
    use = replaced_modules(config.use)
    subjects = [Subject.of(method, config.profile, robot, use) for method in config.method]
    trials = [
        LegTrial(test, subject, config.seed, index)
        for test in config.test
        for index in range(config.n)
        for subject in subjects
    ]
    found = summarise(run_campaign(config.out, trials, config.j))
    place = {name: i for i, name in enumerate(config.test)}
    found.sort(key=lambda row: (place[row["test"]], config.method.index(row["method"])))
    options = {name: str(v) if isinstance(v, Path) else v for name, v in asdict(config).items()}
    results = {"config": options, "commit": commit(), "results": found}
    write_files(config.out, {"results.json": json.dumps(results, indent=1) + "\n"})
    names = labels(config.method)
    for row in found:
        Console().print(table(row, names[row["method"]]))
    if config.json:
        print(json.dumps(results))
    return found


def summarise(done: Sequence[Done]) -> list[dict[str, Any]]:
    """Return, per test and method, n, the lost robots by stage, and statistics of every figure."""
    grouped: dict[tuple[str, str], list[Result]] = {}
    for item in done:
        job = item.job
        assert isinstance(job, LegTrial)
        grouped.setdefault((job.test, job.subject.method), []).append(item.result)
    return [_summary(test, method, results) for (test, method), results in grouped.items()]


def _summary(test: str, method: str, results: Sequence[Result]) -> dict[str, Any]:
    names = dict.fromkeys(name for r in results for name, v in r.items() if isinstance(v, float))
    stages = [name for name in names if name.startswith(LOST)]
    row: dict[str, Any] = {
        "test": test,
        "method": method,
        "n": len(results),
        "lost": int(sum(r["lost"] for r in results)),
        "lost_in": {name.removeprefix(LOST): int(sum(r.get(name, 0.0) for r in results)) for name in stages},
        "figures": {
            name: _statistics([r[name] for r in results if name in r])
            for name in names
            if name != "lost" and name not in stages
        },
    }
    if test == "endurance":
        hours = sum(r.get("seconds", 0.0) for r in results) / HOUR
        row["robot_hours"] = hours
        row["lost_per_hour"] = row["lost"] / hours if hours else 0.0
    return row


def _statistics(values: Sequence[float]) -> dict[str, float]:
    array = np.array(values)
    return {
        "n": len(array),
        "mean": float(array.mean()),
        "rms": float(np.sqrt((array * array).mean())),
        "median": float(np.median(array)),
        "p95_size": float(np.quantile(np.abs(array), 0.95)),
        "least": float(array.min()),
        "most": float(array.max()),
    }


def table(row: Mapping[str, Any], name: str) -> Table:
    """Return the figures of one test and the method called `name` for a terminal."""
    stages = ", ".join(f"{stage} {count}" for stage, count in row["lost_in"].items())
    title = f"{row['test']}, {name}: {row['lost']} of {row['n']} lost"
    title += f" ({stages})" if stages else ""
    if "lost_per_hour" in row:
        title += f", {row['lost_per_hour']:.2f} per robot hour in {row['robot_hours']:.2f} h"
    columns = ("n", "mean", "rms", "median", "p95_size", "least", "most")
    out = Table("figure", *(c.replace("_", " of ") for c in columns), title=title)
    for name, statistics in row["figures"].items():
        out.add_row(name.replace("_", " "), *(f"{statistics[c]:.3g}" for c in columns))
    return out
