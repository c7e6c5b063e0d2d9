"""What only Linux has is asked for before it is used, so that the default environment also runs on macOS."""

from __future__ import annotations

import ast
from collections.abc import Iterator

import pytest
from tests.sources import FILES, SOURCE, parsed

LINUX = {
    "os": "eventfd getxattr listxattr memfd_create pidfd_open posix_fadvise sched_getaffinity sched_setaffinity "
    "sched_setscheduler setns setxattr splice timerfd_create unshare",
    "select": "epoll",
    "signal": "pidfd_send_signal sigtimedwait sigwaitinfo",
    "socket": "AF_CAN AF_NETLINK AF_PACKET IP_RECVTTL MSG_ERRQUEUE SO_BINDTODEVICE SO_MARK SO_PRIORITY TCP_QUICKACK",
    "time": "CLOCK_BOOTTIME CLOCK_TAI",
}
"""Attributes of the standard library that macOS lacks, by module."""
PLACES = ("/proc/", "/sys/", "/dev/shm", "/run/")
"""Where only Linux has files."""
LIBRARIES = ("libc.so.6", "librt.so.1")

GUARDED = {
    "datasets/own_priority.py": "only where the system has sched_setscheduler and /proc",
    "evaluation/harness/local_executor.py": "only where CAN_COPY, which asks for pidfd_open",
    "evaluation/speed/memory_bench.py": "says 0 MB elsewhere",
    "middleware/dds/interfaces.py": "the extra `dds`; None elsewhere",
    "runtime/live/process.py": "glibc alone has what it asks for; suppressed elsewhere",
}
"""Files that look before they use it, and how."""


def only_linux(text: str) -> Iterator[str]:
    """Yield what a source file names that only Linux has; `getattr` and `hasattr` look for themselves."""
    for node in ast.walk(parsed(text)):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.attr in LINUX.get(node.value.id, "").split():
                yield f"{node.value.id}.{node.attr}"
        elif isinstance(node, ast.ImportFrom):
            yield from (
                f"{node.module}.{a.name}" for a in node.names if a.name in LINUX.get(node.module or "", "").split()
            )
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            if node.value.startswith(PLACES) or node.value in LIBRARIES:
                yield node.value


def test_only_files_that_look_first_name_what_only_linux_has() -> None:
    found = {str(path.relative_to(SOURCE)): [*only_linux(path.read_text(encoding="utf-8"))] for path in FILES}
    assert {path: names for path, names in found.items() if names and path not in GUARDED} == {}
    assert [path for path in GUARDED if not found.get(path)] == []


@pytest.mark.parametrize(
    "line",
    [
        "os.pidfd_open(3)",
        "from select import epoll",
        'Path("/proc/self/stat")',
        'ctypes.CDLL("libc.so.6")',
        "time.CLOCK_TAI",
    ],
)
def test_each_kind_is_found(line: str) -> None:
    assert list(only_linux(f"{line}\n"))


def test_asking_is_not_using() -> None:
    assert not list(only_linux('import os\nif hasattr(os, "pidfd_open"):\n    pass\n'))
