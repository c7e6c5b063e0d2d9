"""`golem new SLOT NAME`: a module that runs, its test and a stack with it, to start from."""

from __future__ import annotations

import keyword
import re
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import tyro

from golem.errors import ConfigError, OutputError, check_known
from golem.evaluation.conformance.examine import SUITES
from golem.package_data import load_data

TEMPLATES = "templates"
SLOT_HELP = f"Which slot the module is for: {', '.join(SUITES)}."


@dataclass(frozen=True)
class NewConfig:
    """Write a module, its test and a stack with it into the present folder."""

    slot: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SLOT", help=SLOT_HELP)]
    """Which slot the module is for."""
    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="NAME")]
    """What it is called: lower-case words joined by _, e.g. my_grasp."""


def run_new(config: NewConfig, folder: Path = Path()) -> list[Path]:
    """Write the three files into `folder`; return their paths.

    Raises:
        ConfigError: there is no such slot, the name is none that Python can import, or a file is there already.
        OutputError: they cannot be written.
    """
    slot, name = config.slot, config.name
    check_known("slot", SUITES, slot)
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        raise ConfigError(f"A module's name is lower-case words joined by _ and no word of Python's; not '{name}'.")
    words = {"slot": slot, "name": name, "cls": "".join(word.capitalize() for word in name.split("_"))}
    templates = resources.files(__package__ or "") / TEMPLATES
    source = (templates / f"{slot}.py.txt").read_text(encoding="utf-8").replace("Mine", words["cls"])
    texts: dict[str, Any] = load_data(__package__, f"{TEMPLATES}/texts.yaml")
    files = {
        folder / f"{name}.py": source,
        folder / f"test_{name}.py": texts["test"].format(**words),
        folder / f"{name}.yaml": texts["stacks"].get(slot, texts["stack"]).format(**words),
    }
    if there := [path.name for path in files if path.exists()]:
        raise ConfigError(f"{there[0]} is there already; choose another name, or another folder.")
    try:
        for path, text in files.items():
            path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"Nothing can be written into {folder}: {error.strerror}.") from error
    print(f"Wrote {', '.join(path.name for path in files)}. Next:")
    print(f"  golem check {slot} {name}.py:{words['cls']}")
    print(f"  python -m pytest test_{name}.py    # needs pytest: pip install pytest")
    print("  " + texts["run"].get(slot, "golem run {name}.yaml").format(**words))
    if slot in texts["compare"]:
        print("  " + texts["compare"][slot].format(**words))
    return list(files)
