from __future__ import annotations

from tests.dashboard.conftest import standing, twin, walker

__all__ = ["standing", "twin", "walker"]
