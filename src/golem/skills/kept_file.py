"""Files that a skill keeps: whoever calls the skill names the file, the stack alone says in which folder."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from golem.errors import ConfigError, shorten

_PLAIN = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,63}")


@dataclass(frozen=True, slots=True)
class KeptFileConfig:
    """Where a skill keeps files.

    Attributes:
        folder: the only folder that it writes to; by default the one that the process was started in.
    """

    folder: str = "."


class KeepsFiles:
    """A skill that keeps files in the folder of its options."""

    def __init__(self, config: KeptFileConfig | None = None) -> None:
        self.config = config or KeptFileConfig()


def check_file_name(name: str, ending: str = "") -> None:
    """Check the name of a file with an `ending`, such as `".json"`, that a goal asks for; the empty one asks for none.

    A goal may come from anybody on the domain, so it may not lead out of the folder of the skill. Raises ConfigError:
    it is no plain name, or ends otherwise.
    """
    if name and not (name.endswith(ending) and _PLAIN.fullmatch(name.removesuffix(ending))):
        ends = f" and '{ending}' at the end" if ending else " and no ending"
        raise ConfigError(
            f"'{shorten(name, 60)}' cannot be the name of a file: it is at most 64 letters, digits, _ and -,{ends}; "
            "the folder is the option 'folder' of the skill, in the stack file."
        )


def kept_file(folder: str, name: str, read: Callable[[Path], object]) -> Path:
    """Return the path of the file `name`, which `check_file_name` has passed, in `folder`.

    What is there already is only replaced if `read` takes it for a file of the same kind; a link never is. Raises
    ConfigError: there is a link or something else of that name.
    """
    path = Path(folder) / name
    if path.is_symlink():
        raise ConfigError(f"'{path}' is a link; choose another name.")
    if path.exists():
        try:
            read(path)
        except ConfigError as problem:
            raise ConfigError(f"'{path}' is there already and is something else; choose another name.") from problem
    return path
