"""What tests of networks from transformers share: the library, and a tokenizer of single letters."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture(scope="session")
def hub() -> Any:
    """Return transformers; the test is skipped where the extra `vision` is not installed."""
    pytest.importorskip("torch", reason="needs the extra 'vision'")
    library = pytest.importorskip("transformers", reason="needs the extra 'vision'")
    library.logging.disable_progress_bar()
    return library


@pytest.fixture(scope="session")
def letter_tokenizer(hub: Any) -> Callable[[Path, int], Any]:
    """Return what writes CLIP's tokenizer of single letters into a folder, for words up to a length."""

    def write(folder: Path, length: int) -> Any:
        letters = [chr(k) for k in range(97, 123)]
        words = [*letters, *(f"{a}</w>" for a in letters), "<|startoftext|>", "<|endoftext|>"]
        (folder / "vocab.json").write_text(json.dumps({word: k for k, word in enumerate(words)}))
        (folder / "merges.txt").write_text("#version: 0.2\n")
        vocab, merges = (str(folder / name) for name in ("vocab.json", "merges.txt"))
        return hub.CLIPTokenizer(vocab, merges, model_max_length=length)

    return write
