"""Keys of the issuer: cache, rotation, outage and the rate of requests, with a clock of the test."""

import asyncio
import json
from contextlib import asynccontextmanager
from types import SimpleNamespace

import pytest
import structlog

from islands_api.oidc.bearer_token import IssuerUnavailableError
from islands_service.outbound.addresses import OutboundFailedError
from support.issuers import Issuer, encode_part, make_key

URL = "https://id.example.org"


class _Client:
    """Client whose responses are the documents of an issuer; ``released`` delays them."""

    def __init__(self, issuer):
        self.issuer, self.requests, self.changed = issuer, [], {}
        self.released = asyncio.Event()
        self.released.set()

    @asynccontextmanager
    async def open(self, _method, url, _seconds):
        self.requests.append(url)
        await self.released.wait()
        if self.issuer.away:
            raise OutboundFailedError(f"{url} does not answer")
        content = self.changed.get(url, self.issuer.document(url.removeprefix(URL)))

        async def chunks():
            yield content if isinstance(content, bytes) else json.dumps(content).encode()

        request = SimpleNamespace(url=SimpleNamespace(host="id.example.org"))
        yield SimpleNamespace(status_code=200, aiter_raw=chunks, request=request)


def follow(scenario):
    """Run a scenario with the keys of an issuer, its client and a clock."""
    from islands_api.oidc.issuer_keys import IssuerKeys

    async def run():
        now = SimpleNamespace(time=1000.0)
        client = _Client(Issuer(URL))
        keys = IssuerKeys(URL, client, lambda: now.time)
        try:
            await scenario(keys, client, now)
        finally:
            await keys.close()

    asyncio.run(run())


async def settle():
    """Let the tasks run that were started without a wait."""
    for _ in range(20):
        await asyncio.sleep(0)


def test_keys_are_read_once_and_found_by_their_ids():
    async def scenario(keys, client, now):
        found = await asyncio.gather(*(keys.find("first") for _ in range(5)))
        assert {each.kid for each in found} == {"first"}
        assert client.requests == [f"{URL}/.well-known/openid-configuration", f"{URL}/keys"]

    follow(scenario)


def test_a_new_key_of_the_issuer_is_found_at_once_and_an_old_one_no_more():
    async def scenario(keys, client, now):
        await keys.find("first")
        client.issuer.keys = [make_key("second")]
        now.time += 10.0
        assert (await keys.find("second")).kid == "second"
        assert await keys.find("first") is None

    follow(scenario)


def test_old_keys_are_read_again_without_a_wait():
    async def scenario(keys, client, now):
        await keys.find("first")
        client.issuer.keys = [make_key(), make_key("second")]
        now.time += 700.0
        client.released.clear()
        assert (await asyncio.wait_for(keys.find("first"), 1.0)).kid == "first"
        client.released.set()
        await settle()
        assert (await keys.find("second")).kid == "second"
        assert len(client.requests) == 4

    follow(scenario)


def test_known_keys_are_used_for_six_hours_while_the_issuer_is_away():
    async def scenario(keys, client, now):
        await keys.find("first")
        client.issuer.away = True
        for _ in range(35):
            now.time += 600.0
            assert (await keys.find("first")).kid == "first"
            await settle()
        with pytest.raises(IssuerUnavailableError, match=URL):
            await keys.find("second")
        now.time += 700.0
        with pytest.raises(IssuerUnavailableError, match="try again later"):
            await keys.find("first")
        client.issuer.away = False
        now.time += 10.0
        assert (await keys.find("first")).kid == "first"

    follow(scenario)


def test_an_outage_of_the_issuer_is_logged_once_a_minute_and_its_end():
    async def scenario(keys, client, now):
        client.issuer.away = True
        for _ in range(24):  # two minutes in which tokens arrive
            with pytest.raises(IssuerUnavailableError):
                await keys.find("first")
            now.time += 5.0
        client.issuer.away = False
        await keys.find("first")

    with structlog.testing.capture_logs() as logs:
        follow(scenario)
    assert [(entry["event"], entry.get("failures")) for entry in logs] == [
        ("keys of the issuer not read", None),
        ("keys of the issuer not read", 13),
        ("the issuer answers again", 24),
        ("keys of the issuer read", None),
    ]


def test_a_client_that_leaves_does_not_interrupt_the_others():
    async def scenario(keys, client, now):
        client.released.clear()
        leaving, staying = (asyncio.create_task(keys.find("first")) for _ in range(2))
        await settle()
        leaving.cancel()
        await settle()
        client.released.set()
        assert (await staying).kid == "first"

    follow(scenario)


@pytest.mark.parametrize(
    ("path", "document"),
    [
        (
            "/.well-known/openid-configuration",
            {"issuer": "https://other.example.org", "jwks_uri": f"{URL}/keys"},
        ),
        ("/.well-known/openid-configuration", []),
        ("/.well-known/openid-configuration", b"<html>"),
        ("/keys", {"keys": []}),
        ("/keys", {}),
        ("/keys", b"x" * 600_000),
        ("/keys", b"[" * 100_000),
        ("/keys", {"keys": [{"kty": "oct", "kid": "first", "k": "AAAA"}]}),
        ("/keys", {"keys": [{**make_key().as_dict(private=False), "use": "enc"}]}),
        ("/keys", {"keys": [{"kty": "RSA", "kid": "first", "n": "!", "e": "AQAB"}]}),
        ("/keys", {"keys": ["first", None, {"kty": []}]}),
    ],
)
def test_documents_that_are_no_keys_of_this_issuer_are_not_used(path, document):
    async def scenario(keys, client, now):
        client.changed[URL + path] = document
        with pytest.raises(IssuerUnavailableError):
            await keys.find("first")

    follow(scenario)


def test_a_short_rsa_key_is_not_used():
    from cryptography.hazmat.primitives.asymmetric import rsa

    def offer(bits):
        number = rsa.generate_private_key(65537, bits).public_key().public_numbers().n
        return {
            "kty": "RSA",
            "kid": str(bits),
            "n": encode_part(number.to_bytes(bits // 8, "big")),
            "e": "AQAB",
        }

    async def scenario(keys, client, now):
        client.changed[f"{URL}/keys"] = {"keys": [offer(1024), offer(2048)]}
        assert await keys.find("1024") is None
        assert (await keys.find("2048")).kid == "2048"

    follow(scenario)
