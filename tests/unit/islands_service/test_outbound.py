"""Outbound requests: addresses in every notation, resolution of names, and checked connections."""

import asyncio
import ssl

import pytest
import trustme

from islands_service import outbound
from islands_service.outbound import (
    CheckedClient,
    OutboundFailedError,
    OutboundRefusedError,
    is_public,
    make_checked_client,
    read_body,
    resolve,
)
from islands_service.settings import ServiceSettings

PUBLIC = ["8.8.8.8", "2606:4700::1111", "::ffff:8.8.8.8", "64:ff9b::808:808", "2002:808:808::1"]

#: One address of each special range, and notations that hide a private IPv4 address in an IPv6 address.
OTHERS = [
    "0.0.0.0",
    "10.1.2.3",
    "100.64.0.1",
    "127.0.0.1",
    "169.254.169.254",
    "172.16.0.1",
    "192.0.2.1",
    "192.168.1.1",
    "198.18.0.1",
    "224.0.0.1",
    "240.0.0.1",
    "255.255.255.255",
    "::",
    "::1",
    "::127.0.0.1",
    "::ffff:127.0.0.1",
    "64:ff9b::a00:1",
    "64:ff9b:1::1",
    "2001::1",
    "2001:db8::1",
    "2002:7f00:1::1",
    "fc00::1",
    "fe80::1",
    "fe80::1%2",
    "fec0::1",
    "ff02::1",
]

#: Test client for servers on this machine.
LOCAL = CheckedClient(("127.0.0.1", "localhost"), ("127.0.0.1", "localhost"))

OK = b"HTTP/1.1 200 OK\r\nContent-Length: 4\r\n\r\nfine"


@pytest.mark.parametrize("address", OTHERS)
def test_a_special_address_is_not_public(address):
    assert not is_public(address)


@pytest.mark.parametrize("host", ["127.0.0.1", "127.1", "0x7f000001", "2130706433"])
def test_every_notation_of_an_address_is_resolved_before_it_is_checked(host):
    assert asyncio.run(resolve(host, 443)) == ("127.0.0.1",)


@pytest.mark.parametrize("host", ["no-such-name.invalid", "a" * 64 + ".example", "a\x00b"])
def test_a_name_without_an_address_is_an_error_with_the_name(host):
    with pytest.raises(OutboundFailedError, match=f"the name {host}"):
        asyncio.run(resolve(host, 443))


def exchange(client, answer, url="http://127.0.0.1:{port}/hook", seconds=5.0, tls=None, most=100, **request):
    """Send a request to a server that answers it with bytes or a coroutine.

    ``client`` may be a function of the port. Return the response, its body and the received headers.
    """

    async def run():
        received = []

        async def serve(reader, writer):
            received.append(await reader.readuntil(b"\r\n\r\n"))
            try:
                await (answer(writer) if callable(answer) else _write(writer, answer))
            except (ConnectionError, ssl.SSLError):
                pass
            finally:
                writer.close()

        server = await asyncio.start_server(serve, "127.0.0.1", 0, ssl=tls)
        port = server.sockets[0].getsockname()[1]
        try:
            sender = client if isinstance(client, CheckedClient) else client(port)
            async with sender.open("GET", url.format(port=port), seconds, **request) as response:
                return response, await read_body(response, most), b"".join(received)
        finally:
            server.close()

    return asyncio.run(run())


async def _write(writer, content):
    writer.write(content)
    await writer.drain()


@pytest.fixture
def names(monkeypatch):
    """Addresses by name, which replace the resolver; the names that were resolved."""
    known, asked = {}, []

    async def answer(host, *_):
        asked.append(host)
        return known[host]

    monkeypatch.setattr(outbound, "resolve", answer)
    return known, asked


def test_an_allowed_host_receives_the_request_and_its_answer_is_streamed():
    response, body, sent = exchange(LOCAL, OK, headers={"X-A": "b"})
    assert (response.status_code, body) == (200, b"fine")
    assert sent.startswith(b"GET /hook HTTP/1.1\r\nHost: 127.0.0.1:")
    assert b"X-A: b\r\n" in sent
    assert b"Accept-Encoding: identity\r\n" in sent


@pytest.mark.parametrize(
    ("url", "reason"),
    [
        ("ftp://example.org/", "not one of HTTPS"),
        ("https:///path", "not one of HTTPS"),
        ("example.org", "not one of HTTPS"),
        ("file:///etc/passwd", "not one of HTTPS"),
        ("https://xn--]example.org/", "not valid"),
        ("https://me:secret@example.org/", "user name"),
        ("https://example.org:0/", "no port"),
        ("https://example.org:70000/", "no port"),
        ("https://fe80::1/", "not valid"),
        ("https://example.org/" + "a" * 2000, "characters"),
        ("http://example.org/", "ISLANDS_HTTP_HOSTS"),
    ],
)
def test_a_url_that_is_never_used_is_refused_with_its_reason(url, reason):
    with pytest.raises(OutboundRefusedError, match=reason):
        CheckedClient().check_url(url)


