"""What compiled stages of the 500 Hz chain share: one record, and how one stage calls the next.

A stage is one step of one module in compiled code, `int stage(record, memory)`. It reads and writes the shared record,
keeps what it remembers in a record of its own, and returns `ORDINARY`. `UNUSUAL` says that this tick is not: the stage
has then changed nothing, and the module's Python code has to do the tick.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol, runtime_checkable

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic as _intrinsic
from numba.np.numpy_support import from_dtype
from numpy.typing import NDArray

from golem.kernels import cfunc
from golem.types import LEGS, NUM_JOINTS, TICK, UPPER

Record = Any
"""A structured scalar (`numpy.void`), or what compiled code sees of it: fields are attributes, arrays are views."""
Records = NDArray[Any]
"""A structured array of length one: what owns a record."""

intrinsic: Any = _intrinsic
ORDINARY, UNUSUAL, LOOK = 0, 1, 2
"""What a stage returns: it has done its tick; Python has to do it; it has, and somebody wants to look at the result."""
STATE = 3 * NUM_JOINTS + 10
"""Numbers of a state: q, dq, tau (27 each), then quat wxyz (4), gyro (3) and acc (3) of the IMU."""
COMMAND = 5 * NUM_JOINTS
"""Numbers of a command: q, dq, tau, kp, kd (27 each)."""
_LEG_JOINTS, _UPPER_JOINTS = LEGS.stop - LEGS.start, UPPER.stop - UPPER.start


def _layout(*rows: tuple[str, Any]) -> np.dtype[Any]:
    """Return the packed dtype of `rows`, where the numbers from `q` on, a state's, also are one field `state`."""
    plain: Any = np.dtype(list(rows))
    names, formats = [*plain.names, "state"], [*(kind for _, kind in rows), _f8(STATE)]
    offsets = [plain.fields[name][1] for name in (*plain.names, "q")]
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": plain.itemsize})


def _f8(*shape: int) -> tuple[str, tuple[int, ...]]:
    return "f8", shape


RECORD = _layout(
    ("t", "f8"),
    ("dt", "f8"),
    # What motors and IMU report; also one array, `state`.
    ("q", _f8(NUM_JOINTS)),
    ("dq", _f8(NUM_JOINTS)),
    ("tau", _f8(NUM_JOINTS)),
    ("quat", _f8(4)),
    ("gyro", _f8(3)),
    ("acc", _f8(3)),
    ("state_t", "f8"),
    # What the hands report, (hand, finger); see `HandState`.
    ("fingers", _f8(2, 2)),
    ("finger_force", _f8(2, 2)),
    # The estimate of the base.
    ("base_t", "f8"),
    ("T_odom_base", _f8(4, 4)),
    ("velocity", _f8(3)),
    ("height", "f8"),
    ("contact", _f8(2)),
    ("stale", "i8"),
    # Targets of legs and upper body; the legs may bring gains and torques of their own.
    ("has_legs", "i8"),
    ("leg_q", _f8(_LEG_JOINTS)),
    ("has_leg_gains", "i8"),
    ("leg_kp", _f8(_LEG_JOINTS)),
    ("leg_kd", _f8(_LEG_JOINTS)),
    ("has_leg_tau", "i8"),
    ("leg_tau", _f8(_LEG_JOINTS)),
    ("has_arms", "i8"),
    ("arm_q", _f8(_UPPER_JOINTS)),
    # The command before the gate and after it, rows q, dq, tau, kp, kd.
    ("request_t", "f8"),
    ("request", _f8(COMMAND)),
    ("command_t", "f8"),
    ("command", _f8(COMMAND)),
    ("moving", "i8"),
    ("estop_t", "f8"),
    ("estop_sequence", "i8"),
    ("estop_pressed", "i8"),
)
"""The shared record: time and length of the tick [s], then messages. Units, frames and motor order are those of
`golem.types`; stamps of what never came are -inf.

`has_*` says whether there is one; `moving` whether the safety gate lets commands through.
"""
STAGE = types.int64(types.int64, types.int64)
"""The signature of a compiled stage: addresses of the shared record and of its own memory."""


def stage_code(stage: Callable[[int, int], int]) -> Callable[[], Any]:
    """Return a function that compiles `stage` at its first call, and returns the compiled one."""
    return cache(lambda: cfunc(STAGE, cache=True)(stage))


@dataclass(frozen=True)
class CompiledStage:
    """The compiled part of a module: `code` is the compiled function, see `STAGE`."""

    code: Any
    memory: Records

    def run(self, record: Records) -> int:
        """Run it once on the shared `record`; return `ORDINARY` or `UNUSUAL`."""
        return self.code.ctypes(address(record), address(self.memory))


@runtime_checkable
class HasStage(Protocol):
    """A module whose step may be compiled, too."""

    def native(self) -> CompiledStage | None:
        """Return what does the same as `step`, with the same memory; None where there is no such stage."""
        ...


def own(module: object, kind: type[Any], *methods: str) -> bool:
    """Return whether `module` has the `methods` of `kind`: a subclass of a user may have others than a stage knows."""
    mine, given = type(module), vars(module)
    return all(getattr(mine, name) is getattr(kind, name) and name not in given for name in methods)


def new_record(dtype: np.dtype[Any]) -> Records:
    """Return a record of `dtype` with zeros, as an array of length one."""
    return np.zeros(1, dtype)


def address(array: NDArray[Any]) -> int:
    """Return where the numbers of `array` are."""
    return int(array.ctypes.data)


def new_shared() -> Records:
    """Return the shared record of a chain to which nothing has come yet, and whose time goes on by ticks."""
    record = new_record(RECORD)
    record["dt"] = TICK
    for name in ("t", "state_t", "base_t", "request_t", "command_t", "estop_t"):
        record[name] = -np.inf
    return record


def view(dtype: np.dtype[Any]) -> Any:
    """Return a function of compiled code that takes the address of a record of `dtype` and returns the record."""
    return _at(from_dtype(dtype))


def _at(kind: Any) -> Any:
    @intrinsic
    def there(typingctx: Any, place: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.inttoptr(args[0], context.get_value_type(kind))

        return kind(types.int64), code

    return there


shared = view(RECORD)
"""In compiled code: the shared record at an address."""


floats = _at(types.CPointer(types.float64))
"""In compiled code: the float64 numbers at an address, to be indexed without any check."""
ints = _at(types.CPointer(types.int64))
"""The same for int64."""
words = _at(types.CPointer(types.int32))
"""The same for int32."""


@intrinsic
def call_stage(typingctx: Any, function: Any, record: Any, memory: Any) -> Any:
    """In compiled code: call the stage at an address."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        word = ir.IntType(64)
        kind = ir.FunctionType(word, [word, word]).as_pointer()
        return builder.call(builder.inttoptr(args[0], kind), args[1:])

    return types.int64(types.int64, types.int64, types.int64), code


@intrinsic
def call_library(typingctx: Any, function: Any, one: Any, other: Any) -> Any:
    """In compiled code: call a function of a C library, `void function(void*, void*)`, at an address."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        word = ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [word, word]).as_pointer()
        builder.call(builder.inttoptr(args[0], kind), args[1:])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), code


def library_function(library: str, name: str) -> int:
    """Return the address of the function `name` of the shared `library` (a path)."""
    return int(ctypes.cast(getattr(ctypes.CDLL(library), name), ctypes.c_void_p).value or 0)
