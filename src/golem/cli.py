"""The command line: `golem COMMAND [options]`.

Only the chosen command is imported: help answers at once, and spawned workers import this module again.
"""

from __future__ import annotations

import importlib
import json
import os
import shutil
import sys
import warnings
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, TypeVar, cast

from golem.errors import GolemError, ModuleFault, SlowModule, check_known, unknown_name

T = TypeVar("T")

BAD_INPUT = 2
"""Exit code for everything a user can cause."""
FAILED = 1
"""Exit code of a command that ran but did not reach its goal."""
INTERRUPTED = 130
_TABLES = json.loads(Path(__file__).with_name("commands.json").read_text(encoding="utf-8"))
BENCHES, DEVICES, MODEL_COMMANDS = (
    cast("dict[str, tuple[str, str, str]]", _TABLES[name]) for name in ("bench", "drivers", "model")
)
"""What is measured on its own, has a driver, is done with a model: its module, its options, and what runs it."""
TRAINERS: dict[str, str] = _TABLES["train"]
"""What can be trained, and the module that does it."""


def _demo(words: list[str]) -> int:
    """The robot pulls loosened screws from a pack in front of you; --walk: to one; --pack: it empties one."""
    _prepare_graphics()
    from golem.demo import DemoConfig, run_demo

    config = _parse(DemoConfig, "demo", words)
    if config.pack:
        from golem.demo_pack import run_pack_demo

        return 0 if run_pack_demo(config) else FAILED
    if config.walk:
        from golem.demo_walk import run_walk_demo

        return 0 if run_walk_demo(config) else FAILED
    return 0 if run_demo(config) else FAILED


def _run(words: list[str]) -> int:
    """Run a stack file once, in lock-step or with the live view; `--skill NAME` and its goal say what to do."""
    if words and not words[0].startswith("-"):
        from golem.stack import load_stack

        skills = load_stack(words[0]).all_skills  # refuses before the twin is imported
        for option, name in zip(words, words[1:], strict=False):
            if option == "--skill" and name not in skills and not name.startswith("-"):
                raise unknown_name("skill", name, skills)
    _prepare_graphics()
    from golem.run import read_run, run_stack
    from golem.skills.base import REFUSED

    result = run_stack(*read_run(words))
    return 0 if result.success else BAD_INPUT if result.stage == REFUSED else FAILED


def _ladder(words: list[str]) -> int:
    """Compare methods on one rung of the capability ladder, on the same seeds."""
    from golem.evaluation.rung_table import refuse_early

    refuse_early(words)
    _prepare_graphics()
    from golem.evaluation.harness.ladder import read_ladder, run_ladder

    config = read_ladder(words)
    if config.show is not None:
        from golem.run import show_trial

        return 0 if show_trial(config).success else FAILED
    result = run_ladder(config)
    print(result.text(min(max(shutil.get_terminal_size((100, 24)).columns, 80), 120)))
    print(f"Report: {result.report}" if result.report else result.note)
    if config.json:
        print(result.summary.json())
    return 0


def _blame(words: list[str]) -> int:
    """Say which modules lost the trials of a ladder run: they are run again with modules exchanged for truth."""
    _prepare_graphics()
    from golem.evaluation.blame.blame_command import BlameConfig, after_ladder, run_blame

    return _exit_code(run_blame(_parse(BlameConfig, "blame", after_ladder(words))))


def _faults(words: list[str]) -> int:
    """Try every fault against the safety layer: the rung `faults`, with its options; --live: real processes."""
    if "--live" in words:
        from golem.evaluation.faults.live_faults import LiveFaultsConfig, run_live_faults

        return 0 if run_live_faults(_parse(LiveFaultsConfig, "faults", words)) else FAILED
    return _ladder(["--rung", "faults", *words])


def _model(words: list[str]) -> int:
    """Export the robot model as URDF or MJCF, or cover a robot with spheres: `model export`, `model spheres`."""
    return _one_of(words, "model", "model command", MODEL_COMMANDS)


