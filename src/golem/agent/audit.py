"""The audit log: every call, answer, question, approval and refusal, one JSON object a line, only ever added to."""

from __future__ import annotations

import errno
import json
import os
import time
from hashlib import sha256
from pathlib import Path
from typing import Any

from golem.errors import ConfigError, OutputError

LONGEST = 4000
"""Characters of what is kept of a call or an answer; of longer ones their digest says which they were [own]."""
TAIL = 1 << 20
"""Longer than any line [bytes]."""


class AuditLog:
    """Writes one file, of whole lines; `problem` says why the newest entry is not in it, empty where it is."""

    def __init__(self, file: Path, **first: object) -> None:
        """Go on with `file`; `first` says what it belongs to, e.g. a bag. Raises OutputError: it cannot be written."""
        self._file, self.problem = file, ""
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            self._out = os.open(file, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o600)
            size = os.fstat(self._out).st_size
            torn = os.pread(self._out, min(size, TAIL), max(0, size - TAIL)).rpartition(b"\n")[2]
            if torn:  # the machine lost its power in the middle of a line
                os.ftruncate(self._out, size - len(torn))
                first |= {"torn": torn.decode("utf-8", "replace")}
        except OSError as error:
            raise OutputError(f"Cannot write {file}: {error.strerror}.") from error
        self.write("begin", 0.0, **first)
        if self.problem:
            self.close()
            raise OutputError(self.problem)

    def write(self, event: str, t: float, **facts: object) -> None:
        """Add what happened at robot time `t` [s], with facts as JSON has them."""
        entry = {"event": event, "utc": time.time(), "t": t, **{k: _kept(v) for k, v in facts.items()}}
        line = (json.dumps(entry) + "\n").encode("utf-8", "replace")
        try:
            written, self.problem = os.write(self._out, line), ""
            if written < len(line):  # of a full disk; half a line would spoil the next one
                os.ftruncate(self._out, os.fstat(self._out).st_size - written)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            self.problem = f"Cannot write {self._file}: {error.strerror}."

    def close(self) -> None:
        """Close the file."""
        os.close(self._out)


def _kept(value: object) -> object:
    text = json.dumps(value, default=str)
    if len(text) <= LONGEST:
        return json.loads(text)
    return {"characters": len(text), "sha256": sha256(text.encode("utf-8", "replace")).hexdigest()}


def read_audit(file: Path) -> list[dict[str, Any]]:
    """Return the lines of a log. Raises ConfigError: it cannot be read, or a line is none; names it."""
    entries: list[dict[str, Any]] = []
    try:
        for line in file.read_text(encoding="utf-8").splitlines():
            entries.append(dict(json.loads(line)))
            entries[-1]["event"]
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise ConfigError(f"The audit log '{file}' cannot be read, after {len(entries)} lines: {error}.") from error
    return entries
