"""Bearer tokens and the keys of their issuer: checks of claims, cache, rotation and outage."""

import asyncio
import hashlib
import hmac
import json
from contextlib import asynccontextmanager
from types import SimpleNamespace

import pytest
import structlog

from islands.errors import SettingsError
from islands_api.bearer_token import MAX_TOKEN, IssuerUnavailableError, TokenRefusedError, is_token
from islands_service.outbound import OutboundFailedError
from islands_service.settings import ServiceSettings
from support.issuers import AUDIENCE, Issuer, encode_part, make_claims, make_key, sign

URL = "https://id.example.org"

ISSUER = "https://id.example.org/realm"

OTHER = "https://other.example.org"


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
    from islands_api.token_verifier import IssuerKeys

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


def test_unknown_ids_do_not_make_requests_at_any_rate():
    async def scenario(keys, client, now):
        await keys.find("first")
        for number in range(100):
            assert await keys.find(f"unknown-{number}") is None
            now.time += 0.1
        assert len(client.requests) <= 2 * 3

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


class _Keys:
    """Keys of an issuer that always answers."""

    def __init__(self, *keys):
        self._keys = {key.kid: type(key).import_key(key.as_dict(private=False)) for key in keys}

    async def find(self, identity):
        return self._keys.get(identity)


def make(*keys, **settings):
    from islands_api.token_verifier import TokenVerifier

    given = {"oidc_issuer": ISSUER, "oidc_audience": AUDIENCE, **settings}
    return TokenVerifier(ServiceSettings(**given), _Keys(*(keys or (make_key(),))))


def verify(token, *keys, **settings):
    return asyncio.run(make(*keys, **settings).verify(token))


def token(**changes):
    return sign(make_claims(ISSUER, **changes), make_key())


def refused(text, *keys, **settings):
    """Check that a token is refused; return the message."""
    with pytest.raises(TokenRefusedError) as error:
        verify(text, *keys, **settings)
    return str(error.value)


def test_a_valid_token_gives_owner_scopes_and_expiry():
    identity = verify(token(exp=4e9))
    assert identity.owner == f"oidc-{hashlib.sha256(ISSUER.encode()).hexdigest()[:8]}:alice"
    assert identity.subject == f"sub-{hashlib.sha256(b'alice').hexdigest()[:12]}"
    assert identity.scopes == {"read", "write"}
    assert identity.expires == pytest.approx(4e9, abs=31)


@pytest.mark.parametrize(
    ("algorithm", "kind", "size"),
    [("ES256", "EC", "P-256"), ("RS256", "RSA", 2048), ("PS256", "RSA", 2048), ("Ed25519", "OKP", "Ed25519")],
)
def test_a_token_of_every_default_algorithm_is_accepted(algorithm, kind, size):
    key = make_key("made", kind, size)
    assert verify(sign(make_claims(ISSUER), key, algorithm), key).scopes


def test_a_token_without_a_signature_is_refused():
    parts = [encode_part({"alg": "none", "kid": "first"}), encode_part(make_claims(ISSUER)), ""]
    assert "signed with 'none'" in refused(".".join(parts))


def test_a_token_that_is_signed_with_the_public_key_as_a_secret_is_refused():
    """The public key is known to everybody: HS256 with it would make anyone an issuer."""
    parts = f"{encode_part({'alg': 'HS256', 'kid': 'first'})}.{encode_part(make_claims(ISSUER))}"
    for secret in (make_key().as_pem(private=False), json.dumps(make_key().as_dict(private=False)).encode()):
        signature = hmac.digest(secret, parts.encode(), hashlib.sha256)
        assert "signed with 'HS256'" in refused(f"{parts}.{encode_part(signature)}")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"iss": OTHER}, "was issued by 'https://other"),
        ({"iss": ISSUER + "/"}, "was issued by"),
        ({"iss": None}, "was issued by None"),
        ({"aud": "account"}, "for 'account': request one for the audience islands"),
        ({"aud": ["account"]}, "request one for the audience"),
        ({"aud": {"islands": 1}}, "request one for the audience"),
        ({"aud": None}, "request one for the audience"),
        ({"exp": 1_600_000_000}, "has expired"),
        ({"exp": None}, "does not expire"),
        ({"exp": "never"}, "exp of the token is not a time"),
        ({"exp": True}, "exp of the token is not a time"),
        ({"exp": float("inf")}, "exp of the token is not a time"),
        ({"nbf": 4e9}, "not valid yet"),
        ({"iat": 4e9}, "not valid yet"),
        ({"sub": None}, "does not name an owner"),
        ({"sub": ""}, "does not name an owner"),
        ({"sub": 7}, "does not name an owner"),
    ],
)
def test_a_token_with_wrong_claims_is_refused_with_the_claim(changes, message):
    assert message in refused(token(**changes))


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ({"kid": None}, "needs a kid"),
        ({"kid": "second"}, "is not one of the issuer"),
        ({"typ": "logout+jwt"}, "has the type 'logout+jwt'"),
        ({"crit": ["b64"], "b64": False}, "signature"),
    ],
)
def test_a_token_with_a_wrong_header_is_refused(header, message):
    assert message in refused(sign(make_claims(ISSUER), make_key(), **header))