def _bench(words: list[str]) -> int:
    """Print figures of performance next to their references; `bench arms`, `bench grasp`, ...: those of one part."""
    _prepare_graphics()
    if words and words[0] in BENCHES:
        return _one_of(words, "bench", "bench", BENCHES)
    if words and not words[0].startswith("-"):
        raise unknown_name("bench", words[0], BENCHES)
    from golem.evaluation.speed.bench import BenchConfig, run_bench

    run_bench(_parse(BenchConfig, "bench", words))
    return 0


def _train(words: list[str]) -> int:
    """Train a module from scratch: act, detector, grasps or legs."""
    what = _named(words, "train", "thing to train", TRAINERS)
    if what is None:
        return 0
    _prepare_graphics()
    from golem.errors import MissingExtra

    try:
        trainer = importlib.import_module(TRAINERS[what])
    except ModuleNotFoundError as error:
        raise MissingExtra(error.name or "torch", "train") from error
    trainer.main(words[1:])
    return 0


def _record(words: list[str]) -> int:
    """Record a domain into a bag that ROS 2 tools and Foxglove read; --lerobot DATASET: into a data set."""
    if "--lerobot" in words:
        return _dataset(["live", *(word for word in words if word != "--lerobot")])
    from golem.runtime.live.record_commands import RecordConfig, run_record

    return _exit_code(run_record(_parse(RecordConfig, "record", words)))


def _dataset(words: list[str]) -> int:
    """Data sets in LeRobot's format: `dataset record`, live, export, import, check, delete, split, merge."""
    _prepare_graphics()
    from golem.datasets import commands

    name = _named(words, "dataset", "thing to do with a data set", commands.COMMANDS)
    return 0 if name is None else _exit_code(commands.run(name, words[1:]))


def _safety(words: list[str]) -> int:
    """Run a robot's safety gate; `safety activate|stop|reset|...` asks it, `safety console` is quick."""
    from golem.runtime.live import operator

    if words[:1] == ["console"]:
        return _exit_code(operator.run_console(_parse(operator.RequestConfig, "safety console", words[1:])))
    if words[:1] == ["take"]:
        return 0 if operator.run_take(_parse(operator.TakeConfig, "safety take", words[1:])) else FAILED
    if words and words[0] in operator.REQUESTS:
        config = _parse(operator.RequestConfig, f"safety {words[0]}", words[1:])
        return 0 if operator.run_request(words[0], config) else FAILED
    if words and not words[0].startswith("-"):
        raise unknown_name("request to the safety gate", words[0], ("console", "take", *operator.REQUESTS))
    from golem.runtime.live.safety_main import SafetyConfig, run_safety

    return _exit_code(run_safety(_parse(SafetyConfig, "safety", words)))


def _drivers(words: list[str]) -> int:
    """Put a device on a domain: `drivers camera`, `hands` and `lidar`; `drivers estop PORT` tries the e-stop board."""
    return _one_of(words, "drivers", "device", DEVICES)


def _skill(words: list[str]) -> int:
    """Call a skill of the robot on a domain; `skill --help` lists those of its stack."""
    from golem.runtime.live.skill_client import run_skill

    return run_skill(words)


def _check(words: list[str]) -> int:
    """Check modules against their contracts: `check [SLOT [USE]]`; `check policy FILE`: a trainer's leg policy."""
    if words[:1] == ["policy"]:
        from golem.evaluation.passport.policy_command import PolicyCheckConfig, run_policy_check

        return 0 if run_policy_check(_parse(PolicyCheckConfig, "check policy", words[1:])) else FAILED
    _prepare_graphics()
    from golem.evaluation.conformance.check_command import CheckConfig, run_check

    return 0 if run_check(_parse(CheckConfig, "check", words)) else FAILED


