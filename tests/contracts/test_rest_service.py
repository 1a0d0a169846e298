"""Service-level REST behaviour: origins and host names, metrics, health checks and request log."""

import json

import pytest
from prometheus_client.parser import text_string_to_metric_families

from islands_service.domain.job import JobState, ProgressReport
from support.service import kept, problem_of, queued, spec
from support.stores import FOUND, claimed


@pytest.mark.parametrize(
    "origin",
    [
        "https://evil.example",
        "http://localhost:1",
        "http://127.0.0.1",
        "null",
        "http://[",
        "file://",
        "http://127.0.0.1:{port}.evil.example",
        "http://evil.example/127.0.0.1:{port}",
        "",
    ],
)
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_requests_from_pages_of_other_sites_are_rejected(service, method, origin):
    headers = {"Origin": origin.format(port=service.port)}
    body = json.dumps(spec(kept(service.store))).encode()
    answer = service.client.request(
        method, "/v1/jobs", headers={**headers, "Content-Type": "application/json"}, content=body
    )
    assert "open the service's own page" in problem_of(answer, 403, "cross-origin")
    assert not service.store.jobs.page("local").jobs
    assert not [name for name in answer.headers if name.startswith("access-control")]


@pytest.mark.parametrize("requested_method", ["GET", "POST", "DELETE"])
def test_preflight_requests_for_other_sites_are_rejected(service, requested_method):
    headers = {"Origin": "https://evil.example", "Access-Control-Request-Method": requested_method}
    answer = service.client.options("/v1/jobs", headers=headers)
    problem_of(answer, 403, "cross-origin")
    assert not [name for name in answer.headers if name.startswith("access-control")]


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "evil.example:8000",
        "127.0.0.1.evil.example",
        "[::2]",
        "[",
        "testserver",
        "0.0.0.0",
        "",
    ],
)
def test_foreign_host_names_are_rejected(service, host):
    answer = service.client.get("/v1/jobs", headers={"Host": host})
    assert "it accepts only loopback names" in problem_of(answer, 403, "cross-origin")


def read_metrics(service):
    """Read the metrics: values by name and labels."""
    answer = service.client.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain; version=")
    return {
        (sample.name, tuple(sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(answer.text)
        for sample in family.samples
    }


def count_jobs_by_state(service):
    found = read_metrics(service)
    return {state: found["islands_jobs", (("state", state),)] for state in JobState}


def test_metrics_show_the_current_state_of_jobs(service):
    assert set(count_jobs_by_state(service).values()) == {0.0}
    for _ in range(3):
        queued(service.store)
    lease = claimed(service.store)
    service.store.leases.report(
        lease, ProgressReport({"evaluations_per_second": 120.5, "best_error": 0.25, "generation": 7})
    )
    found = read_metrics(service)
    label = (("job", lease.job.id),)
    assert found["islands_evaluations_per_second", label] == 120.5
    assert found["islands_best_error", label] == 0.25
    assert found["islands_generation", label] == 7.0
    assert found["islands_leases", ()] == 1.0
    assert 0.0 <= found["islands_queue_oldest_seconds", ()] < 60.0
    service.store.leases.finish(lease, FOUND)
    assert count_jobs_by_state(service) == {
        "queued": 2,
        "running": 0,
        "succeeded": 1,
        "failed": 0,
        "cancelled": 0,
    }
    assert ("islands_best_error", label) not in read_metrics(service)


def test_metrics_count_requests_by_route_and_not_by_path(service):
    def counts(route, method, status):
        label = (("method", method), ("route", route), ("status", status))
        return read_metrics(service).get(("islands_request_seconds_count", label), 0.0)

    jobs = [queued(service.store).id for _ in range(3)]
    before = (
        counts("/v1/jobs/{job}", "GET", "200"),
        counts("none", "GET", "404"),
        counts("none", "POST", "404"),
    )
    for job in jobs:
        service.client.get(f"/v1/jobs/{job}")
        service.client.get(f"/nothing/{job}")
    assert counts("/v1/jobs/{job}", "GET", "200") == before[0] + 3
    assert counts("none", "GET", "404") == before[1] + 3
    assert counts("none", "POST", "404") == before[2]
    routes = {
        dict(labels)["route"]
        for name, labels in read_metrics(service)
        if name == "islands_request_seconds_count"
    }
    paths = set(service.client.get("/openapi.json").json()["paths"])
    assert routes <= paths | {"none", "/", "/dashboard/{name}", "/openapi.json"}


def test_the_log_has_all_requests_except_health_checks(service):
    header = service.key("read", owner="me")
    service.logs.clear()
    answer = service.client.get("/v1/jobs?state=queued", headers={"X-Request-ID": "abc", **header})
    service.client.get("/healthz")
    service.client.get("/readyz")
    (line,) = service.logs
    assert line.pop("ms") >= 0.0
    assert line == {
        "event": "request",
        "log_level": "info",
        "client": "127.0.0.1",
        "owner": "me",
        "key": service.store.keys.all()[0].id,
        "method": "GET",
        "path": "/v1/jobs",
        "status": 200,
        "received": 0,
        "sent": len(answer.content),
        "request_id": "abc",
    }
