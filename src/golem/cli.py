"""The command line: `golem COMMAND [options]`.

Only the chosen command is imported: help answers at once, and spawned workers import this module again.
"""

from __future__ import annotations

import importlib
import os
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import tyro

from golem.errors import GolemError, ModuleFault, SlowModule, unknown_name

T = TypeVar("T")

BAD_INPUT = 2
"""Exit code for everything a user can cause."""
FAILED = 1
"""Exit code of a command that ran but did not reach its goal."""
INTERRUPTED = 130


def _demo(words: list[str]) -> int:
    """The robot finds loosened screws, pulls them and drops them in the tray, in front of you."""
    _prepare_graphics()
    from golem.demo import DemoConfig, run_demo

    return 0 if run_demo(_parse(DemoConfig, "demo", words)).success else FAILED


def _run(words: list[str]) -> int:
    """Run a stack file once, in lock-step or with the live view."""
    _prepare_graphics()
    from golem.run import RunConfig, run_stack

    return 0 if run_stack(_parse(RunConfig, "run", words)).success else FAILED


def _ladder(words: list[str]) -> int:
    """Compare methods on one rung of the capability ladder, on the same seeds."""
    _prepare_graphics()
    from golem.evaluation.harness.ladder import LadderConfig, run_ladder

    config = _parse(LadderConfig, "ladder", words)
    result = run_ladder(config)
    print(result.summary.text())
    print(f"Report: {result.report}")
    if config.json:
        print(result.summary.json())
    return 0


def _compare(words: list[str]) -> int:
    """Compare two ladder runs on the same seeds, e.g. tether with stand."""
    from golem.evaluation.metrics.compare import CompareConfig, run_compare

    run_compare(_parse(CompareConfig, "compare", words))
    return 0


@dataclass(frozen=True)
class ExportConfig:
    """Write the robot model to a file."""

    out: Path
    """The file to write."""
    format: str = "mjcf"
    """urdf or mjcf."""
    hands: bool = True
    """With the MAGPIE hands."""


def _model(words: list[str]) -> int:
    """Export the robot model as URDF or MJCF."""
    if words and words[0] not in ("export", "-h", "--help"):
        raise unknown_name("model command", words[0], ["export"])
    config = _parse(ExportConfig, "model export", words[1:] if words[:1] == ["export"] else ["--help"])
    from golem.robots.model.export import export

    export(config.format, config.hands, config.out)
    print(f"Wrote {config.out}")
    return 0


def _bench(words: list[str]) -> int:
    """Print every performance figure beside its reference; `bench push|legs|estimation|dds` test one thing each."""
    _prepare_graphics()
    if words[:1] == ["push"]:
        from golem.evaluation.push_bench import PushBenchConfig, run_push_bench

        run_push_bench(_parse(PushBenchConfig, "bench push", words[1:]))
    elif words[:1] == ["legs"]:
        from golem.evaluation.leg_bench import LegBenchConfig, run_leg_bench

        run_leg_bench(_parse(LegBenchConfig, "bench legs", words[1:]))
    elif words[:1] == ["estimation"]:
        from golem.evaluation.estimation import EstimationConfig, run_estimation

        run_estimation(_parse(EstimationConfig, "bench estimation", words[1:]))
    elif words[:1] == ["dds"]:
        from golem.evaluation.speed.dds_bench import DdsBenchConfig, run_dds_bench

        run_dds_bench(_parse(DdsBenchConfig, "bench dds", words[1:]))
    else:
        from golem.evaluation.speed.bench import BenchConfig, run_bench

        run_bench(_parse(BenchConfig, "bench", words))
    return 0


def _train(words: list[str]) -> int:
    """Train a module from scratch: detector or legs."""
    what = words[0] if words else ""
    if what in ("-h", "--help"):
        print(f"usage: golem train {{{','.join(TRAINERS)}}} [options]")
        return 0
    if what not in TRAINERS:
        raise unknown_name("thing to train", what, TRAINERS)
    _prepare_graphics()
    from golem.errors import MissingExtra

    try:
        trainer = importlib.import_module(TRAINERS[what])
    except ModuleNotFoundError as error:
        raise MissingExtra(error.name or "torch", "train") from error
    trainer.main(words[1:])
    return 0


TRAINERS = {"detector": "golem.training.detector.__main__", "legs": "golem.training.legs.__main__"}
"""What can be trained, and the module that does it."""


def _twin(words: list[str]) -> int:
    """Put the simulated robot on a DDS domain, with the wall clock."""
    _prepare_graphics()
    from golem.runtime.live.process import TwinConfig, run_twin

    run_twin(_parse(TwinConfig, "twin", words))
    return 0


def _safety(words: list[str]) -> int:
    """Guard the robot on a domain; `safety activate|stop|reset|press|release|status|take` asks the one that does."""
    from golem.runtime.live import operator

    if words[:1] == ["take"]:
        return 0 if operator.run_take(_parse(operator.TakeConfig, "safety take", words[1:])) else FAILED
    if words and words[0] in operator.REQUESTS:
        config = _parse(operator.RequestConfig, f"safety {words[0]}", words[1:])
        return 0 if operator.run_request(words[0], config) else FAILED
    from golem.runtime.live.process import SafetyConfig, run_safety

    run_safety(_parse(SafetyConfig, "safety", words))
    return 0


