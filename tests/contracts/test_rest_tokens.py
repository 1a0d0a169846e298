"""Tokens over REST: an issuer on this machine, owners, roles, rotation, an outage, and refused tokens."""

import time

import pytest

from islands.errors import SettingsError
from islands_api.__main__ import check_safe
from islands_service.settings import ServiceSettings
from support.issuers import AUDIENCE, encode_part, issuing, make_claims, make_key
from support.service import emptied, kept, problem_of, queued, spec


@pytest.fixture(scope="module")
def issuer():
    with issuing() as running:
        yield running


@pytest.fixture(scope="module")
def shared(serve, issuer):
    settings = {"oidc_issuer": issuer.url, "oidc_audience": AUDIENCE, "http_hosts": "127.0.0.1"}
    with serve(**settings, rate=0) as running:
        yield running


@pytest.fixture
def service(shared):
    return emptied(shared)


def bearer(token):
    return {"Authorization": f"Bearer {token}"}


def owner_of(service, issuer, **changes):
    """Return the owner that the service gives to a token."""
    job = service.client.get("/v1/jobs", headers=bearer(issuer.token(**changes)))
    assert job.status_code == 200, job.text
    return [entry["owner"] for entry in service.logs if entry["event"] == "request"][-1]


def test_a_token_submits_and_reads_the_jobs_of_its_owner(service, issuer):
    owner = owner_of(service, issuer)
    dataset = kept(service.store, owner)
    job = service.submit(bearer(issuer.token()), **spec(dataset))
    assert job.status_code == 202
    path = job.headers["location"]
    assert service.client.get(path, headers=bearer(issuer.token())).status_code == 200
    other = service.client.get(path, headers=bearer(issuer.token(sub="bob")))
    problem_of(other, 404, "no-such-job")


@pytest.mark.parametrize(
    ("role", "allowed"),
    [
        ("islands-reader", {"/v1/jobs"}),
        ("islands-monitor", {"/metrics"}),
        ("islands-administrator", {"/v1/jobs", "/metrics", "/v1/admin/keys"}),
        ("unknown", set()),
    ],
)
def test_a_role_allows_only_its_routes(service, issuer, role, allowed):
    for path in ("/v1/jobs", "/metrics", "/v1/admin/keys"):
        answer = service.client.get(path, headers=bearer(issuer.token(roles=[role])))
        if path in allowed:
            assert answer.status_code == 200
        else:
            assert "ask for another role" in problem_of(answer, 403, "scope-missing")


@pytest.mark.parametrize(
    "make",
    [
        lambda issuer: issuer.token(exp=1.0),
        lambda issuer: issuer.token(nbf=4e9),
        lambda issuer: issuer.token(aud="account"),
        lambda issuer: issuer.token(iss="https://other.example.org"),
        lambda issuer: issuer.token(make_key("second")),
        lambda issuer: issuer.token()[:-8] + "AAAAAAAA",
        lambda issuer: ".".join((encode_part({"alg": "none"}), encode_part(make_claims(issuer.url)), "")),
        lambda issuer: issuer.token(padding="a" * 20_000),
    ],
    ids=["expired", "future", "audience", "issuer", "key", "signature", "none", "oversize"],
)
def test_a_token_that_is_not_valid_is_refused_with_its_reason(service, issuer, make):
    answer = service.client.get("/v1/jobs", headers=bearer(make(issuer)))
    assert "token" in problem_of(answer, 401, "invalid-token")
    assert answer.headers["www-authenticate"] == 'Bearer realm="islands", error="invalid_token"'


@pytest.fixture
def patient(shared):
    """The cache of the keys, whose clock the test moves."""
    keys = shared.app.state.islands.tokens.keys
    clock = keys._clock
    moved = [0.0]
    keys._clock = lambda: clock() + moved[0]

    def wait(seconds):
        moved[0] += seconds

    yield wait
    keys._clock = clock


def test_known_tokens_are_accepted_while_the_issuer_is_away(service, issuer, patient):
    assert owner_of(service, issuer)
    issuer.away = True
    try:
        patient(700.0)
        assert owner_of(service, issuer)
        unknown = issuer.token(make_key("after the outage"))
        patient(10.0)
        answer = service.client.get("/v1/jobs", headers=bearer(unknown))
        assert issuer.url in problem_of(answer, 503, "issuer-unavailable")
        assert answer.headers["retry-after"]
    finally:
        issuer.away = False
        patient(10.0)


def test_a_stream_ends_when_its_token_expires(service, issuer, monkeypatch):
    from islands_api.web.routes import events

    monkeypatch.setattr(events, "_KEEP_ALIVE_SECONDS", 0.05)
    owner = owner_of(service, issuer)
    job = queued(service.store, owner).id
    token = issuer.token(exp=time.time() - 29.5)
    began = time.monotonic()
    with service.client.stream("GET", f"/v1/jobs/{job}/events", headers=bearer(token)) as stream:
        assert stream.status_code == 200
        assert sum(map(len, stream.iter_raw())) > 0
    assert time.monotonic() - began < 10.0


def test_refused_tokens_use_up_the_rate_of_their_address(serve, issuer):
    settings = {"oidc_issuer": issuer.url, "oidc_audience": AUDIENCE, "http_hosts": "127.0.0.1"}
    with serve(**settings, rate=0.001, burst=20) as service:
        answers = [
            service.client.get("/v1/jobs", headers=bearer(issuer.token(exp=1.0))).status_code
            for _ in range(3)
        ]
        assert answers == [401, 401, 429]
        assert service.client.get("/v1/jobs", headers=bearer(issuer.token())).status_code == 200


def test_the_description_names_the_issuer_as_an_alternative_to_keys(service, issuer):
    document = service.client.get("/openapi.json").json()
    scheme = document["components"]["securitySchemes"]["token"]
    assert scheme["type"] == "openIdConnect"
    assert scheme["openIdConnectUrl"] == f"{issuer.url}/.well-known/openid-configuration"
    assert document["paths"]["/v1/jobs"]["get"]["security"] == [{"key": []}, {"token": []}]
    assert "security" not in document["paths"]["/healthz"]["get"]


@pytest.mark.parametrize(
    ("changes", "error"),
    [({}, "there is no key"), ({"oidc_issuer": "https://id.example.org"}, "ISLANDS_OIDC_AUDIENCE")],
)
def test_a_public_address_needs_a_key_or_complete_settings_of_tokens(service, changes, error):
    public = {"data_dir": service.settings.data_dir, "host": "0.0.0.0"}
    with pytest.raises(SettingsError, match=error):
        check_safe(ServiceSettings(**public, **changes), service.store)
    check_safe(
        ServiceSettings(**public, oidc_issuer="https://id.example.org", oidc_audience="a"), service.store
    )
