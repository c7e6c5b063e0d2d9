"""Membership of a DDS domain through Cyclone, with one thread that calls back when there is something to take."""

from __future__ import annotations

import atexit
import threading
from collections.abc import Callable

from golem.middleware.dds.base import DdsError, NetworkPlace, Qos
from golem.middleware.dds.dispatcher import Dispatcher
from golem.middleware.dds.endpoints import CycloneReader, CycloneWriter, entity_guid
from golem.middleware.dds.library import Cyclone
from golem.middleware.dds.qos import cyclone_qos
from golem.middleware.dds.topic import create_topic


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
        """Create a writer."""
        with self._lock:
            known = self._topic(topic, type_name)
            with cyclone_qos(self.library, qos, user_data) as handle:
                entity = self.library.blocking.dds_create_writer(self.entity, known, handle, None)
            self.library.check(entity, f"'{topic}' cannot be written")
            writer = self._endpoints[entity] = CycloneWriter(self, topic, type_name, qos, entity)
            return writer

    def reader(
        self,
        topic: str,
        type_name: str,
        qos: Qos,
        user_data: str = "",
        on_data: Callable[[], None] | None = None,
    ) -> CycloneReader:
        """Create a reader; `on_data` may be called before this returns."""
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
            raise DdsError(
                f"Topic '{name}' already carries '{known}' here; it cannot carry '{type_name}' too."
            )
        return entity