@pytest.mark.parametrize("address", ["127.0.0.1", "10.0.0.1", "::1", "::ffff:10.0.0.1"])
def test_a_name_with_a_private_address_is_refused_without_naming_the_address(names, address):
    names[0]["hooks.example.org"] = ("8.8.8.8", address)
    with pytest.raises(OutboundRefusedError, match="does not have a public address") as refused:
        exchange(CheckedClient(), OK, "https://hooks.example.org/")
    assert address not in str(refused.value)


@pytest.mark.parametrize("listed", ["hooks.lan", "hooks.lan:{port}"])
def test_a_listed_host_may_have_a_private_address(names, listed):
    names[0]["hooks.lan"] = ("127.0.0.1",)

    def client(port):
        return CheckedClient((listed.format(port=port),), ("hooks.lan",))

    response, _, sent = exchange(client, OK, "http://hooks.lan:{port}/")
    assert response.status_code == 200
    assert b"Host: hooks.lan:" in sent


def test_a_host_that_is_listed_with_another_port_is_refused(names):
    names[0]["hooks.lan"] = ("127.0.0.1",)
    with pytest.raises(OutboundRefusedError, match="ISLANDS_PRIVATE_HOSTS"):
        exchange(CheckedClient(("hooks.lan:9",), ("hooks.lan",)), OK, "http://hooks.lan:{port}/")


def test_the_name_is_resolved_once_and_the_next_address_is_tried(names):
    """The second answer of a name server of an attacker could be a private address."""
    known, asked = names
    known["hooks.lan"] = ("127.0.0.2", "127.0.0.1")
    response, *_ = exchange(CheckedClient(("hooks.lan",), ("hooks.lan",)), OK, "http://hooks.lan:{port}/")
    assert response.status_code == 200
    assert asked == ["hooks.lan"]


def test_a_redirect_is_not_followed():
    answer = b"HTTP/1.1 302 Found\r\nLocation: http://10.0.0.1/\r\nContent-Length: 0\r\n\r\n"
    response, *_ = exchange(LOCAL, answer)
    assert response.status_code == 302


def test_a_proxy_of_the_environment_is_not_used(monkeypatch):
    monkeypatch.setenv("HTTP_PROXY", "http://127.0.0.1:9")
    assert exchange(LOCAL, OK)[0].status_code == 200


@pytest.mark.parametrize("part", ["nothing", "headers", "body"])
def test_a_slow_answer_ends_at_the_limit_whatever_part_is_slow(part):
    async def drip(writer):
        if part == "body":
            writer.write(b"HTTP/1.1 200 OK\r\nContent-Length: 9000\r\n\r\n")
        while True:
            await asyncio.sleep(0.01)
            if part != "nothing":
                await _write(writer, b"X")

    with pytest.raises(OutboundFailedError, match=r"did not answer within 0\.05 s"):
        exchange(LOCAL, drip, seconds=0.05)


@pytest.mark.parametrize(
    "answer", [b"", b"SSH-2.0-OpenSSH_9.2\r\n", b"HTTP/1.1 200 OK\r\nContent-Length: 9\r\n\r\nx"]
)
def test_an_answer_that_is_no_http_is_an_error_with_the_host(answer):
    with pytest.raises(OutboundFailedError, match=r"the request to 127\.0\.0\.1 failed"):
        exchange(LOCAL, answer)


@pytest.mark.parametrize("name", ["hooks.example.org", "others.example.org"])
def test_the_certificate_is_verified_for_the_name_and_not_for_the_address(names, name):
    names[0]["hooks.example.org"] = ("127.0.0.1",)
    authority, tls = trustme.CA(), ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    authority.issue_cert(name).configure_cert(tls)
    trusted = ssl.create_default_context()
    authority.configure_trust(trusted)
    client = CheckedClient(("hooks.example.org",), tls=trusted)
    if name == "hooks.example.org":
        assert exchange(client, OK, "https://hooks.example.org:{port}/", tls=tls)[1] == b"fine"
    else:
        with pytest.raises(OutboundFailedError, match="certificate is not valid for"):
            exchange(client, OK, "https://hooks.example.org:{port}/", tls=tls)


def test_the_lists_of_hosts_come_from_the_settings():
    settings = ServiceSettings(private_hosts="127.0.0.1", http_hosts=" 127.0.0.1 , Hooks.LAN:80")
    client = make_checked_client(settings)
    assert exchange(client, OK)[0].status_code == 200
    assert client.check_url("http://hooks.lan/")
