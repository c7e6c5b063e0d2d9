"""Recognises what a trainer wrote, and returns the policy's passport."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast

from golem.capabilities.legs.description import check_description, load_description, shipped
from golem.capabilities.legs.network import load_network
from golem.capabilities.legs.passports import isaac_lab, onnx_metadata, unitree_deploy, unitree_gym
from golem.capabilities.legs.passports.base import Passport
from golem.errors import ConfigError
from golem.options import read_yaml

OWN = "GOLEM's description"
SCRIPTED = "TorchScript of a known layout"
LAYOUTS = ("unitree_rl_gym", "almi_open")
"""Shipped descriptions of public checkpoints: a bare TorchScript file is one of them, by how much it takes."""
_MISREAD = (ArithmeticError, AttributeError, LookupError, StopIteration, TypeError, ValueError)
_YAML: dict[str, Callable[[Path, Mapping[str, Any], Path | None], Passport]] = {
    unitree_deploy.MARK: unitree_deploy.read,
    isaac_lab.MARK: isaac_lab.read,
    unitree_gym.MARK: unitree_gym.read,
}


def read_passport(file: str | Path, network: str | Path | None = None) -> Passport:
    """Read what is known about a policy.

    Args:
        file: an ONNX network with metadata, a TorchScript one of a known layout, a YAML file of a known format, or the
            name of a shipped description.
        network: path of the network, instead of the one that belongs to `file`.

    Raises:
        ConfigError: it cannot be read, is of no known format, or says what cannot be meant.
        MissingExtra: the network is a TorchScript file, and torch is not installed.
    """
    path = Path(file).expanduser()
    other = Path(network).expanduser() if network else None
    own = str(file) in shipped()
    if not own and path.suffix in (".onnx", ".pt") and not path.is_file():
        raise ConfigError(f"There is no policy {path}; {', '.join(shipped())} are shipped ones.")
    try:
        passport = None if own else _foreign(path, other)
        if passport is not None:
            check_description(passport.description)
            return passport
    except ConfigError as error:
        raise ConfigError(str(error) if str(file) in str(error) else f"{file}: {error}") from error
    except _MISREAD as error:  # a list where a mapping belongs, a step of zero: a file may hold anything
        raise ConfigError(f"{file} is not as its trainer's program writes it ({error!r}).") from error
    description, found = load_description(file, network)
    keys = {str(i): t.term for i, t in enumerate(description.observation)}
    keys |= {"action.scale": "action", "action.clip": "action", "action.targets": "action", "twist": "twist"}
    return Passport(OWN, path, description, found, (), keys)


def _foreign(path: Path, network: Path | None) -> Passport | None:
    """Return the passport of a trainer's file; None where it is a description of ours, or nothing that can be read."""
    if path.suffix == ".onnx":
        return onnx_metadata.read(path, network)
    if path.suffix == ".pt":
        return _scripted(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None
    data = read_yaml(text, str(path), foreign=True)
    if not isinstance(data, Mapping):
        return None
    known = cast("Mapping[str, Any]", data)
    reader = next((read for mark, read in _YAML.items() if mark in known), None)
    return None if reader is None else reader(path, known, network)


def _scripted(path: Path) -> Passport:
    for name in LAYOUTS:
        description, _ = load_description(name)
        try:
            load_network(path, description.layout().size)
        except ConfigError:
            continue
        said = f"By what the network takes, everything else is as in the shipped description '{name}'."
        return Passport(SCRIPTED, path, description, path, (said,))
    raise ConfigError(
        f"The network {path} takes what no known checkpoint does ({', '.join(LAYOUTS)}): name its description (YAML) "
        "and give the network to it."
    )
