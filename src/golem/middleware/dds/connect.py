"""The way in: join a DDS domain."""

from __future__ import annotations

from functools import partial

from golem.middleware.dds.base import NetworkPlace
from golem.middleware.dds.checks import self_test
from golem.middleware.dds.domain import DdsConfig, close_domain, open_domain
from golem.middleware.dds.interfaces import find_interface
from golem.middleware.dds.library import cyclone
from golem.middleware.dds.participant import CycloneParticipant


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