def _doctor(words: list[str]) -> int:
    """Report what this machine lacks to run GOLEM, and the line that installs it."""
    from golem.doctor import DoctorOptions, run

    if _parse(DoctorOptions, "doctor", words).compile:
        _prepare_graphics()
        from golem.evaluation.speed.compile_ahead import compile_if_cold

        print(f"Every kernel is compiled and on disk: {compile_if_cold() or 0.0:.1f} s of CPU.")
        return 0
    return run()


def _command(doc: str, module: str, names: str, graphics: bool = False) -> Callable[[list[str]], int]:
    """Return the command of a `module` that parses the first of `names`, `CONFIG:function`, and calls the second."""

    def command(words: list[str]) -> int:
        if graphics:
            _prepare_graphics()
        config, _, run = names.partition(":")
        owner = importlib.import_module(module)
        name = next(name for name, known in COMMANDS.items() if known is command)
        return _exit_code(getattr(owner, run)(_parse(getattr(owner, config), name, words)))

    command.__doc__ = doc
    return command


COMMANDS: dict[str, Callable[[list[str]], int]] = {
    name: globals()[f"_{name}"] if row is None else _command(**row) for name, row in _TABLES["commands"].items()
}
"""Every command, in the order of the help; what does more than `_command`'s is a function of this module."""


def main() -> None:
    """Run the command line; what a user can cause ends in one sentence and exit code 2."""
    warnings.showwarning = _show_warning
    try:
        code = _dispatch(sys.argv[1:])
    except GolemError as error:
        print(f"golem: {error}", file=sys.stderr)
        if isinstance(error, ModuleFault) and error.trace is not None:
            print(error.trace, file=sys.stderr)
        code = BAD_INPUT
    except BrokenPipeError:  # whoever read what is printed has gone, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = FAILED
    except KeyboardInterrupt as interrupt:
        print(f"golem: {str(interrupt) or 'interrupted'}", file=sys.stderr)
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
        print("usage: golem COMMAND [options]     (golem COMMAND --help lists the options)\n")
        for name, command in COMMANDS.items():
            print(f"  {name:9s} {command.__doc__}")
        return 0 if words else BAD_INPUT
    if words[0] == "--version":
        from golem import __version__

        print(__version__)
        return 0
    check_known("command", COMMANDS, words[0])
    return COMMANDS[words[0]](words[1:])


def _named(words: list[str], command: str, what: str, names: Collection[str]) -> str | None:
    """Return which of `names` the first of `words` is; None where help was asked for, which is printed."""
    word = words[0] if words else ""
    if word in ("-h", "--help"):
        print(f"usage: golem {command} {{{','.join(names)}}} [options]")
        return None
    check_known(what, names, word)
    return word


def _one_of(words: list[str], command: str, what: str, table: Mapping[str, tuple[str, str, str]]) -> int:
    """Run what the first of `words` names in `table` with the options that follow."""
    name = _named(words, command, what, table)
    if name is None:
        for each, (module, config, _) in table.items():
            print(f"  {each:10} {getattr(importlib.import_module(module), config).__doc__.splitlines()[0]}")
        return 0
    module, config, run = table[name]
    owner = importlib.import_module(module)
    return _exit_code(getattr(owner, run)(_parse(getattr(owner, config), f"{command} {name}", words[1:])))


def _exit_code(done: object) -> int:
    """Return what a command ends with that says whether, or how often, it did what it is for, or nothing."""
    return FAILED if isinstance(done, int) and not done else 0


def _parse(kind: type[T], name: str, words: list[str]) -> T:
    import tyro  # takes half a second, in which Ctrl-C has no `main` to end in

    return tyro.cli(kind, prog=f"golem {name}", args=words)


def _prepare_graphics() -> None:
    """Choose a rendering backend that this machine has, before MuJoCo is imported and chooses another."""
    from golem.robots.mujoco.gl import choose_backend

    choose_backend()
