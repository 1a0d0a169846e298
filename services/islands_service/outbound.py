"""HTTP requests to URLs that clients of the service name: only to public addresses, unless allowed.

A client of the service could otherwise use it to reach machines of the internal network (server-side
request forgery). The name of the host is resolved once, all its addresses are checked, and the connection is
made to a checked address, so that a second answer of the name server cannot replace it. The certificate is
verified for the name. No redirect is followed, no proxy of the environment is used, and no connection is
kept.
"""

import asyncio
import socket
import ssl
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import asynccontextmanager
from functools import cache, partial
from ipaddress import IPv4Address, IPv6Address, IPv6Network, ip_address

import httpx

from islands.errors import IslandsError, SettingsError
from islands_service.settings import ServiceSettings, split_list

#: Prefix of IPv4 addresses behind a translator (RFC 6052); the last 32 bits are the address.
_NAT64 = IPv6Network("64:ff9b::/96")

#: Largest number of characters of a URL.
MAX_URL = 2000

#: Maximum number of names that a client resolves at once.
MAX_RESOLUTIONS = 200

_LAST_PORT = 65_535

_DEFAULT_PORTS = {"https": 443, "http": 80}

#: Finds the addresses of the host of a URL.
_Addresses = Callable[[httpx.URL], Awaitable[tuple[str, ...]]]


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


class CheckedClient:
    """Sends HTTP requests to allowed hosts.

    Parameters
    ----------
    private_hosts : iterable of str
        Hosts whose addresses may be private: a name or an address in lower case, with or without a port.
    http_hosts : iterable of str
        Hosts to which requests may be sent without TLS.
    tls : SSLContext, optional
        Trusted authorities; by default those of httpx and of ``SSL_CERT_FILE``.
    """

    def __init__(
        self,
        private_hosts: tuple[str, ...] = (),
        http_hosts: tuple[str, ...] = (),
        tls: ssl.SSLContext | None = None,
    ) -> None:
        self._private, self._http, self._tls = frozenset(private_hosts), frozenset(http_hosts), tls
        # A name server that does not answer occupies a thread for half a minute, also after the time limit.
        self._resolvers = ThreadPoolExecutor(MAX_RESOLUTIONS, "resolver")

    def check_url(self, url: str) -> httpx.URL:
        """Parse a URL; refuse one that requests are never sent to. Its host is not resolved.

        Raises
        ------
        OutboundRefusedError
        """
        try:
            parsed = httpx.URL(url) if len(url) <= MAX_URL else None
            host = "" if parsed is None else parsed.host
        except (httpx.InvalidURL, UnicodeError) as error:  # the latter for an invalid international name
            raise OutboundRefusedError(f"the URL is not valid ({error}): give https://HOST/PATH") from error
        if parsed is None:
            raise OutboundRefusedError(f"the URL has more than {MAX_URL} characters: give a shorter one")
        if parsed.scheme not in _DEFAULT_PORTS or not host:
            raise OutboundRefusedError("the URL is not one of HTTPS: give https://HOST/PATH")
        if not 0 < _get_port(parsed) <= _LAST_PORT:
            raise OutboundRefusedError(f"{parsed.port} is no port: give one from 1 to {_LAST_PORT}")
        if parsed.userinfo:
            raise OutboundRefusedError("the URL contains a user name or a password: give one without")
        if parsed.scheme == "http" and not is_listed(parsed, self._http):
            raise OutboundRefusedError(
                f"{parsed.host} would be reached without TLS: give an https URL, or ask the operator of this "
                "service to list the host in ISLANDS_HTTP_HOSTS"
            )
        return parsed

    @asynccontextmanager
    async def open(
        self,
        method: str,
        url: str,
        seconds: float,
        headers: Mapping[str, str] | None = None,
        content: bytes | None = None,
    ) -> AsyncIterator[httpx.Response]:
        """Send a request, and yield its response before the body is read.

        Read the body with `read_body`, or with ``response.aiter_raw()``: it is requested without compression.
        A redirect is a response like any other.

        Parameters
        ----------
        seconds : float
            Time limit of everything in the block: resolution, connection, request, response, and its use.

        Raises
        ------
        OutboundRefusedError
            The URL or an address of its host is not allowed.
        OutboundFailedError
            The host cannot be reached, the time is over, or the connection is lost.
        """
        parsed = self.check_url(url)
        async with _deadline(parsed.host, seconds):
            tls = await asyncio.to_thread(_make_default_tls) if self._tls is None else self._tls
            transport = _CheckedTransport(self._addresses, tls)
            async with httpx.AsyncClient(transport=transport, trust_env=False, timeout=seconds) as client:
                sent = {"User-Agent": "islands", **(headers or {}), "Accept-Encoding": "identity"}
                request = client.build_request(method, parsed, headers=sent, content=content)
                try:
                    response = await client.send(request, stream=True)
                except UnicodeError as error:  # in the header Location
                    raise OutboundFailedError(f"{parsed.host} redirects to an invalid host") from error
                try:
                    yield response
                finally:
                    await response.aclose()

    async def check_host(self, url: str, seconds: float) -> None:
        """Check a URL and the addresses of its host, without a connection.

        Raises
        ------
        OutboundRefusedError, OutboundFailedError
            See `open`.
        """
        parsed = self.check_url(url)
        async with _deadline(parsed.host, seconds):
            await self._addresses(parsed)

    async def _addresses(self, url: httpx.URL) -> tuple[str, ...]:
        """Return the addresses of the host of a URL.

        Raises
        ------
        OutboundRefusedError
            One of them is not public.
        """
        found = await resolve(url.raw_host.decode("ascii"), _get_port(url), self._resolvers)
        if not is_listed(url, self._private) and not all(map(is_public, found)):
            # The address is not named: it would tell a client about the internal network.
            raise OutboundRefusedError(
                f"{url.host} does not have a public address: give another host, or ask the operator of this "
                "service to list it in ISLANDS_PRIVATE_HOSTS"
            )
        return found


