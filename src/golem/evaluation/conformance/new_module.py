"""`golem new SLOT NAME`: a module that runs, its test and a stack with it, to start from."""

from __future__ import annotations

import keyword
import re
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated

import tyro

from golem.errors import ConfigError, OutputError, unknown_name
from golem.evaluation.conformance.examine import SUITES

TEMPLATES = "templates"
SLOT_HELP = f"Which slot the module is for: {', '.join(SUITES)}."
_STACKS = {
    "skill": "skills:\n  {name}: {{use: {name}.py:{cls}}}\n",
    "lower_body": "robot: {{use: mujoco, support: ground}}\nlower_body: {{use: {name}.py:{cls}}}\n",
    "mapper": """robot: {{use: mujoco, support: ground, world: furnished}}
lower_body: {{use: almi}}
odometry: {{use: lio}}
mapper: {{use: {name}.py:{cls}}}
navigator: {{use: costmap_astar}}
""",
    "memory": """robot: {{use: mujoco}}
memory: {{use: {name}.py:{cls}}}
""",
    "properties": """robot: {{use: mujoco, world: counter, support: gantry}}
localizer: {{use: clusters}}
grasp_method: {{use: antipodal}}
skills: {{take: {{use: take, tuned: true}}}}
properties: {{use: {name}.py:{cls}}}
""",
    "navigator": """robot: {{use: mujoco, support: ground, world: open}}
lower_body: {{use: almi}}
navigator: {{use: {name}.py:{cls}}}
""",
}
_STACK = "{slot}: {{use: {name}.py:{cls}}}\n"
_TEST = '''"""The promises of the contract that `{cls}` is to keep: one test each."""

from golem.evaluation.conformance.pytest_plugin import conformance_tests

test_{name} = conformance_tests("{slot}", "{name}.py:{cls}")
'''
_RUN = {
    "skill": "golem run {name}.yaml --skill {name}",
    "properties": "golem run {name}.yaml --skill take can",
    "robot": "golem run {name}.yaml --skill stand",
    "lower_body": "golem run {name}.yaml --skill stand",
    "mapper": "golem run {name}.yaml --skill navigate --x 2",
    "memory": "golem run {name}.yaml --skill remember --labels screw",
    "navigator": "golem run {name}.yaml --skill walk --x 1",
}
_COMPARE = {
    "grasp_method": "golem ladder --method visual_servo {name}.py:{cls} -n 10 --out runs/{name}",
    "lower_body": "golem ladder --rung push --method almi {name}.py:{cls} -n 10 --out runs/{name}",
    "estimator": "golem ladder --rung base-estimation --method random_walk_kf {name}.py:{cls} --out runs/{name}",
    "odometry": "golem ladder --rung odometry --method legs {name}.py:{cls} -n 1 --out runs/{name}",
    "mapper": "golem ladder --rung navigate --map none --use mapper={name}.py:{cls} -n 10 --out runs/{name}",
    "properties": "golem ladder --rung counter-tether --use properties={name}.py:{cls} -n 10 --out runs/{name}",
    "memory": "golem ladder --rung memory --method object_map {name}.py:{cls} -n 5 --out runs/{name}",
    "navigator": "golem ladder --rung navigate-line --use navigator={name}.py:{cls} -n 10 --out runs/{name}",
    **{
        slot: f"golem ladder --method visual_servo --use {slot}={{name}}.py:{{cls}} -n 10 --out runs/{{name}}"
        for slot in ("servo", "hand", "upper_body", "planner", "localizer")
    },
}
"""Measures the module on a rung of the ladder; there is none for a robot, and none for a skill but `pick`."""


@dataclass(frozen=True)
class NewConfig:
    """Write a module, its test and a stack with it into the present folder."""

    slot: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SLOT", help=SLOT_HELP)]
    """Which slot the module is for."""
    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="NAME")]
    """What it is called: lower-case words joined by _, e.g. my_grasp."""


def run_new(config: NewConfig, folder: Path) -> list[Path]:
    """Write the three files into `folder`; return their paths.

    Raises:
        ConfigError: there is no such slot, the name is none that Python can import, or a file is there already.
        OutputError: they cannot be written.
    """
    slot, name = config.slot, config.name
    if slot not in SUITES:
        raise unknown_name("slot", slot, SUITES)
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        raise ConfigError(f"A module's name is lower-case words joined by _, e.g. my_{slot}; not '{name}'.")
    words = {"slot": slot, "name": name, "cls": "".join(word.capitalize() for word in name.split("_"))}
    template = resources.files(__package__ or "") / TEMPLATES / f"{slot}.py.txt"
    source = template.read_text(encoding="utf-8").replace("Mine", words["cls"])
    files = {
        folder / f"{name}.py": source,
        folder / f"test_{name}.py": _TEST.format(**words),
        folder / f"{name}.yaml": _STACKS.get(slot, _STACK).format(**words),
    }
    for path in files:
        if path.exists():
            raise ConfigError(f"{path.name} is there already; choose another name, or another folder.")
    try:
        for path, text in files.items():
            path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"Nothing can be written into {folder}: {error.strerror}.") from error
    print(f"Wrote {', '.join(path.name for path in files)}. Next:")
    print(f"  golem check {slot} {name}.py:{words['cls']}")
    print(f"  pytest test_{name}.py")
    print("  " + _RUN.get(slot, "golem run {name}.yaml").format(**words))
    if slot in _COMPARE:
        print("  " + _COMPARE[slot].format(**words))
    return list(files)
