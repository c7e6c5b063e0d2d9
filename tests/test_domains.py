"""Tests that share a machine share no DDS domain."""

from __future__ import annotations

import subprocess
import sys

from tests.domains import DOMAINS, free_domain

PROGRAM = """
import sys
from tests import domains
domains.DOMAINS = [int(sys.argv[1])]
with domains.free_domain() as domain:
    print(domain)
"""


def other_process(domain: int) -> subprocess.CompletedProcess[str]:
    """Let another process ask for this very domain."""
    return subprocess.run([sys.executable, "-c", PROGRAM, str(domain)], capture_output=True, text=True, check=False)


def test_a_domain_in_use_is_nobody_elses_until_it_is_given_back() -> None:
    with free_domain() as domain:
        assert domain in DOMAINS
        assert "is in use by a test" in other_process(domain).stderr
    assert other_process(domain).stdout == f"{domain}\n"


def test_a_process_gets_another_domain_each_time() -> None:
    with free_domain() as first:
        pass
    with free_domain() as second, free_domain() as third:
        assert len({first, second, third}) == 3
