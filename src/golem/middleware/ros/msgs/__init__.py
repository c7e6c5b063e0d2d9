"""Message classes by ROS package, e.g. `from golem.middleware.ros.msgs.sensor_msgs import Image`.

A class is made when it is first asked for, from `definitions.json`; `scripts/generate_messages.py` writes it and the
stubs of the packages.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from golem.middleware.ros.message import Definition, message_class, short

DEFINITIONS: dict[str, Definition] = json.loads((Path(__file__).parent / "definitions.json").read_text("utf-8"))
"""Constants and fields of every type held here, as of ROS 2 Jazzy."""


class Package(ModuleType):
    """The module of the messages of one ROS package."""

    def __getattr__(self, attribute: str) -> type[Any]:
        """Make the class of that name."""
        name = _NAMES.get((self.__name__.rsplit(".", 1)[1], attribute))
        if name is None:
            raise AttributeError(f"module {self.__name__!r} has no attribute {attribute!r}")
        made = message_class(name, DEFINITIONS[name], held, self.__name__)
        setattr(self, attribute, made)
        return made

    def __dir__(self) -> list[str]:
        return sorted(attribute for package, attribute in _NAMES if self.__name__.endswith(f".{package}"))


def held(name: str) -> type[Any]:
    """Return the class of a type, one of `DEFINITIONS`."""
    return getattr(sys.modules[f"{__name__}.{name.split('/')[0]}"], short(name))


_NAMES = {(name.split("/")[0], short(name)): name for name in DEFINITIONS}
for _package, _ in _NAMES:
    globals()[_package] = sys.modules.setdefault(f"{__name__}.{_package}", Package(f"{__name__}.{_package}"))
