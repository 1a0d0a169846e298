"""API keys over REST: authentication, scopes, owners, quotas and rate limits."""

import socket
import time

import pytest

from islands_api.web.routes import events
from islands_service.store.keys import SCOPES
from support.service import PATIENCE, csv, held, kept, problem_of, queued, spec

#: Routes that need a key, and the scope that they need.
GUARDED = {
    ("GET", "/v1/jobs"): "read",
    ("POST", "/v1/jobs"): "write",
    ("GET", "/v1/jobs/{job}"): "read",
    ("PATCH", "/v1/jobs/{job}"): "write",
    ("DELETE", "/v1/jobs/{job}"): "write",
    ("POST", "/v1/jobs/{job}/cancel"): "write",
    ("POST", "/v1/jobs/{job}/stop"): "write",
    ("POST", "/v1/jobs/{job}/resume"): "write",
    ("GET", "/v1/jobs/{job}/history"): "read",
    ("GET", "/v1/jobs/{job}/events"): "read",
    ("GET", "/v1/jobs/{job}/free-run"): "read",
    ("GET", "/v1/jobs/{job}/models"): "read",
    ("GET", "/v1/jobs/{job}/models/{rank}"): "read",
    ("GET", "/v1/jobs/{job}/models/{rank}/export"): "read",
    ("GET", "/v1/jobs/{job}/models/{rank}/figures"): "read",
    ("GET", "/v1/jobs/{job}/models/{rank}/figures/{figure}.svg"): "read",
    ("GET", "/v1/jobs/{job}/models/{rank}/figures/{figure}.csv"): "read",
    ("GET", "/v1/jobs/{job}/models/{rank}/simulation"): "read",
    ("POST", "/v1/jobs/{job}/models/{rank}/simulate"): "read",
    ("POST", "/v1/jobs/{job}/models/{rank}/scenarios"): "read",
    ("GET", "/v1/jobs/{job}/models/{rank}/linear-system"): "read",
    ("GET", "/v1/jobs/{job}/models/{rank}/linear-system/{figure}.svg"): "read",
    ("GET", "/v1/jobs/{job}/models/{rank}/linear-system/{figure}.csv"): "read",
    ("GET", "/v1/jobs/{job}/models/{rank}/fmu"): "read",
    ("GET", "/v1/jobs/{job}/result"): "read",
    ("GET", "/v1/jobs/{job}/figures"): "read",
    ("GET", "/v1/jobs/{job}/figures/{figure}.svg"): "read",
    ("GET", "/v1/jobs/{job}/figures/{figure}.csv"): "read",
    ("GET", "/v1/jobs/{job}/report"): "read",
    ("GET", "/v1/comparisons/report"): "read",
    ("GET", "/v1/jobs/{job}/extended"): "read",
    ("GET", "/v1/jobs/{job}/extended/export"): "read",
    ("GET", "/v1/jobs/{job}/outputs"): "read",
    ("GET", "/v1/jobs/{job}/next-experiment"): "read",
    ("POST", "/v1/discrepancies"): "write",
    ("GET", "/v1/simulations"): "read",
    ("POST", "/v1/simulations/equations"): "read",
    ("POST", "/v1/simulations/preview"): "read",
    ("GET", "/v1/fmus"): "read",
    ("POST", "/v1/fmus"): "write",
    ("GET", "/v1/fmus/{fmu}"): "read",
    ("DELETE", "/v1/fmus/{fmu}"): "write",
    ("GET", "/v1/datasets"): "read",
    ("POST", "/v1/datasets"): "write",
    ("POST", "/v1/datasets/fetch"): "write",
    ("GET", "/v1/datasets/{dataset}"): "read",
    ("GET", "/v1/datasets/{dataset}/samples"): "read",
    ("POST", "/v1/datasets/{dataset}/readings"): "write",
    ("GET", "/v1/presets"): "read",
    ("DELETE", "/v1/datasets/{dataset}"): "write",
    ("GET", "/metrics"): "metrics",
    ("GET", "/v1/admin/keys"): "admin",
    ("POST", "/v1/admin/keys"): "admin",
    ("POST", "/v1/admin/keys/{key}/revoke"): "admin",
    ("GET", "/v1/admin/owners"): "admin",
    ("GET", "/v1/admin/owners/{owner}"): "admin",
    ("PATCH", "/v1/admin/owners/{owner}"): "admin",
    ("GET", "/v1/webhooks"): "read",
    ("POST", "/v1/webhooks"): "write",
    ("DELETE", "/v1/webhooks/{webhook}"): "write",
    ("GET", "/v1/webhooks/{webhook}/deliveries"): "read",
    ("GET", "/v1/monitors"): "read",
    ("POST", "/v1/monitors"): "write",
    ("GET", "/v1/monitors/{monitor}"): "read",
    ("GET", "/v1/monitors/{monitor}/state"): "read",
    ("GET", "/v1/monitors/{monitor}/records"): "read",
    ("POST", "/v1/monitors/{monitor}/records"): "write",
    ("DELETE", "/v1/monitors/{monitor}"): "write",
    ("GET", "/v1/caller"): "read",
    ("GET", "/v1/admin/jobs"): "admin",
    ("POST", "/v1/admin/jobs/{job}/cancel"): "admin",
}

