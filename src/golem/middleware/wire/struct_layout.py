"""Messages of fixed size as one numpy dtype each: the whole CDR image, encapsulation header included.

XCDR1 aligns every member to its own size, counted from the end of the 4-byte encapsulation header, so that a message
without strings and sequences always has the same bytes at the same place. Offsets below count from the header's end.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import DTypeLike, NDArray

from golem.errors import GolemError
from golem.middleware.dds.base import ENCAPSULATION, Payload

Image = NDArray[np.void]
"""A 0-dimensional structured array: one message. Indexing it by a field's name gives a view."""
Fields = Mapping[str, tuple[int, DTypeLike]]
"""Offset and type by name."""


class WireError(GolemError):
    """A payload is not what its type says it is, or a value cannot be sent."""


def structure(size: int, fields: Fields) -> np.dtype[np.void]:
    """Return the dtype of a structure of `size` bytes; fields may overlap, bytes without a field are padding."""
    formats, offsets = [kind for _, kind in fields.values()], [offset for offset, _ in fields.values()]
    return np.dtype({"names": list(fields), "formats": formats, "offsets": offsets, "itemsize": size})


def check_encapsulation(payload: Payload, type_name: str) -> None:
    """Check that `payload` begins as little-endian XCDR1 does. Raises WireError: it does not.

    The two option bytes are not looked at: Cyclone counts in them how many bytes it padded.
    """
    if bytes(payload[:2]) != ENCAPSULATION[:2]:
        raise WireError(
            f"A {type_name} is little-endian XCDR1, header {ENCAPSULATION[:2].hex(' ')}, "
            f"not {bytes(payload[:2]).hex(' ') or 'empty'}."
        )


class StructLayout:
    """One message type of fixed `size`, in bytes of a payload, in which `dtype` says where its fields are."""

    def __init__(self, type_name: str, size: int, fields: Fields) -> None:
        """Describe the type whose CDR body has `size` bytes and `fields` at their offsets in the body."""
        header = len(ENCAPSULATION)
        self.type_name = type_name
        self.size = header + size
        shifted = {name: (header + offset, kind) for name, (offset, kind) in fields.items()}
        self.dtype = structure(self.size, shifted)

    def blank(self) -> bytearray:
        """Return a new payload with all fields zero, to be filled through `read`."""
        return bytearray(ENCAPSULATION + bytes(self.size - len(ENCAPSULATION)))

    def check(self, payload: Payload) -> None:
        """Check encapsulation and length of `payload`. Raises WireError: one of them is wrong."""
        check_encapsulation(payload, self.type_name)
        # Cyclone pads every payload to a multiple of four.
        if len(payload) not in (self.size, -(-self.size // 4) * 4):
            raise WireError(f"A {self.type_name} has {self.size} bytes, not {len(payload)}.")

    def read(self, payload: Payload) -> Image:
        """Return the image that `payload` holds, as a view of it: what is written to it changes a `bytearray`.

        Copies of the image lack what no field covers, the encapsulation for one. Raises WireError: its encapsulation or
        its length is wrong.
        """
        self.check(payload)
        return np.frombuffer(payload, self.dtype, count=1).reshape(())
