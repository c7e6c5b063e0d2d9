"""The functions of Cyclone's C library (libddsc of the `cyclonedds` wheel) that GOLEM calls, through ctypes.

The Python layer of `cyclonedds` is not used: it can only make topics that advertise type information, at which
Cyclone 0.10 peers crash (see `topic`), and its serialiser needs 80 ms for an image. Signatures are those of
dds/dds.h and dds/ddsi/ddsi_serdata.h of release 11.0.1. The serdata functions are exported but not promised to stay,
hence the pinned version, and `checks.self_test`.
"""

from __future__ import annotations

import ctypes
import functools
import runpy
from ctypes import POINTER, c_bool, c_char_p, c_int, c_int32, c_int64, c_size_t, c_ssize_t, c_uint32, c_uint64
from ctypes import c_void_p as ptr
from importlib import metadata, util
from pathlib import Path
from typing import Any

from golem.errors import MissingExtra
from golem.middleware.dds.base import DdsError

SERIES = "11.0"
"""The releases of cyclonedds whose structs are laid out as below."""

PRECONDITION_NOT_MET = -4
ALREADY_DELETED = -9
TIMEOUT = -10
INFINITY = 2**63 - 1
"""A duration [ns]."""
ANY_STATE = 1 | 2 | 4 | 8 | 16 | 32 | 64
"""Mask of every sample, view and instance state."""
SERDATA_DATA = 2
"""enum ddsi_serdata_kind: a sample, not only its key."""


class Iovec(ctypes.Structure):
    """One piece of memory: struct iovec."""

    _fields_ = (("base", ptr), ("length", c_size_t))


class BytesIovec(ctypes.Structure):
    """The same, whose memory is a `bytes` object that it keeps alive."""

    _fields_ = (("base", c_char_p), ("length", c_size_t))


class TypeMeta(ctypes.Structure):
    """Serialised type information: struct dds_type_meta_ser."""

    _fields_ = (("data", ptr), ("size", c_uint32))


class TopicDescriptor(ctypes.Structure):
    """What Cyclone must know of a type: dds_topic_descriptor_t."""

    _fields_ = (
        ("size", c_uint32),
        ("align", c_uint32),
        ("flags", c_uint32),
        ("key_count", c_uint32),
        ("type_name", c_char_p),
        ("keys", ptr),
        ("op_count", c_uint32),
        ("ops", POINTER(c_uint32)),
        ("meta", c_char_p),
        ("type_information", TypeMeta),
        ("type_mapping", TypeMeta),
        ("data_representation", c_uint32),
    )


class SampleInfo(ctypes.Structure):
    """What comes with a sample: dds_sample_info_t."""

    _fields_ = (
        ("sample_state", c_uint32),
        ("view_state", c_uint32),
        ("instance_state", c_uint32),
        ("valid", c_bool),
        ("source_timestamp", c_int64),
        ("instance", c_uint64),
        ("writer", c_uint64),
        ("generations_and_ranks", c_uint32 * 5),
    )


class EndpointData(ctypes.Structure):
    """What discovery told of a writer or reader: dds_builtintopic_endpoint_t."""

    _fields_ = (
        ("guid", ctypes.c_ubyte * 16),
        ("participant_guid", ctypes.c_ubyte * 16),
        ("participant", c_uint64),
        ("topic", c_char_p),
        ("type_name", c_char_p),
        ("qos", ptr),
    )


class ParticipantData(ctypes.Structure):
    """What discovery told of a participant: dds_builtintopic_participant_t."""

    _fields_ = (("guid", ctypes.c_ubyte * 16), ("qos", ptr))


