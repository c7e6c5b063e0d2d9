"""The way in: join a DDS domain, after a check of what everything then relies on."""

from __future__ import annotations

import functools
import time
from functools import partial

from golem.middleware.dds.base import ENCAPSULATION, DdsError, NetworkPlace, Qos
from golem.middleware.dds.domain import DdsConfig, close_domain, open_domain
from golem.middleware.dds.interfaces import find_interface
from golem.middleware.dds.library import cyclone
from golem.middleware.dds.participant import CycloneParticipant

_DOMAIN = 65000
"""Id of the self-test's domain. It has no network, hence no ports, and the id may be beyond those of real ones."""
_NO_NETWORK = b"<CycloneDDS><Domain><General><Transport>none</Transport></General></Domain></CycloneDDS>"


@functools.cache
def self_test() -> None:
    """Send a sample to oneself, in a domain of its own without network; once per process.

    It catches a library whose structs are laid out differently than `library` says.

    Raises:
        MissingExtra: cyclonedds is not installed.
        DdsError: the sample did not come back as it was sent.
    """
    library = cyclone()
    domain = library.blocking.dds_create_domain(_DOMAIN, _NO_NETWORK)
    library.check(domain, "The self-test of the transport cannot start")
    participant = CycloneParticipant(library, _DOMAIN, "the self-test", "", lambda: None)
    try:
        qos = Qos(transient_local=True, depth=2)
        writer = participant.writer("self_test", "golem::SelfTest", qos)
        sent = [ENCAPSULATION + bytes(range(n)) for n in (8, 13)]
        before = time.time()
        for payload in sent:
            writer.write(payload)
        samples = participant.reader("self_test", "golem::SelfTest", qos).take()
        came = [sample.payload[: len(payload)] for sample, payload in zip(samples, sent, strict=False)]
        stamped = all(abs(sample.source_time - before) < 60.0 for sample in samples)
        named = all(sample.writer == writer.handle and sample.alive for sample in samples)
        if came != sent or not stamped or not named:
            raise DdsError(
                "Cyclone DDS does not give back what it was sent; reinstall it with: "
                "pip install --force-reinstall 'cyclonedds>=11.0.1,<11.1'"
            )
    finally:
        participant.close()
        library.blocking.dds_delete(domain)


def connect(config: DdsConfig | None = None, user_data: str = "") -> CycloneParticipant:
    """Join a DDS domain.

    Args:
        config: which domain, and through which interface; None: domain 1 on the loopback interface.
        user_data: USER_DATA of the participant, e.g. `"enclave=/;"` for ROS 2.

    Raises:
        MissingExtra: cyclonedds is not installed.
        ConfigError: there is no such interface.
        DdsError: the interface reaches nobody, or Cyclone does not work here.
    """
    config = config or DdsConfig()
    library = cyclone()
    self_test()
    open_domain(library, config)
    leave = partial(close_domain, library, config.domain)
    address = find_interface(config.interface).address
    network = NetworkPlace(config.domain, address) if address else None
    try:
        return CycloneParticipant(library, config.domain, str(config), user_data, leave, network)
    except BaseException:
        leave()
        raise
