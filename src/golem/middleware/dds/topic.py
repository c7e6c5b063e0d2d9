"""Topics that advertise no type information.

A Cyclone 11 topic with type information makes Cyclone 0.10 peers (the vendor's SDK, ROS 2 Humble to Kilted) crash if
its type has an octet, and newer peers check assignability when both sides advertise it. Without it matching is by
topic and type name, as between ROS 2 nodes up to Kilted. The descriptor is that of a final struct with one octet
(Cyclone wants at least one member): Cyclone checks that there is one byte after the encapsulation header, swaps nothing
and hands on whatever follows, so one descriptor serves all types. The encoding must be little endian, which that of
every peer of ours is.
"""

from __future__ import annotations

import ctypes

from golem.middleware.dds.library import Cyclone, TopicDescriptor

_RESTRICT_DATA_REPRESENTATION = 1 << 7
"""DDS_TOPIC_RESTRICT_DATA_REPRESENTATION of dds_public_impl.h."""
_XCDR1 = 1 << 0
"""DDS_DATA_REPRESENTATION_FLAG_XCDR1."""
_PROGRAM = (0x01 << 24 | 0x01 << 16, 0, 0x00 << 24)
"""Marshalling program of dds_opcodes.h: DDS_OP_ADR | DDS_OP_TYPE_1BY, its offset; DDS_OP_RTS."""


def create_topic(library: Cyclone, participant: int, name: str, type_name: str) -> int:
    """Create a topic of opaque samples and return its entity.

    Raises:
        DdsError: Cyclone refuses, e.g. because the name has a character that topics cannot have.
    """
    program = (ctypes.c_uint32 * len(_PROGRAM))(*_PROGRAM)
    descriptor = TopicDescriptor(
        size=1,
        align=1,
        flags=_RESTRICT_DATA_REPRESENTATION,
        type_name=type_name.encode(),
        op_count=len(_PROGRAM),
        ops=program,
        data_representation=_XCDR1,
    )
    topic = library.blocking.dds_create_topic(
        participant, ctypes.byref(descriptor), name.encode(), None, None
    )
    return library.check(topic, f"Topic '{name}' cannot be created; check its name")