_entity = c_int32
_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "dds_strretcode": (c_char_p, [c_int32]),
    "dds_create_domain": (_entity, [c_uint32, c_char_p]),
    "dds_create_participant": (_entity, [c_uint32, ptr, ptr]),
    "dds_create_topic": (_entity, [_entity, POINTER(TopicDescriptor), c_char_p, ptr, ptr]),
    "dds_create_writer": (_entity, [_entity, _entity, ptr, ptr]),
    "dds_create_reader": (_entity, [_entity, _entity, ptr, ptr]),
    "dds_create_readcondition": (_entity, [_entity, c_uint32]),
    "dds_create_guardcondition": (_entity, [_entity]),
    "dds_set_guardcondition": (c_int32, [_entity, c_bool]),
    "dds_create_waitset": (_entity, [_entity]),
    "dds_waitset_attach": (c_int32, [_entity, _entity, c_ssize_t]),
    "dds_waitset_wait": (c_int32, [_entity, POINTER(c_ssize_t), c_size_t, c_int64]),
    "dds_delete": (c_int32, [_entity]),
    "dds_get_guid": (c_int32, [_entity, ptr]),
    "dds_get_instance_handle": (c_int32, [_entity, POINTER(c_uint64)]),
    "dds_get_matched_subscriptions": (c_int32, [_entity, POINTER(c_uint64), c_size_t]),
    "dds_get_matched_publications": (c_int32, [_entity, POINTER(c_uint64), c_size_t]),
    "dds_get_matched_publication_data": (POINTER(EndpointData), [_entity, c_uint64]),
    "dds_get_matched_subscription_data": (POINTER(EndpointData), [_entity, c_uint64]),
    "dds_builtintopic_free_endpoint": (None, [POINTER(EndpointData)]),
    "dds_create_qos": (ptr, []),
    "dds_delete_qos": (None, [ptr]),
    "dds_qset_reliability": (None, [ptr, c_int, c_int64]),
    "dds_qset_durability": (None, [ptr, c_int]),
    "dds_qset_durability_service": (None, [ptr, c_int64, c_int, c_int32, c_int32, c_int32, c_int32]),
    "dds_qset_history": (None, [ptr, c_int, c_int32]),
    "dds_qset_writer_data_lifecycle": (None, [ptr, c_bool]),
    "dds_qset_data_representation": (None, [ptr, c_uint32, POINTER(ctypes.c_int16)]),
    "dds_qset_userdata": (None, [ptr, c_char_p, c_size_t]),
    "dds_qget_userdata": (c_bool, [ptr, POINTER(ptr), POINTER(c_size_t)]),
    "dds_qget_prop": (c_bool, [ptr, c_char_p, POINTER(ptr)]),
    "dds_qget_reliability": (c_bool, [ptr, POINTER(c_int), POINTER(c_int64)]),
    "dds_qget_durability": (c_bool, [ptr, POINTER(c_int)]),
    "dds_qget_history": (c_bool, [ptr, POINTER(c_int), POINTER(c_int32)]),
    "dds_free": (None, [ptr]),
    "dds_take": (c_int32, [_entity, POINTER(ptr), ptr, c_size_t, c_uint32]),
    "dds_return_loan": (c_int32, [_entity, POINTER(ptr), c_int32]),
    "dds_get_entity_sertype": (c_int32, [_entity, POINTER(ptr)]),
    "dds_takecdr": (c_int32, [_entity, POINTER(ptr), c_uint32, ptr, c_uint32]),
    "dds_writecdr": (c_int32, [_entity, ptr]),
    "ddsi_serdata_from_ser_iov": (ptr, [ptr, c_int, c_size_t, POINTER(BytesIovec), c_size_t]),
    "ddsi_serdata_size": (c_uint32, [ptr]),
    "ddsi_serdata_to_ser_ref": (ptr, [ptr, c_size_t, c_size_t, POINTER(Iovec)]),
    "ddsi_serdata_to_ser_unref": (None, [ptr, POINTER(Iovec)]),
    "ddsi_serdata_unref": (None, [ptr]),
}


class Cyclone:
    """The library, twice over.

    Attributes:
        blocking: calls that let other Python threads run meanwhile.
        quick: calls that keep the interpreter's lock: for those of a few microseconds, where giving it away would
            let another thread keep it for a whole switch interval. Cyclone never calls back into Python.
    """

    def __init__(self, path: Path) -> None:
        """Load the library at `path` and declare its functions. Raises DdsError: it lacks one of them."""
        self.blocking: Any = ctypes.CDLL(str(path))
        self.quick: Any = ctypes.PyDLL(str(path))
        for name, (result, arguments) in _SIGNATURES.items():
            for library in (self.blocking, self.quick):
                try:
                    function = getattr(library, name)
                except AttributeError:
                    raise DdsError(f"{path.name} has no function {name}; {_remedy()}") from None
                function.restype, function.argtypes = result, arguments

    def check(self, code: int, what: str) -> int:
        """Return `code` unless it is an error. Raises DdsError: `what` could not be done, and what may be changed."""
        if code < 0:
            reason = self.quick.dds_strretcode(code).decode()
            raise DdsError(f"{what} (Cyclone DDS says: {reason}).")
        return code


@functools.cache
def cyclone() -> Cyclone:
    """Return the library, loaded once. Raises MissingExtra: it is not installed; DdsError: another series is."""
    found = util.find_spec("cyclonedds")
    if found is None or found.origin is None:
        raise MissingExtra("cyclonedds", "dds")
    version = metadata.version("cyclonedds")
    if version.split(".")[:2] != SERIES.split("."):
        raise DdsError(f"cyclonedds {version} is installed, which GOLEM cannot use; {_remedy()}")
    # The package itself is not imported: that costs a quarter of a second and brings nothing but this path.
    path = runpy.run_path(str(Path(found.origin).with_name("__library__.py")))["library_path"]
    return Cyclone(Path(path))


def _remedy() -> str:
    return f"install the right one with: pip install 'cyclonedds>={SERIES}.1,<11.1'"