#: Public routes.
OPEN = {("GET", "/healthz"), ("GET", "/readyz"), ("GET", "/problems/{kind}")}


@pytest.fixture(scope="module")
def shared(serve):
    with serve(require_keys=True, rate=0.0, max_active=3, max_stored=20_000) as running:
        yield running


def send_request(service, method, path, headers):
    """Send a request, with a body if the route needs one."""
    ids = dict.fromkeys(("job", "dataset", "webhook", "monitor", "fmu"), "0" * 32)
    path = path.format(rank=1, figure="loop", key="0", owner="0", **ids)
    body = {"json": spec("0-csv")} if (method, path) == ("POST", "/v1/jobs") else {}
    if path == "/v1/discrepancies":
        body = {"json": held("0-csv")}
    if path == "/v1/simulations/preview":
        body = {"json": held("0-csv")}
    if path == "/v1/simulations/equations":
        body = {"json": {"text": ""}}
    if method == "POST" and path.endswith("/readings"):
        body = {"json": {}}
    if path.endswith("/scenarios"):
        body = {"json": {"datasets": [{"dataset": "0-csv"}]}}
    if path.endswith("/simulate"):
        body = {"json": {"samples": 10}}
    if method == "POST" and path.endswith("/records"):
        body = {"json": {"dataset": "0-csv"}}
    if (method, path) == ("POST", "/v1/monitors"):
        body = {"json": {"diagnosis": "0" * 32}}
    if method == "PATCH" or (path.startswith("/v1/admin") and method == "POST"):
        body = {"json": {}}
    if (method, path) in {("POST", "/v1/webhooks"), ("POST", "/v1/datasets/fetch")}:
        body = {"json": {"url": "https://127.0.0.1"}}
    if (method, path) in {("POST", "/v1/datasets"), ("POST", "/v1/fmus")}:
        body = {"files": {"file": ("a.csv", b"")}}
    return service.client.request(method, path, headers=headers, **body)


def test_every_route_is_open_or_guarded(service):
    document = service.client.get("/openapi.json").json()
    routes = {(method.upper(), path) for path, entry in document["paths"].items() for method in entry}
    assert routes == GUARDED.keys() | OPEN
    for method, path in routes:
        operation = document["paths"][path][method.lower()]
        assert operation.get("security", []) == ([] if (method, path) in OPEN else [{"key": []}])


@pytest.mark.parametrize(("method", "path"), GUARDED)
def test_requests_without_a_valid_key_are_rejected(service, method, path):
    for headers in ({}, {"Authorization": "Basic aTpp"}, {"Authorization": "Bearer"}):
        answer = send_request(service, method, path, headers)
        assert "this service needs a key" in problem_of(answer, 401, "no-key")
        assert answer.headers["www-authenticate"].startswith("Bearer")
    answer = send_request(service, method, path, {"Authorization": "Bearer islands_wrong"})
    assert problem_of(answer, 401, "no-key").startswith("the key is unknown")


@pytest.mark.parametrize(("method", "path"), GUARDED)
def test_a_key_allows_only_the_routes_of_its_scopes(service, method, path):
    needed = GUARDED[method, path]
    others = sorted(SCOPES.keys() - {needed})
    answer = send_request(service, method, path, service.key(*others))
    assert problem_of(answer, 403, "scope-missing") == (
        f"the key has the scopes {', '.join(others)}, but this request needs {needed}: ask for another key"
    )
    assert send_request(service, method, path, service.key(needed)).status_code in (200, 404, 422)


