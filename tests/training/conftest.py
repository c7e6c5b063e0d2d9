"""Loads what torch's optimisers load, before any test renders: Triton's LLVM crashes where Mesa's is loaded already."""

from __future__ import annotations

import contextlib
import importlib

with contextlib.suppress(ImportError):
    importlib.import_module("torch._dynamo")
