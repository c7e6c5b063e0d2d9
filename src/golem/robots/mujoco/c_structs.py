"""Where MuJoCo's structs have their fields: what compiled code needs that the Python bindings give by value only."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import mujoco
from mujoco.introspect import ast_nodes, structs

_NUMBERS: dict[str, Any] = {
    "int": ctypes.c_int,
    "float": ctypes.c_float,
    "size_t": ctypes.c_size_t,
    "uintptr_t": ctypes.c_size_t,
    "mjtSize": ctypes.c_int64,
    "mjtNum": ctypes.c_double,
    "mjtBool": ctypes.c_bool,
    "mjtByte": ctypes.c_ubyte,
    "uint64_t": ctypes.c_uint64,
    "uint32_t": ctypes.c_uint32,
    "int64_t": ctypes.c_int64,
}


@cache
def struct(name: str) -> type[ctypes.Structure]:
    """Return the C struct called `name`, as the bindings describe it.

    Raises:
        KeyError: it, or the type of one of its fields, is not described.
    """
    described: Any = structs.STRUCTS[name]
    fields = [(field.name, _kind(field.type)) for field in described.fields]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


def _kind(declared: Any) -> Any:
    if isinstance(declared, ast_nodes.PointerType):
        return ctypes.c_void_p
    if isinstance(declared, ast_nodes.ArrayType):
        inner = _kind(declared.inner_type)
        for extent in reversed(declared.extents):
            inner *= extent
        return inner
    return _NUMBERS.get(declared.name) or struct(declared.name)


def data_struct(data: mujoco.MjData) -> Any:
    """Return the struct behind `data`, which it shares; None where the bindings' description does not fit it."""
    try:
        found: Any = struct("mjData").from_address(data._address)
        fits = found.time == data.time and found.ncon == data.ncon and found.qpos == data.qpos.ctypes.data
    except KeyError:
        return None
    return found if fits else None
