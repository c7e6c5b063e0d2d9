"""Membership of a DDS domain through Cyclone, with one thread that calls back when there is something to take.

Topics advertise no type information: a Cyclone 11 topic with type information makes Cyclone 0.10 peers (the vendor's
SDK, ROS 2 Humble to Kilted) crash if its type has an octet, and newer peers check assignability when both sides
advertise it. Without it matching is by topic and type name, as between ROS 2 nodes up to Kilted. The descriptor is that
of a final struct with one octet (Cyclone wants at least one member): Cyclone checks that there is one byte after the
encapsulation header, swaps nothing and hands on whatever follows, so one descriptor serves all types. The encoding must
be little endian, which that of every peer of ours is.
"""

from __future__ import annotations

import atexit
import ctypes
import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

from golem.middleware.dds.base import DdsError, NetworkPlace, Qos, Sample
from golem.middleware.dds.endpoints import CycloneReader, CycloneWriter, entity_guid
from golem.middleware.dds.library import ANY_STATE, INFINITY, Cyclone, TopicDescriptor

_KEEP_LAST, _KEEP_ALL = 0, 1
_BEST_EFFORT, _RELIABLE = 0, 1
_VOLATILE, _TRANSIENT_LOCAL = 0, 1
_UNLIMITED = -1
_XCDR1_ID = 0
BLOCKING_NS = 100_000_000
"""How long a reliable writer waits for a peer that is behind [ns]; DDS 1.4, table 2.2.3: 100 ms."""


@contextmanager
def cyclone_qos(library: Cyclone, qos: Qos | None, user_data: str) -> Iterator[int]:
    """Give a dds_qos_t for an endpoint, or for a participant if `qos` is None; set as rmw_cyclonedds sets it."""
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
    calls.dds_qset_data_representation(handle, 1, (ctypes.c_int16 * 1)(_XCDR1_ID))


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


_RESTRICT_DATA_REPRESENTATION = 1 << 7
"""DDS_TOPIC_RESTRICT_DATA_REPRESENTATION of dds_public_impl.h."""
_XCDR1 = 1 << 0
"""DDS_DATA_REPRESENTATION_FLAG_XCDR1."""
_PROGRAM = (0x01 << 24 | 0x01 << 16, 0, 0x00 << 24)
"""Marshalling program of dds_opcodes.h: DDS_OP_ADR | DDS_OP_TYPE_1BY, its offset; DDS_OP_RTS."""


def create_topic(library: Cyclone, participant: int, name: str, type_name: str) -> int:
    """Create a topic of opaque samples; return its entity. Raises DdsError: Cyclone refuses, e.g. its name."""
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
    topic = library.blocking.dds_create_topic(participant, ctypes.byref(descriptor), name.encode(), None, None)
    return library.check(topic, f"Topic '{name}' cannot be created; check its name")


_log = logging.getLogger(__name__)
_AT_ONCE = 64
"""Readers that one waiting reports; the others follow in the next."""
_STOP = 0
"""What the waitset reports for its own guard condition; Cyclone's entities are positive."""


class Watched(Protocol):
    """A reader with a callback."""

    topic: str
    entity: int
    on_data: Callable[[], None] | None

    def take(self, maximum: int = 64) -> list[Sample]:
        """Remove and return up to `maximum` samples."""
        ...


class Dispatcher:
    """Calls `on_data` of the readers that have something to take, one after the other, in a thread of its own.

    A callback that raises is logged, and what its reader held is thrown away: else it would be called for the same
    samples for ever.
    """

    def __init__(self, library: Cyclone, participant: int) -> None:
        self._library = library
        self._readers: dict[int, Watched] = {}
        calls = library.blocking
        self._entity = library.check(calls.dds_create_waitset(participant), "A waitset cannot be created")
        self._stop = library.check(calls.dds_create_guardcondition(participant), "A waitset cannot be stopped")
        self._attach(self._stop, _STOP)
        self._thread = threading.Thread(target=self._run, name="dds-waitset", daemon=True)
        self._thread.start()

    def attach(self, reader: Watched) -> None:
        """Call back for `reader` from now on."""
        condition = self._library.blocking.dds_create_readcondition(reader.entity, ANY_STATE)
        self._library.check(condition, f"The reader of '{reader.topic}' cannot be waited for")
        self._readers[reader.entity] = reader
        self._attach(condition, reader.entity)

    def detach(self, entity: int) -> None:
        """Call back no more for the reader `entity`; a call under way goes on."""
        self._readers.pop(entity, None)

    def close(self) -> None:
        """End the thread, once the present callback has returned; a callback may call it too."""
        self._library.blocking.dds_set_guardcondition(self._stop, True)
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _attach(self, condition: int, label: int) -> None:
        code = self._library.blocking.dds_waitset_attach(self._entity, condition, label)
        self._library.check(code, "A condition cannot be waited for")

    def _run(self) -> None:
        labels = (ctypes.c_ssize_t * _AT_ONCE)()
        wait = self._library.blocking.dds_waitset_wait
        while True:
            n = wait(self._entity, labels, _AT_ONCE, INFINITY)
            if n < 0:  # The participant has gone without closing: with its whole domain.
                return
            for label in labels[: min(n, _AT_ONCE)]:
                if label == _STOP:
                    return
                self._call(self._readers.get(label))

    def _call(self, reader: Watched | None) -> None:
        if reader is None or reader.on_data is None:
            return
        try:
            reader.on_data()
        except Exception:
            if reader.entity not in self._readers:
                return  # It was closed meanwhile.
            _log.exception("The callback of '%s' failed; the samples it was to take are lost.", reader.topic)
            try:
                while reader.take():
                    pass
            except DdsError:
                return


