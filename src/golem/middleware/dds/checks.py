"""What is verified before anything relies on the transport, and what is said when nobody answers."""

from __future__ import annotations

import functools
import time

from golem.middleware.dds import discovery
from golem.middleware.dds.base import ENCAPSULATION, DdsError, Qos
from golem.middleware.dds.endpoints import CycloneReader, CycloneWriter
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


def wait_for_peer(
    participant: CycloneParticipant, endpoint: CycloneWriter | CycloneReader, remedy: str, timeout: float
) -> None:
    """Wait until somebody matches `endpoint`, a writer or reader of `participant`.

    Args:
        participant: its participant.
        endpoint: what somebody else should match.
        remedy: what the user can do, e.g. `"start the robot with: golem twin"`.
        timeout: how long to wait [s].

    Raises:
        DdsError: nobody did in time; the message says what discovery knows of the reason.
    """
    end = time.monotonic() + timeout
    while not endpoint.matched():
        if time.monotonic() > end:
            raise DdsError(f"{_reason(participant, endpoint)} ({participant.where}, {timeout:g} s); {remedy}.")
        time.sleep(0.01)


def _reason(participant: CycloneParticipant, endpoint: CycloneWriter | CycloneReader) -> str:
    writing = isinstance(endpoint, CycloneWriter)
    does = "reads" if writing else "writes"
    topic = endpoint.topic
    others = discovery.others(participant)
    if not others:
        return "Nobody else is on the DDS domain"
    there = discovery.readers(participant) if writing else discovery.writers(participant)
    there = [other for other in there if other.topic == topic]
    if not there:
        return f"Of {len(others)} others on the DDS domain nobody {does} '{topic}'"
    for other in there:
        if other.type_name == endpoint.type_name:
            offered, requested = (endpoint.qos, other.qos) if writing else (other.qos, endpoint.qos)
            return f"The writer of '{topic}' offers {_words(offered)}, its reader requests {_words(requested)}"
    return f"Somebody {does} '{topic}' as '{there[0].type_name}', not as '{endpoint.type_name}'"


def _words(qos: Qos) -> str:
    reliability = "reliable" if qos.reliable else "best effort"
    return f"{reliability}, {'transient local' if qos.transient_local else 'volatile'}"
