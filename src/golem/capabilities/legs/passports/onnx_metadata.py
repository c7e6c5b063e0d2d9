"""An ONNX network with metadata, as mjlab and BeyondMimic export it."""

from __future__ import annotations

import re
from pathlib import Path

from golem.capabilities.legs.description import ActionScaling, Description
from golem.capabilities.legs.gait import GaitConfig
from golem.capabilities.legs.network import onnx_session
from golem.capabilities.legs.passports import base
from golem.errors import ConfigError

NAME = "ONNX with metadata (mjlab, BeyondMimic)"
NEEDED = ("joint_names", "joint_stiffness", "joint_damping", "default_joint_pos", "action_scale", "observation_names")
KEYS = base.KEYS_OF["onnx_metadata"]


def read(path: Path, network: Path | None) -> base.Passport:
    """Return the passport in the metadata of `path`, or of `network` if that has some.

    Raises ConfigError: no network, metadata that are missing, or that cannot be meant.
    """
    found = dict(onnx_session(path).get_modelmeta().custom_metadata_map)
    absent = [key for key in NEEDED if key not in found]
    if absent:
        raise ConfigError(
            f"The network {path} lacks the metadata {', '.join(absent)}: export it with mjlab's metadata, or name a "
            "description (YAML) and give the network to it."
        )
    names = base.joint_names(_words(found["joint_names"]))
    rows = {key: _numbers(key, found[key], len(names)) for key in NEEDED[1:5]}
    terms = _words(found["observation_names"])
    scales = _words(found.get("observation_terms_scale", ""))
    clips = _words(found.get("observation_terms_clip", found.get("observation_term_clip", "")))
    lengths = _words(found.get("observation_terms_history_length", ""))
    assumed = ["The rate is 50 Hz.", base.FOLLOWS]
    if "joint_pos" in terms:
        assumed.append("joint_pos is relative to default_joint_pos.")
    if any(length not in ("", "0.000", "1.000", "0", "1") for length in lengths):
        assumed.append("Past ticks are laid out term by term, the oldest first.")
    if {"phase", "gait_phase"} & set(terms):
        assumed.append(f"The gait clock has a period of {base.PERIOD:g} s and never rests; the sine comes first.")
    observation = tuple(
        base.read_term(name, names, names, _value(scales, i), _value(clips, i), _value(lengths, i) or 1, relative=True)
        for i, name in enumerate(terms)
    )
    description = Description(
        network=path.name,
        observation=observation,
        posture=base.by_motor(names, rows["default_joint_pos"]),
        kp=base.of_legs(names, rows["joint_stiffness"]),
        kd=base.of_legs(names, rows["joint_damping"]),
        action=ActionScaling(base.of_legs(names, rows["action_scale"])),
        gait=GaitConfig(base.PERIOD, start="always" if any(t.term == "phase" for t in observation) else "never"),
        envelope=base.ASSUMED_TWISTS,
        joints=names,
    )
    keys = KEYS | {str(i): f"metadata observation_names, {name}" for i, name in enumerate(terms)}
    return base.Passport(NAME, path, description, network or path, tuple(assumed), keys)


def said_joints(path: Path) -> tuple[str, ...]:
    """Return the joints in the metadata of `path`; none without them. Raises ConfigError: it cannot be read."""
    if path.suffix != ".onnx" or not path.is_file():
        return ()
    said = onnx_session(path).get_modelmeta().custom_metadata_map.get("joint_names", "")
    return tuple(word.rpartition("/")[2] for word in _words(said))


def _words(text: str) -> list[str]:
    """Split at commas that are in no bracket."""
    return [word.strip() for word in re.split(r",(?![^\[(]*[\])])", text)] if text else []


def _numbers(key: str, text: str, size: int) -> tuple[float, ...]:
    row = [_number(key, word) for word in _words(text)]
    return base.numbers(f"metadata {key}", row if len(row) > 1 else row[0] if row else None, size)


def _value(words: list[str], i: int) -> float | list[float] | None:
    """Return the number or the list that word `i` is; None where there is none."""
    if i >= len(words):
        return None
    inner = re.split(r"[;,]", words[i].strip("[]()"))
    row = [_number("observation_terms", word) for word in inner]
    return row if len(row) > 1 else row[0]


def _number(key: str, word: str) -> float:
    try:
        return float(word)
    except ValueError as error:
        raise ConfigError(f"The metadata {key} has a word '{word.strip()}' where a number belongs.") from error