def test_a_token_of_another_key_with_the_same_id_is_refused():
    text = sign(make_claims(ISSUER), make_key("second"), kid="first")
    assert "signature of the token is not valid" in refused(text)


def test_a_key_of_the_header_is_not_used():
    """A token that brings its key along proves nothing."""
    other = make_key("second")
    text = sign(make_claims(ISSUER), other, kid="first", jwk=other.as_dict(private=False))
    assert "signature of the token is not valid" in refused(text)


def test_a_changed_claim_breaks_the_signature():
    header, _, signature = token().split(".")
    changed = encode_part(make_claims(ISSUER, sub="mallory"))
    assert "signature of the token is not valid" in refused(f"{header}.{changed}.{signature}")


@pytest.mark.parametrize("algorithm", ["RS256", "Ed25519"])
def test_the_type_of_the_key_must_fit_the_algorithm(algorithm):
    header = encode_part({"alg": algorithm, "kid": "first"})
    assert "signature" in refused(f"{header}.{token().partition('.')[2]}")


def test_a_key_for_another_algorithm_is_not_used():
    from joserfc.jwk import RSAKey

    key = RSAKey.import_key({**make_key("made", "RSA", 2048).as_dict(private=True), "alg": "RS256"})
    assert "is not for PS256" in refused(
        sign(make_claims(ISSUER), make_key("made", "RSA", 2048), "PS256"), key
    )


def test_an_oversize_token_is_refused_before_it_is_parsed():
    text = sign(make_claims(ISSUER, padding="a" * MAX_TOKEN), make_key())
    assert is_token(text)
    assert f"more than {MAX_TOKEN} characters" in refused(text)


@pytest.mark.parametrize(
    "text", ["islands_abc", "a.b.c", "...", "", "e30", encode_part([1]) + ".e30.", "é" * 9 + ".a.b"]
)
def test_a_key_is_no_token(text):
    assert not is_token(text)


@pytest.mark.parametrize("text", ["e30.", "e30.e30", "e30.e30.e30.e30.e30"])
def test_a_malformed_token_is_refused(text):
    assert is_token(text)
    assert refused(text)


def test_the_leeway_tolerates_the_clock_of_the_issuer():
    late = make_claims(ISSUER)["iat"] - 20.0
    assert verify(token(exp=late)).scopes
    assert "expired" in refused(token(exp=late), oidc_leeway=10.0)


@pytest.mark.parametrize(
    ("roles", "scopes"),
    [
        (["islands-reader"], {"read"}),
        (["islands-reader", "islands-monitor", "unknown", 7], {"read", "metrics"}),
        (["islands-administrator"], {"read", "write", "metrics", "admin"}),
        ("openid islands-submitter", {"read", "write"}),
        (["submitter"], set()),
        ({"islands-administrator": True}, set()),
        (None, set()),
    ],
)
def test_roles_give_scopes_and_other_values_give_none(roles, scopes):
    assert verify(token(roles=roles)).scopes == scopes


def test_owners_of_two_issuers_and_of_keys_are_never_the_same():
    values = [
        "alice",
        "local",
        "a/b",
        "ä",
        "x" * 100,
        "x" * 101,
        "~" + hashlib.sha256(b"a/b").hexdigest()[:47],
    ]
    owners = {
        verify(sign(make_claims(issuer, sub=value), make_key()), oidc_issuer=issuer).owner
        for issuer in (ISSUER, OTHER)
        for value in values
    }
    assert len(owners) == 2 * len(values)
    assert all(owner.startswith("oidc-") and len(owner) <= 64 and "/" not in owner for owner in owners)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"oidc_audience": ""}, "ISLANDS_OIDC_AUDIENCE"),
        ({"oidc_algorithms": "HS256"}, "symmetric"),
        ({"oidc_algorithms": "none"}, "symmetric"),
        ({"oidc_algorithms": " , "}, "ISLANDS_OIDC_ALGORITHMS"),
        ({"oidc_roles": "a=god"}, "'a=god' is not VALUE=ROLE with a role of reader"),
        ({"oidc_roles": "reader"}, "is not VALUE=ROLE"),
    ],
)
def test_settings_that_accept_too_much_or_nothing_are_refused(settings, message):
    with pytest.raises(SettingsError, match=message):
        make(**settings)


@pytest.mark.parametrize("issuer", ["http://id.example.org", "id.example.org"])
def test_an_issuer_without_tls_is_refused_unless_it_is_listed(issuer):
    from islands_api.token_verifier import make_token_verifier

    settings = {"oidc_issuer": issuer, "oidc_audience": AUDIENCE}
    with pytest.raises(SettingsError):
        make_token_verifier(ServiceSettings(**settings))
    if issuer.startswith("http:"):
        assert make_token_verifier(ServiceSettings(**settings, http_hosts="id.example.org")) is not None