class CycloneParticipant:
    """A member of a DDS domain; see `base.Participant`. It leaves at the latest when the process ends.

    Attributes:
        library: Cyclone.
        entity: Cyclone's name for it.
        guid: 16 bytes, unique on the domain.
        where: the domain and how it is reached, in words.
        network: the domain and this machine's address on it.
    """

    def __init__(
        self,
        library: Cyclone,
        domain: int,
        where: str,
        user_data: str,
        on_close: Callable[[], None],
        network: NetworkPlace | None = None,
    ) -> None:
        """Join `domain`, which is open; `on_close` is called once it has been left."""
        self.library = library
        self.where, self.network = where, network
        self._on_close = on_close
        with cyclone_qos(library, None, user_data) as handle:
            entity = library.blocking.dds_create_participant(domain, handle, None)
        self.entity = library.check(entity, f"Nobody can join DDS domain {domain}; end some other process")
        self.guid = entity_guid(library, self.entity)
        self._lock = threading.RLock()
        self._topics: dict[str, tuple[int, str]] = {}
        self._endpoints: dict[int, CycloneWriter | CycloneReader] = {}
        self._dispatcher: Dispatcher | None = None
        self._open = True
        atexit.register(self.close)

    def writer(self, topic: str, type_name: str, qos: Qos, user_data: str = "") -> CycloneWriter:
        with self._lock:
            known = self._topic(topic, type_name)
            with cyclone_qos(self.library, qos, user_data) as handle:
                entity = self.library.blocking.dds_create_writer(self.entity, known, handle, None)
            self.library.check(entity, f"'{topic}' cannot be written")
            writer = self._endpoints[entity] = CycloneWriter(self, topic, type_name, qos, entity)
            return writer

    def reader(
        self, topic: str, type_name: str, qos: Qos, user_data: str = "", on_data: Callable[[], None] | None = None
    ) -> CycloneReader:
        with self._lock:
            known = self._topic(topic, type_name)
            with cyclone_qos(self.library, qos, user_data) as handle:
                entity = self.library.blocking.dds_create_reader(self.entity, known, handle, None)
            self.library.check(entity, f"'{topic}' cannot be read")
            reader = self._endpoints[entity] = CycloneReader(self, topic, type_name, qos, entity, on_data)
            if on_data is not None:
                if self._dispatcher is None:
                    self._dispatcher = Dispatcher(self.library, self.entity)
                self._dispatcher.attach(reader)
            return reader

    def forget(self, entity: int) -> None:
        """Take an endpoint that closes off the books."""
        with self._lock:
            self._endpoints.pop(entity, None)
            if self._dispatcher is not None:
                self._dispatcher.detach(entity)

    def close(self) -> None:
        """Close every writer and reader and leave the domain; a callback may call it too."""
        with self._lock:
            if not self._open:
                return
            self._open = False
        atexit.unregister(self.close)
        if self._dispatcher is not None:
            self._dispatcher.close()
        for endpoint in list(self._endpoints.values()):
            endpoint.close()
        self.library.blocking.dds_delete(self.entity)
        self._on_close()

    def _topic(self, name: str, type_name: str) -> int:
        if not self._open:
            raise DdsError("The participant is closed; create another one.")
        if name not in self._topics:
            self._topics[name] = create_topic(self.library, self.entity, name, type_name), type_name
        entity, known = self._topics[name]
        if known != type_name:
            raise DdsError(f"Topic '{name}' already carries '{known}' here; it cannot carry '{type_name}' too.")
        return entity
