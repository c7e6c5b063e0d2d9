"""Quality of service in Cyclone's own terms, set as rmw_cyclonedds sets it."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager

from golem.middleware.dds.base import Qos
from golem.middleware.dds.library import Cyclone

_KEEP_LAST, _KEEP_ALL = 0, 1
_BEST_EFFORT, _RELIABLE = 0, 1
_VOLATILE, _TRANSIENT_LOCAL = 0, 1
_UNLIMITED = -1
_XCDR1 = 0
BLOCKING_NS = 100_000_000
"""How long a reliable writer waits for a peer that is behind [ns]; DDS 1.4, table 2.2.3: 100 ms."""


@contextmanager
def cyclone_qos(library: Cyclone, qos: Qos | None, user_data: str) -> Iterator[int]:
    """Give a dds_qos_t for an endpoint, or for a participant if `qos` is None; it lives as long as the context."""
    calls = library.quick
    handle = calls.dds_create_qos()
    try:
        if user_data:
            data = user_data.encode()
            calls.dds_qset_userdata(handle, data, len(data))
        if qos is not None:
            _fill(library, handle, qos)
        yield handle
    finally:
        calls.dds_delete_qos(handle)


def _fill(library: Cyclone, handle: int, qos: Qos) -> None:
    calls = library.quick
    kind, depth = (_KEEP_ALL, _UNLIMITED) if qos.depth is None else (_KEEP_LAST, qos.depth)
    calls.dds_qset_history(handle, kind, depth)
    calls.dds_qset_reliability(handle, _RELIABLE if qos.reliable else _BEST_EFFORT, BLOCKING_NS)
    calls.dds_qset_durability(handle, _TRANSIENT_LOCAL if qos.transient_local else _VOLATILE)
    if qos.transient_local:
        limits = (_UNLIMITED, _UNLIMITED, _UNLIMITED)
        calls.dds_qset_durability_service(handle, 0, kind, depth, *limits)
    calls.dds_qset_writer_data_lifecycle(handle, False)
    calls.dds_qset_data_representation(handle, 1, (ctypes.c_int16 * 1)(_XCDR1))


def read_qos(library: Cyclone, handle: int) -> Qos:
    """Return what a dds_qos_t of an endpoint says."""
    calls = library.quick
    reliability, durability, history = (ctypes.c_int() for _ in range(3))
    depth, blocking = ctypes.c_int32(1), ctypes.c_int64()
    calls.dds_qget_reliability(handle, ctypes.byref(reliability), ctypes.byref(blocking))
    calls.dds_qget_durability(handle, ctypes.byref(durability))
    calls.dds_qget_history(handle, ctypes.byref(history), ctypes.byref(depth))
    return Qos(
        reliable=reliability.value == _RELIABLE,
        transient_local=durability.value >= _TRANSIENT_LOCAL,
        depth=None if history.value == _KEEP_ALL else max(1, depth.value),
    )


def read_user_data(library: Cyclone, handle: int) -> str:
    """Return the USER_DATA of a dds_qos_t; what is no text in it is replaced."""
    data, size = ctypes.c_void_p(), ctypes.c_size_t()
    if not library.quick.dds_qget_userdata(handle, ctypes.byref(data), ctypes.byref(size)) or not data.value:
        return ""
    text = ctypes.string_at(data.value, size.value).decode(errors="replace")
    library.quick.dds_free(data)
    return text


def read_property(library: Cyclone, handle: int, name: str) -> str:
    """Return a property of a dds_qos_t; empty if it has none of that name."""
    value = ctypes.c_void_p()
    if not library.quick.dds_qget_prop(handle, name.encode(), ctypes.byref(value)) or not value.value:
        return ""
    text = ctypes.string_at(value.value).decode(errors="replace")
    library.quick.dds_free(value)
    return text
