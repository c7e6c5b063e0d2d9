"""Writes ONNX networks byte by byte, without the onnx package: the few messages of the format that a policy needs."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Weights = NDArray[np.float32] | NDArray[np.int64]


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes(out + bytes([value]))


def _number(key: int, value: int) -> bytes:
    return _varint(key << 3) + _varint(value)


def _bytes(key: int, value: bytes | str) -> bytes:
    data = value.encode() if isinstance(value, str) else value
    return _varint(key << 3 | 2) + _varint(len(data)) + data


def _tensor(name: str, values: Weights) -> bytes:
    kind = 1 if values.dtype == np.float32 else 7
    dims = b"".join(_number(1, n) for n in values.shape)
    return dims + _number(2, kind) + _bytes(8, name) + _bytes(9, np.ascontiguousarray(values).tobytes())


def _value(name: str, shape: Sequence[int]) -> bytes:
    dims = b"".join(_bytes(1, _number(1, n)) for n in shape)
    return _bytes(1, name) + _bytes(2, _bytes(1, _number(1, 1) + _bytes(2, dims)))


def _attribute(name: str, value: int | float) -> bytes:
    if isinstance(value, int):
        return _bytes(1, name) + _number(3, value) + _number(20, 2)
    return _bytes(1, name) + _varint(2 << 3 | 5) + struct.pack("<f", value) + _number(20, 1)


def metadata(values: Mapping[str, str]) -> bytes:
    """Return what is appended to a network's file to give it metadata."""
    return b"".join(_bytes(14, _bytes(1, key) + _bytes(2, value)) for key, value in values.items())


@dataclass
class Graph:
    """A network under construction."""

    nodes: list[bytes] = field(default_factory=list[bytes])
    weights: dict[str, Weights] = field(default_factory=dict[str, Weights])

    def add(self, kind: str, inputs: Sequence[str], *outputs: str, **attributes: int | float) -> str:
        """Add a node; return its first output."""
        body = b"".join(_bytes(1, i) for i in inputs) + b"".join(_bytes(2, o) for o in outputs)
        body += _bytes(4, kind) + b"".join(_bytes(5, _attribute(k, v)) for k, v in attributes.items())
        self.nodes.append(body)
        return outputs[0]

    def weight(self, name: str, values: object, whole: bool = False) -> str:
        """Add constant values, as float32 or, `whole`, int64; return the name."""
        self.weights[name] = np.asarray(values, dtype=np.int64) if whole else np.asarray(values, dtype=np.float32)
        return name

    def save(
        self,
        path: Path,
        inputs: Mapping[str, Sequence[int]],
        outputs: Mapping[str, Sequence[int]],
        notes: Mapping[str, str] | None = None,
    ) -> Path:
        """Write the network with the shapes of its inputs and outputs, and metadata; return `path`."""
        graph = b"".join(_bytes(1, node) for node in self.nodes) + _bytes(2, "policy")
        graph += b"".join(_bytes(5, _tensor(name, values)) for name, values in self.weights.items())
        graph += b"".join(_bytes(11, _value(name, shape)) for name, shape in inputs.items())
        graph += b"".join(_bytes(12, _value(name, shape)) for name, shape in outputs.items())
        model = _number(1, 8) + _bytes(8, _bytes(1, "") + _number(2, 17)) + _bytes(7, graph)
        path.write_bytes(model + metadata(notes or {}))
        return path
