"""Cyclone writers and readers of raw CDR."""

from __future__ import annotations

import ctypes
import struct
import threading
from collections.abc import Callable
from typing import Any, Protocol

from golem.middleware.dds.base import DdsError, Payload, Qos, Sample, as_sample
from golem.middleware.dds.library import (
    ALREADY_DELETED,
    ANY_STATE,
    SERDATA_DATA,
    TIMEOUT,
    BytesIovec,
    Cyclone,
    Iovec,
    SampleInfo,
)

_SMALL = 16384
"""Up to here [B] copying is quicker than giving up and regaining the interpreter's lock."""
_BATCH = 64
"""Samples that one call to Cyclone takes."""
_INFO = struct.Struct("@III?qQQ5I4x")
"""SampleInfo, unpacked at once."""


class Owner(Protocol):
    """What an endpoint needs of its participant."""

    library: Cyclone

    def forget(self, entity: int) -> None:
        """Take an endpoint that closes off the books."""


class _Endpoint:
    """What writers and readers have in common; `entity` is Cyclone's name for it, see `base.Writer` for the others."""

    kind: str

    def __init__(self, owner: Owner, topic: str, type_name: str, qos: Qos, entity: int) -> None:
        self.topic, self.type_name, self.qos, self.entity = topic, type_name, qos, entity
        self._owner = owner
        self._open = True
        self._lock = threading.Lock()
        self._calls = owner.library.quick
        self.guid = entity_guid(owner.library, entity)
        handle = ctypes.c_uint64()
        owner.library.check(self._calls.dds_get_instance_handle(entity, ctypes.byref(handle)), "No handle")
        self.handle = handle.value

    def close(self) -> None:
        with self._lock:
            was_open, self._open = self._open, False
        if was_open:
            self._owner.forget(self.entity)
            self._owner.library.blocking.dds_delete(self.entity)

    def _peers(self, handles_of: Callable[..., int], data_of: Callable[..., Any]) -> dict[int, bytes]:
        """Return the guids of the endpoints that match, by handle, given Cyclone's functions that list them."""
        handles = (ctypes.c_uint64 * 1024)()
        n = handles_of(self.entity, handles, len(handles))
        found: dict[int, bytes] = {}
        for handle in handles[: max(0, min(n, len(handles)))]:
            data = data_of(self.entity, handle)
            if data:
                found[handle] = bytes(data.contents.guid)
                self._calls.dds_builtintopic_free_endpoint(data)
        return found

    def _check(self, code: int, what: str) -> int:
        if code >= 0:
            return code
        if not self._open:
            raise DdsError(f"The {self.kind} of '{self.topic}' is closed; create another one.")
        return self._owner.library.check(code, f"The {self.kind} of '{self.topic}' cannot {what}")


class CycloneWriter(_Endpoint):
    """A writer of a `CycloneParticipant`; `dropped` samples were too many for a reliable reader; see `base.Writer`."""

    kind = "writer"

    def __init__(self, owner: Owner, topic: str, type_name: str, qos: Qos, entity: int) -> None:
        super().__init__(owner, topic, type_name, qos, entity)
        self.dropped = 0
        sertype = ctypes.c_void_p()
        owner.library.check(self._calls.dds_get_entity_sertype(entity, ctypes.byref(sertype)), "No type")
        self._sertype = sertype.value
        self._pieces = (BytesIovec * 2)()
        self._pieces[1].base = bytes(3)
        quick, blocking = owner.library.quick, owner.library.blocking
        self._from_small, self._from_large = (quick.ddsi_serdata_from_ser_iov, blocking.ddsi_serdata_from_ser_iov)
        self._write = blocking.dds_writecdr

    def write(self, payload: Payload) -> None:
        """Send one sample, followed by zeros up to a multiple of 4 bytes."""
        data = as_sample(self.topic, payload)
        size = len(data)
        pad = -size % 4
        make = self._from_small if size <= _SMALL else self._from_large
        with self._lock:
            if not self._open:
                self._check(ALREADY_DELETED, "write")
            pieces = self._pieces
            pieces[0].base = data
            pieces[0].length = size
            pieces[1].length = pad
            serdata = make(self._sertype, SERDATA_DATA, 2 if pad else 1, pieces, size + pad)
        if not serdata:
            raise DdsError(f"A sample of '{self.topic}' is too large: it has {size} bytes.")
        code = self._write(self.entity, serdata)
        if code == TIMEOUT:
            self.dropped += 1
        elif code:
            self._check(code, "write")

    def matched(self) -> int:
        return max(0, self._calls.dds_get_matched_subscriptions(self.entity, None, 0))

    def readers(self) -> dict[int, bytes]:
        calls = self._calls
        return self._peers(calls.dds_get_matched_subscriptions, calls.dds_get_matched_subscription_data)


class CycloneReader(_Endpoint):
    """A reader of a `CycloneParticipant`, whose waitset thread calls `on_data`; see `base.Reader`."""

    kind = "reader"

    def __init__(
        self, owner: Owner, topic: str, type_name: str, qos: Qos, entity: int, on_data: Callable[[], None] | None
    ) -> None:
        super().__init__(owner, topic, type_name, qos, entity)
        self.on_data = on_data
        self._serdata = (ctypes.c_void_p * _BATCH)()
        self._infos = (SampleInfo * _BATCH)()
        self._info_bytes = memoryview(self._infos).cast("B")
        self._piece = Iovec()
        self._piece_ref = ctypes.byref(self._piece)

    def take(self, maximum: int = _BATCH) -> list[Sample]:
        samples: list[Sample] = []
        with self._lock:
            while maximum > 0:
                wanted = min(maximum, _BATCH)
                n = self._calls.dds_takecdr(self.entity, self._serdata, wanted, self._infos, ANY_STATE)
                if n < 0:
                    self._check(n, "take")
                for i in range(n):
                    samples.append(self._sample(i))
                if n < wanted:
                    break
                maximum -= n
        return samples

    def matched(self) -> int:
        return max(0, self._calls.dds_get_matched_publications(self.entity, None, 0))

    def writers(self) -> dict[int, bytes]:
        calls = self._calls
        return self._peers(calls.dds_get_matched_publications, calls.dds_get_matched_publication_data)

    def _sample(self, i: int) -> Sample:
        """Return the i-th taken sample and release Cyclone's."""
        calls, serdata, piece = self._calls, self._serdata[i], self._piece_ref
        _, _, _, valid, stamp, _, writer, *_ = _INFO.unpack_from(self._info_bytes, i * _INFO.size)
        payload = b""
        if valid:
            size = calls.ddsi_serdata_size(serdata)
            held = calls.ddsi_serdata_to_ser_ref(serdata, 0, size, piece)
            payload = ctypes.string_at(self._piece.base, size)
            calls.ddsi_serdata_to_ser_unref(held, piece)
        calls.ddsi_serdata_unref(serdata)
        return Sample(payload, stamp * 1e-9, writer, valid)


def entity_guid(library: Cyclone, entity: int) -> bytes:
    """Return the guid (16 bytes) of a participant, writer or reader."""
    guid = (ctypes.c_ubyte * 16)()
    library.check(library.quick.dds_get_guid(entity, guid), "No guid")
    return bytes(guid)
