"""The audit log: every call, answer, question, approval and refusal, one JSON object a line, only ever added to.

Each line has the digest of the one before, so that one that was changed, or taken out of the middle, shows.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

from golem.errors import ConfigError, OutputError

LONGEST = 4000
"""Characters of the arguments of a call that are kept; of longer ones their digest says which they were [own]."""


class AuditLog:
    """Writes one file."""

    def __init__(self, file: Path, **first: object) -> None:
        """Go on with `file`; `first` says what it belongs to, such as the bag that is recorded.

        Raises:
            OutputError: it cannot be written.
            ConfigError: it was changed.
        """
        self._file, self._last = file, ""
        if file.exists():
            for entry in read_audit(file):
                self._last = entry["digest"]
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            self._out = os.open(file, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        except OSError as error:
            raise OutputError(f"Cannot write {file}: {error.strerror}.") from error
        self.write("begin", 0.0, **first)

    def write(self, event: str, t: float, **facts: object) -> None:
        """Add a line.

        Args:
            event: begin, call, ask, approve, refuse, answer, stop, end of a session, ...
            t: robot time [s].
            facts: what is kept of it, as JSON has it.
        """
        entry = {"event": event, "utc": time.time(), "t": t, **{k: _kept(v) for k, v in facts.items()}}
        entry["before"] = self._last
        entry["digest"] = self._last = _digest(entry)
        os.write(self._out, (json.dumps(entry) + "\n").encode("utf-8", "replace"))

    def close(self) -> None:
        """Close the file."""
        os.close(self._out)


def _kept(value: object) -> object:
    text = json.dumps(value, default=str)
    if len(text) <= LONGEST:
        return json.loads(text)
    return {"characters": len(text), "sha256": sha256(text.encode("utf-8", "replace")).hexdigest()}


def _digest(entry: Mapping[str, Any]) -> str:
    return sha256(json.dumps(entry, sort_keys=True).encode("utf-8", "replace")).hexdigest()


def read_audit(file: Path) -> Iterator[dict[str, Any]]:
    """Yield the lines of a log.

    Raises:
        ConfigError: it cannot be read, or a line is none or was changed; names it.
    """
    last = ""
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"The audit log '{file}' cannot be read: {error}.") from error
    for number, line in enumerate(lines, 1):
        try:
            entry = json.loads(line)
            digest = entry.pop("digest")
            fine = entry["before"] == last and digest == _digest(entry)
        except (ValueError, KeyError, AttributeError, TypeError):
            fine, entry, digest = False, {}, ""
        if not fine:
            raise ConfigError(f"Line {number} of the audit log '{file}' was changed, or the one before it taken out.")
        last = digest
        yield entry | {"digest": digest}
