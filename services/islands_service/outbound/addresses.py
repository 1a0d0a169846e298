"""Addresses of other machines: public ones, and the resolution of names to them."""

import asyncio
import socket
from concurrent.futures import Executor
from functools import partial
from ipaddress import IPv4Address, IPv6Address, IPv6Network, ip_address

from islands.errors import IslandsError, SettingsError

#: Prefix of IPv4 addresses behind a translator (RFC 6052); the last 32 bits are the address.
_NAT64 = IPv6Network("64:ff9b::/96")


class OutboundRefusedError(SettingsError):
    """The service does not send requests to this URL."""


class OutboundFailedError(IslandsError):
    """The other host did not answer, or not in time."""


def is_public(address: str) -> bool:
    """Return whether an address is one of the public internet.

    Private, loopback, link-local, multicast and reserved addresses are not, and neither are IPv6 addresses
    that contain such an IPv4 address.
    """
    found: IPv4Address | IPv6Address = ip_address(address.partition("%")[0])
    if isinstance(found, IPv6Address):
        embedded = found.ipv4_mapped or found.sixtofour
        if found in _NAT64:
            embedded = IPv4Address(int(found) & 0xFFFFFFFF)
        if embedded is not None:
            return is_public(str(embedded))
        if found.is_site_local:
            return False
    return found.is_global and not (found.is_multicast or found.is_reserved)


async def resolve(host: str, port: int, threads: Executor | None = None) -> tuple[str, ...]:
    """Return the addresses of a host in the order of the resolver.

    Parameters
    ----------
    threads : Executor, optional
        Threads that wait for the name server; by default those of the event loop, which are few.

    Raises
    ------
    OutboundFailedError
        The name has no address, or no name server answers.
    """
    try:
        found = await asyncio.get_running_loop().run_in_executor(
            threads, partial(socket.getaddrinfo, host, port, type=socket.SOCK_STREAM)
        )
    except (OSError, UnicodeError) as error:
        raise OutboundFailedError(f"the name {host} cannot be resolved: {error}") from error
    return tuple(dict.fromkeys(str(address[0]) for *_, address in found))