def _up(words: list[str]) -> int:
    """Run everything of a stack file that decides what the robot on a domain does."""
    from golem.runtime.live.process import UpConfig, run_up

    run_up(_parse(UpConfig, "up", words))
    return 0


def _launch(words: list[str]) -> int:
    """Start twin, safety and up for a stack file, and watch over them."""
    from golem.runtime.live.launch import LaunchConfig, run_launch

    return 0 if run_launch(_parse(LaunchConfig, "launch", words)) else FAILED


def _restart(words: list[str]) -> int:
    """Restart one process of a launched robot: twin, safety or up."""
    from golem.runtime.live.operator import RestartConfig, run_restart

    return 0 if run_restart(_parse(RestartConfig, "restart", words)) else FAILED


def _skill(words: list[str]) -> int:
    """Let the robot on a domain do something: pick, walk or stand."""
    from golem.runtime.live.skill_client import read_errand, run_errand

    errand = read_errand(words)
    return 0 if errand is None else run_errand(errand)


def _topics(words: list[str]) -> int:
    """List what is on a domain, with rates and bytes."""
    from golem.runtime.live.topic_stats import TopicStatsConfig, run_topic_stats

    run_topic_stats(_parse(TopicStatsConfig, "topics", words))
    return 0


def _record(words: list[str]) -> int:
    """Record a domain into a bag that ROS 2 tools and Foxglove read."""
    from golem.runtime.live.record_commands import RecordConfig, run_record

    return 0 if run_record(_parse(RecordConfig, "record", words)) else FAILED


def _replay(words: list[str]) -> int:
    """Play a bag onto a domain."""
    from golem.runtime.live.record_commands import ReplayBagConfig, run_replay

    return 0 if run_replay(_parse(ReplayBagConfig, "replay", words)) else FAILED


def _view(words: list[str]) -> int:
    """Show a domain live in Foxglove."""
    from golem.runtime.live.foxglove_view import ViewConfig, run_view

    run_view(_parse(ViewConfig, "view", words))
    return 0


def _doctor(words: list[str]) -> int:
    """Say what this machine lacks to run GOLEM, and the line that brings it."""
    _parse(_NoOptions, "doctor", words)
    from golem.doctor import run

    return run()


@dataclass(frozen=True)
class _NoOptions:
    """Say what this machine lacks to run GOLEM, and the line that brings it."""


COMMANDS: dict[str, Callable[[list[str]], int]] = {
    "demo": _demo,
    "run": _run,
    "ladder": _ladder,
    "compare": _compare,
    "model": _model,
    "bench": _bench,
    "train": _train,
    "twin": _twin,
    "safety": _safety,
    "up": _up,
    "launch": _launch,
    "restart": _restart,
    "skill": _skill,
    "topics": _topics,
    "record": _record,
    "replay": _replay,
    "view": _view,
    "doctor": _doctor,
}


def main() -> None:
    """Run the command line; what a user can cause ends in one sentence and exit code 2."""
    warnings.showwarning = _show_warning
    try:
        code = _dispatch(sys.argv[1:])
    except GolemError as error:
        print(f"golem: {error}", file=sys.stderr)
        if isinstance(error, ModuleFault) and error.trace:
            print(error.trace, file=sys.stderr)
        code = BAD_INPUT
    except BrokenPipeError:  # whoever read what is printed has gone, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = FAILED
    except KeyboardInterrupt as interrupt:
        print(f"golem: {interrupt or 'interrupted'}", file=sys.stderr)
        code = INTERRUPTED
    sys.exit(code)


def _show_warning(message: Warning | str, category: type[Warning], *rest: Any) -> None:
    if issubclass(category, SlowModule):
        print(f"golem: {message}", file=sys.stderr)
    else:
        _SHOW_WARNING(message, category, *rest)


_SHOW_WARNING = warnings.showwarning


def _dispatch(words: list[str]) -> int:
    if not words or words[0] in ("-h", "--help"):
        print("usage: golem COMMAND [options]     (golem COMMAND --help tells the options)\n")
        for name, command in COMMANDS.items():
            print(f"  {name:8s} {command.__doc__}")
        return 0 if words else BAD_INPUT
    if words[0] == "--version":
        from golem import __version__

        print(__version__)
        return 0
    if words[0] not in COMMANDS:
        raise unknown_name("command", words[0], COMMANDS)
    return COMMANDS[words[0]](words[1:])


def _parse(kind: type[T], name: str, words: list[str]) -> T:
    return tyro.cli(kind, prog=f"golem {name}", args=words)


def _prepare_graphics() -> None:
    """Choose a rendering backend that this machine has, before MuJoCo is imported and chooses another."""
    from golem.robots.mujoco.gl import choose_backend

    choose_backend()
