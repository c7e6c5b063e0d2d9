"""Runs a suite in a user's own tests: one test per promise.

In a test file, one line is enough:

    test_my_grasp = conformance_tests("grasp_method", "my_grasp.py:Mine")
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from golem.evaluation.conformance.base import SKIPPED, Check, Report
from golem.evaluation.conformance.examine import candidate, examine, promises


def conformance_tests(slot: str, use: str) -> Callable[..., None]:
    """Return a test function that asks every promise of the contract of `slot`, each as a test of its own.

    Args:
        slot: the slot, e.g. `"upper_body"`.
        use: the module: `file.py:Class` (from where pytest is called), `package.module:Class`, a registered name, or
            `{use: NAME, option: value, ...}`.

    Raises:
        ConfigError: there is no such slot.
    """
    reports: list[Report] = []

    @pytest.mark.parametrize("promise", promises(slot), ids=lambda check: check.name)
    def test(promise: Check) -> None:
        if not reports:
            reports.append(examine(candidate(slot, use)))
        (report,) = reports
        if report.lacks is not None:
            pytest.skip(report.lacks)
        finding = next(finding for finding in report.findings if finding.check == promise.name)
        if finding.status == SKIPPED:
            pytest.skip(finding.reason)
        if finding.reason:
            trace = "" if finding.trace is None else f"\n{finding.trace}"
            pytest.fail(f"{promise.promise}\n{slot}: {use}: {finding.reason}{trace}", pytrace=False)

    test.__doc__ = f"{slot}: {use} keeps the promises of its contract."
    return test
