"""Tables that lie beside the code as YAML."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

import yaml

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""The same in C, where PyYAML has it: every process reads some."""


def load_data(package: str | None, name: str) -> Any:
    """Return the content of the YAML file `name` in a package, the `__package__` of who asks."""
    return yaml.load((files(package or "") / name).read_text(encoding="utf-8"), _LOADER)
