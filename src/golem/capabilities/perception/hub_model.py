"""Models of the `transformers` library, from a folder that the user has: nothing is fetched from any network."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from golem.errors import ConfigError, MissingExtra

EXTRA = "vision"


def load_model(folder: Path, kind: str, model: str, processor: str) -> tuple[Any, Any]:
    """Return a network in inference mode, and the processor that feeds it.

    Args:
        folder: as `save_pretrained` writes it: configuration, weights, tokenizer and preprocessor.
        kind: `model_type` that the configuration has to have.
        model: name of the network's class in `transformers`.
        processor: name of the processor's class.

    Raises:
        MissingExtra: transformers or torch is not installed.
        ConfigError: the folder holds no such model.
    """
    try:
        import torch  # noqa: F401  (the library tells its absence late)
        import transformers  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise MissingExtra((error.name or "transformers").partition(".")[0], EXTRA) from error
    folder = folder.expanduser()
    if not (folder / "config.json").is_file():
        raise ConfigError(
            f"{folder} holds no model: it has no config.json. Give the folder that save_pretrained wrote."
        )
    try:
        found = transformers.PretrainedConfig.get_config_dict(folder, local_files_only=True)[0].get("model_type")
    except (OSError, ValueError) as error:
        raise ConfigError(f"{folder / 'config.json'} cannot be read as a model's configuration.") from error
    if found != kind:
        raise ConfigError(f"{folder} holds a model of type {found!r}; wanted is {kind!r}.")
    try:
        network = getattr(transformers, model).from_pretrained(folder, local_files_only=True)
        feeder = getattr(transformers, processor).from_pretrained(folder, local_files_only=True)
    except Exception as error:  # the library's errors have no common base
        text = str(error).strip().partition("\n")[0]
        raise ConfigError(f"The model in {folder} cannot be loaded: {type(error).__name__}: {text}") from error
    return network.eval(), feeder