def test_a_key_shows_only_the_data_of_its_owner(service):
    mine, theirs = service.key(owner="me"), service.key(owner="them")
    seen = {"me": queued(service.store, "me").id, "them": queued(service.store, "them").id}
    kept(service.store, "me")
    for header, owner in ((mine, "me"), (theirs, "them"), (service.key(owner="me"), "me")):
        jobs = service.client.get("/v1/jobs", headers=header).json()["items"]
        assert [job["id"] for job in jobs] == [seen[owner]]
        datasets = service.client.get("/v1/datasets", headers=header).json()["items"]
        assert len(datasets) == (owner == "me")
        assert "owner" not in jobs[0]


def test_secrets_are_neither_stored_nor_logged(service):
    secret = service.key()["Authorization"].removeprefix("Bearer ")
    service.client.get("/v1/jobs", headers={"Authorization": f"Bearer {secret}"})
    for path in service.settings.data_dir.rglob("*"):
        assert path.is_dir() or secret.encode() not in path.read_bytes()
    assert secret not in str(service.logs)


@pytest.mark.parametrize("end", ["revoked", pytest.param("expired", marks=pytest.mark.ci)])
def test_a_stream_ends_with_its_key(service, monkeypatch, end):
    monkeypatch.setattr(events, "_KEEP_ALIVE_SECONDS", 0.05)
    path = f"/v1/jobs/{queued(service.store, 'me').id}/events"
    mine = service.key(owner="me", seconds=2.0 if end == "expired" else None)
    with service.client.stream("GET", path, headers=mine) as answer:
        pieces = answer.iter_text()
        while "alive" not in next(pieces):
            pass
        if end == "revoked":
            (key,) = service.store.keys.all()
            service.store.keys.revoke(key.id)
        began = time.monotonic()
        for _ in pieces:
            assert time.monotonic() - began < PATIENCE
    problem_of(service.client.get(path, headers=mine), 401, "no-key")


@pytest.fixture
def strict(serve):
    with serve(require_keys=True, rate=2.0, burst=20) as running:
        yield running


def count_accepted(service, headers, most=60):
    """Send requests until one is rate-limited; return the number of accepted ones and the last response."""
    for count in range(most):
        answer = service.client.get("/v1/jobs", headers=headers)
        if answer.status_code == 429:
            return count, answer
    return most, answer


def test_the_rate_limit_applies_to_each_key_separately(strict):
    mine, theirs = strict.key(), strict.key()
    count, answer = count_accepted(strict, mine)
    assert 20 <= count <= 30
    detail = problem_of(answer, 429, "too-many-requests")
    assert "more than 2 requests per second: wait" in detail
    assert "?wait=30" in detail
    assert strict.client.get("/v1/jobs", headers=theirs).status_code == 200
    time.sleep(int(answer.headers["retry-after"]))
    assert strict.client.get("/v1/jobs", headers=mine).status_code == 200


@pytest.mark.parametrize(("wrong", "least"), [({"Authorization": "Bearer islands_guess"}, 2), ({}, 20)])
def test_the_rate_of_invalid_keys_of_an_address_is_limited(strict, wrong, least):
    mine = strict.key()
    count, answer = count_accepted(strict, wrong)
    assert least <= count <= least + 10
    assert "wait" in problem_of(answer, 429, "too-many-requests")
    assert int(answer.headers["retry-after"]) >= 1
    assert strict.client.get("/v1/jobs", headers=mine).status_code == 200
    assert strict.client.get("/healthz").status_code == 200


@pytest.mark.parametrize("path", ["/v1/datasets", "/v1/jobs"])
def test_a_request_without_a_key_is_rejected_before_its_body(service, path):
    """The response must arrive before the body is complete."""
    with socket.create_connection(("127.0.0.1", service.port), PATIENCE) as client:
        client.sendall(
            f"POST {path} HTTP/1.1\r\nHost: localhost\r\nContent-Length: 900000\r\n"
            "Content-Type: multipart/form-data; boundary=x\r\n\r\n--x\r\n".encode()
        )
        assert client.recv(100).startswith(b"HTTP/1.1 401 ")


@pytest.mark.parametrize(
    ("form", "why"),
    [
        ([("file", ("a.csv", csv())), ("file", ("b.csv", csv()))], "Too many files"),
        ([("file", ("a.csv", csv())), ("output", (None, "y" * 20_000))], "exceeded maximum size"),
        ([("file", ("a.csv", csv())), *[("inputs", (None, "u"))] * 300], "Too many fields"),
    ],
)
def test_forms_with_too_many_or_too_large_parts_are_rejected(service, form, why):
    answer = service.client.post("/v1/datasets", files=form, headers=service.key())
    assert why in problem_of(answer, 400, "bad-request")