def make_checked_client(settings: ServiceSettings) -> CheckedClient:
    """Return a client that sends requests to the hosts that the settings allow."""
    return CheckedClient(split_list(settings.private_hosts), split_list(settings.http_hosts))


async def read_body(response: httpx.Response, most: int) -> bytes:
    """Return the body of a small response.

    Raises
    ------
    OutboundFailedError
        It has more than ``most`` bytes.
    """
    body = bytearray()
    async for chunk in response.aiter_raw():
        body += chunk
        if len(body) > most:
            raise OutboundFailedError(f"{response.request.url.host} sent more than {most} bytes")
    return bytes(body)


class _CheckedTransport(httpx.AsyncHTTPTransport):
    """Transport that connects to checked addresses.

    A new connection for each request: one to an address could otherwise serve another name.
    """

    def __init__(self, addresses: _Addresses, tls: ssl.SSLContext) -> None:
        super().__init__(verify=tls, trust_env=False, limits=httpx.Limits(max_keepalive_connections=0))
        self._addresses = addresses

    async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
        """Send a request to the first address that accepts a connection. The header Host keeps the name."""
        url = request.url
        extensions = {**request.extensions, "sni_hostname": url.raw_host.decode("ascii")}
        failure: Exception = OutboundFailedError(f"{url.host} has no address")
        for address in await self._addresses(url):
            sent = httpx.Request(
                request.method,
                url.copy_with(host=address),
                headers=request.headers,
                stream=request.stream,
                extensions=extensions,
            )
            try:
                return await super().handle_async_request(sent)
            except httpx.ConnectError as error:
                failure = error
        raise failure


@asynccontextmanager
async def _deadline(host: str, seconds: float) -> AsyncIterator[None]:
    """Limit the time of the block, and translate the errors of the connection."""
    limit = asyncio.timeout(seconds)
    try:
        async with limit:
            yield
    except TimeoutError as error:
        if not limit.expired():
            raise
        raise OutboundFailedError(f"{host} did not answer within {seconds:g} s") from error
    except httpx.TimeoutException as error:
        raise OutboundFailedError(f"{host} did not answer within {seconds:g} s") from error
    except httpx.HTTPError as error:
        reason = str(error) or type(error).__name__
        raise OutboundFailedError(f"the request to {host} failed: {reason}") from error


@cache
def _make_default_tls() -> ssl.SSLContext:
    # Reading the authorities takes some hundredths of a second.
    return httpx.create_ssl_context()


def _get_port(url: httpx.URL) -> int:
    return _DEFAULT_PORTS[url.scheme] if url.port is None else url.port


def is_listed(url: httpx.URL, hosts: frozenset[str]) -> bool:
    """Return whether a list of hosts has the host of a URL, with its port or without one."""
    name = f"[{url.host}]" if ":" in url.host else url.raw_host.decode("ascii").lower()
    return not hosts.isdisjoint({name, f"{name}:{_get_port(url)}"})
