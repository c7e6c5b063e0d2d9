"""Which domain, on which network interface, and Cyclone's configuration that follows from it.

The configuration is handed to Cyclone when the domain is opened: the environment variable CYCLONEDDS_URI has no say, as
with the vendor's SDK.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, fields
from typing import Literal
from xml.sax.saxutils import quoteattr

from golem.errors import ConfigError
from golem.middleware.dds.base import DdsError
from golem.middleware.dds.interfaces import Interface, find_interface
from golem.middleware.dds.library import PRECONDITION_NOT_MET, Cyclone

Distro = Literal["humble", "jazzy"]
"""ROS 2 distributions that differ on the wire: of the types GOLEM uses, in `rmw_dds_common/msg/Gid` alone."""
ROBOT_DOMAIN = 0
"""The domain of the real robot."""
LAST_DOMAIN = 232
"""The last domain whose UDP ports exist: 7400 + 250 * 232 < 65536 (DDSI-RTPS 2.5, 9.6.2.3)."""


def first_port(domain: int) -> int:
    """Return the first of a domain's 250 UDP ports, that of multicast discovery (DDSI-RTPS 2.5, 9.6.2.3)."""
    return 7400 + 250 * domain


@dataclass(frozen=True, slots=True)
class DdsConfig:
    """How to join a DDS domain."""

    domain: int = 1
    """Domain id, 0 to 232. 0 is the real robot's."""
    interface: str = "lo"
    """Network interface, by name; lo stays on this machine."""
    peers: tuple[str, ...] = ()
    """Addresses of further machines to look for; for networks without multicast."""
    robot: bool = False
    """Take part in the real robot's domain; its domain and interface have to be named as well."""
    distro: Distro = "jazzy"
    """The ROS 2 release whose `ros2 node list` shows our nodes: humble, or jazzy for all since iron."""

    def __post_init__(self) -> None:
        if not 0 <= self.domain <= LAST_DOMAIN:
            raise ConfigError(f"DDS domain {self.domain} does not exist; choose one of 0 to {LAST_DOMAIN}.")
        if self.domain == ROBOT_DOMAIN and not self.robot:
            raise ConfigError(
                f"DDS domain {ROBOT_DOMAIN} is the real robot's; choose one of 1 to {LAST_DOMAIN}, "
                "or say that the robot is meant (--robot)."
            )
        if self.robot and self.domain != ROBOT_DOMAIN:
            raise ConfigError(
                f"--robot is the real robot, which is on domain {ROBOT_DOMAIN}: add --domain {ROBOT_DOMAIN}."
            )
        if self.robot and self.interface == "lo":
            raise ConfigError("The real robot is not on this machine: add --interface with the one its cable is in.")

    def words(self) -> list[str]:
        """Return what a command line says of it; nothing where it is the default."""
        words: list[str] = []
        for field in fields(self):
            value = getattr(self, field.name)
            if value != field.default:
                given = value if isinstance(value, tuple) else () if value is True else (value,)
                words += [f"--{field.name}", *map(str, given)]
        return words

    def command(self, words: str) -> str:
        """Return the command `golem words` as it is to be given to take part here."""
        return " ".join(["golem", words, *self.words()])

    def __str__(self) -> str:
        return f"domain {self.domain}, interface {self.interface}"


_LOOPBACK = """
<General>
  <Interfaces><NetworkInterface name={name} multicast="true"/></Interfaces><AllowMulticast>spdp</AllowMulticast>
  <MaxMessageSize>65500B</MaxMessageSize><FragmentSize>64000B</FragmentSize>
</General>
<Discovery><Peers><Peer address="127.0.0.1"/>{peers}</Peers></Discovery>
"""
"""On the loopback interface Cyclone 0.10 looks for others at the first UDP ports of this machine, Cyclone 11 by
multicast; this does both. Datagrams are as large as UDP allows: nothing has to fit a frame there, and an image then
takes 15 of them instead of 63."""
_NETWORK = """
<General>
  <Interfaces><NetworkInterface name={name}/></Interfaces><AllowMulticast>spdp</AllowMulticast>
</General>
<Discovery><Peers>{peers}</Peers></Discovery>
"""
"""On a network only discovery uses multicast: Wi-Fi and many switches carry multicast data badly."""
_COMMON = """
<Discovery>
  <ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>119</MaxAutoParticipantIndex>
  <SPDPInterval>5s</SPDPInterval>
</Discovery>
<Internal><SocketReceiveBufferSize max="16MB"/><SocketSendBufferSize max="16MB"/></Internal>
"""
"""An image arrives as one burst. And while a link is cut Linux holds up to 0.2 MB of datagrams back for each neighbour
it cannot find (net.ipv4.neigh.default.unres_qlen_bytes), as much as a default send buffer: a writer would then wait for
seconds inside `write`. The operating system may grant less than is asked for; for this much it does.
Discovery: at the first ports others find us who have our address but no multicast; asked for every 5 s instead of 30, a
robot whose cable was out for longer than the lease of 10 s is soon back."""


def configuration(interface: Interface, peers: tuple[str, ...]) -> str:
    """Return Cyclone's configuration, XML."""
    # Never pruned: Cyclone forgets a peer that has not answered for 30 s, and would not find it when it comes (back).
    listed = "".join(f'<Peer address={quoteattr(peer)} PruneDelay="inf"/>' for peer in peers)
    template = _LOOPBACK if interface.loopback else _NETWORK
    specific = template.format(name=quoteattr(interface.name), peers=listed)
    return f"<CycloneDDS><Domain>{specific}{_COMMON}</Domain></CycloneDDS>"


class _Open:
    """A domain that is open in this process, and how many participants use it."""

    def __init__(self, xml: str, entity: int) -> None:
        self.xml, self.entity, self.users = xml, entity, 0


_open: dict[int, _Open] = {}
_lock = threading.Lock()


def open_domain(library: Cyclone, config: DdsConfig) -> None:
    """Open a domain in this process, or use it once more if it is open. `close_domain` undoes it.

    Raises DdsError: the interface is not there or cannot reach anybody, or the domain is open in this process with
    another configuration.
    """
    interface = find_interface(config.interface)
    if not (interface.loopback or interface.multicast or config.peers):
        raise DdsError(
            f"Network interface '{interface.name}' has no multicast, so nobody can be found through it; "
            "name the addresses of the other machines (peers), or choose another interface."
        )
    xml = configuration(interface, config.peers)
    with _lock:
        known = _open.get(config.domain)
        if known is None:
            entity = library.blocking.dds_create_domain(config.domain, xml.encode())
            if entity == PRECONDITION_NOT_MET:
                raise DdsError(
                    f"DDS domain {config.domain} is already open in this process through another library; "
                    "open it with golem.middleware.dds first."
                )
            what = (
                f"DDS domain {config.domain} cannot be opened on '{interface.name}'; it needs an IPv4 address, and "
                f"UDP ports from {first_port(config.domain)} that nobody else has (domains above 100 use ports that "
                "Linux gives to whoever asks for any)."
            )
            known = _open[config.domain] = _Open(xml, library.check(entity, what))
        elif known.xml != xml:
            raise DdsError(
                f"DDS domain {config.domain} is already open in this process on another interface or with other "
                "peers; close its participants first, or use the same."
            )
        known.users += 1


def close_domain(library: Cyclone, domain: int) -> None:
    """Close a domain in this process once nobody uses it any more."""
    with _lock:
        known = _open[domain]
        known.users -= 1
        if known.users == 0:
            del _open[domain]
            library.blocking.dds_delete(known.entity)
