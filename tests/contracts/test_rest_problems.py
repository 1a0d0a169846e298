"""Problems over REST: every error response is a problem document and reveals no internals."""

import re

import httpx
import pytest
from fastapi.responses import StreamingResponse

from islands_api.web.problems import PROBLEMS
from islands_service.store.blobs import BlobNotFoundError
from islands_service.store.database import CommitUnknownError
from support.repository import DOCS
from support.service import emptied, problem_of, queued, run_identification, spec

FORM = {"type", "title", "status", "detail", "request_id"}


@pytest.fixture(scope="module")
def service(serve):
    with serve() as running:
        running.app.add_api_route("/defect", defect)
        running.app.add_api_route("/late", late, methods=["POST"])
        running.app.add_api_route("/half", half)
        running.app.add_api_route("/doubt", doubt, methods=["POST"])
        running.app.add_api_route("/lost", lost)
        yield running


async def defect():
    password = "secret"
    raise ZeroDivisionError(f"the password is {password}")


def late():
    raise KeyError("in a thread")


async def doubt():
    raise CommitUnknownError("connection to server at 10.0.0.7 failed: it is unknown whether it was written")


async def lost():
    raise BlobNotFoundError("the blob 0 is not in /srv/islands/blobs: restore the data folder from a backup")


async def half():
    async def pieces():
        yield b"half of "
        raise ZeroDivisionError

    return StreamingResponse(pieces())


@pytest.mark.parametrize(
    ("method", "path", "allowed"),
    [
        ("PUT", "/v1/jobs", "GET, HEAD, POST"),
        ("DELETE", "/v1/datasets", "GET, HEAD, POST"),
        ("PUT", "/v1/jobs/{job}", "GET, HEAD, PATCH, DELETE"),
        ("GET", "/v1/jobs/{job}/cancel", "POST"),
        ("OPTIONS", "/v1/jobs/{job}/models/1", "GET, HEAD"),
        ("TRACE", "/healthz", "GET, HEAD"),
        ("POST", "/", "GET, HEAD"),
        ("POST", "/openapi.json", "GET, HEAD"),
    ],
)
def test_a_wrong_method_is_rejected_with_the_allowed_ones(service, method, path, allowed):
    path = path.format(job=queued(service.store).id)
    answer = service.client.request(method, path)
    assert problem_of(answer, 405, "method-not-allowed") == f"{path} does not accept {method}: use {allowed}"
    assert answer.headers["allow"] == allowed


@pytest.mark.parametrize(
    "path",
    [
        "/nothing",
        "/v1",
        "/v2/jobs",
        "/v1/jobs/",
        "/v1/datasets/",
        "/v1/jobs/a/b/c",
        "/v1/jobs/%2e%2e/%2e%2e/etc/passwd",
        "/dashboard/../app.py",
        "/dashboard/..%2fapp.py",
        "/dashboard/nothing.js",
        "/redoc",
        "/problems/nothing",
        "/.git/config",
        "//v1/jobs",
    ],
)
def test_unknown_paths_are_not_found(service, path):
    url = httpx.URL(service.url).copy_with(raw_path=path.encode())
    problem_of(service.client.get(url), 404, "not-found")


@pytest.mark.parametrize(
    "path",
    [
        "/v1/jobs/%00",
        "/v1/jobs/a b",
        "/v1/jobs/" + "a" * 65,
        "/v1/jobs/ü",
        "/v1/datasets/%00",
        "/v1/datasets/" + "a" * 49,
        "/v1/jobs?limit=0",
        "/v1/jobs?limit=201",
        "/v1/jobs?limit=many",
        "/v1/jobs?state=sleeping",
        "/v1/jobs?cursor=" + "x" * 201,
        "/v1/jobs/{job}?wait=-1",
        "/v1/jobs/{job}?wait=61",
        "/v1/jobs/{job}?wait=nan",
        "/v1/jobs/{job}/history?after=-2",
        "/v1/jobs/{job}/history?after=2147483648",
        "/v1/jobs/{job}/models/0",
        "/v1/jobs/{job}/models/best",
        "/v1/jobs/{job}/figures/A.svg",
    ],
)
def test_a_parameter_out_of_range_is_named_in_the_problem(service, path):
    answer = service.client.get(path.format(job=queued(service.store).id))
    detail = problem_of(answer, 422, "invalid-request")
    (error,) = answer.json()["errors"]
    assert error["pointer"] in {
        "job",
        "dataset",
        "limit",
        "state",
        "cursor",
        "wait",
        "after",
        "rank",
        "figure",
    }
    assert detail == f"{error['pointer']}: {error['detail']}"


@pytest.mark.parametrize(("method", "path"), [("GET", "/defect"), ("POST", "/late")])
def test_a_defect_shows_a_request_id_and_nothing_else(service, method, path):
    answer = service.client.request(method, path, headers={"X-Request-ID": "find4me"})
    assert problem_of(answer, 500, "defect") == (
        "This is a defect of the service: report it with the id of the request."
    )
    assert answer.json().keys() == FORM
    assert answer.headers["x-request-id"] == "find4me"
    assert not re.search(r"secret|Traceback|Error|\.py", answer.text)
    entry = [each for each in service.logs if each.get("exc_info") and each["request_id"] == "find4me"][-1]
    assert (entry["event"], entry["log_level"]) == ("defect", "error")
    assert isinstance(entry["exc_info"], ZeroDivisionError | KeyError)


def test_an_unknown_commit_is_not_reported_as_failed(service):
    """A client that takes it for a failure would repeat the request and create a duplicate."""
    answer = service.client.post("/doubt")
    detail = problem_of(answer, 504, "store-in-doubt")
    assert CommitUnknownError.__doc__ in detail
    assert "repeat the request with the same idempotency key" in detail
    assert "10.0.0.7" not in answer.text
    assert "retry-after" not in answer.headers


def test_a_truncated_response_is_an_error_for_the_client(service):
    service.logs.clear()
    with pytest.raises(httpx.RemoteProtocolError, match="incomplete"):
        service.client.get("/half")
    assert service.client.get("/healthz").status_code == 200
    assert [entry["event"] for entry in service.logs] == ["defect", "request"]


@pytest.mark.parametrize("path", ["/healthz", "/nothing", "/v1/jobs", "/defect", "/", "/v1/jobs?limit=0"])
def test_every_response_has_security_headers(service, path):
    headers = service.client.get(path).headers
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["x-frame-options"] == "DENY"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cross-origin-resource-policy"] == "same-origin"
    assert "default-src 'self'" in headers["content-security-policy"]
    assert "server" not in headers
    assert "strict-transport-security" not in headers
    assert not [name for name in headers if name.startswith("access-control")]


def test_every_problem_type_is_described_at_its_path(service):
    types = {problem.type: problem for problem in PROBLEMS.values()}
    for kind, problem in types.items():
        answer = service.client.get(f"/problems/{kind}")
        assert answer.status_code == 200
        assert answer.json() == {
            "type": f"/problems/{kind}",
            "status": int(problem.status),
            "title": problem.title,
        }


def test_the_guide_of_the_rest_api_lists_every_type_of_problem():
    page = (DOCS / "how-to" / "use-the-rest-api.md").read_text()
    rows = re.findall(r"^\| `([a-z-]+)` \| (\d{3}) \| .+ \|$", page, re.MULTILINE)
    assert sorted(rows) == sorted({(each.type, str(int(each.status))) for each in PROBLEMS.values()})


@pytest.mark.ci
def test_no_problem_contains_a_path_of_the_machine(service):
    """Uploads are read in temporary folders, and blobs are in the data folder."""
    sent = [(b"", "a.csv"), (b"PK\x03\x04garbage", "a.npz"), (b"\x89HDF\r\n\x1a\n" + b"x" * 99, "a.mat")]
    answers = [service.upload(content, name) for content, name in [*sent, (b"PAR1xPAR1", "a.parquet")]]
    job = run_identification(emptied(service))
    dataset = service.client.get(f"/v1/jobs/{job}").json()["spec"]["dataset"]
    for path in service.settings.blobs.glob("??/*"):
        path.unlink()
    answers += [
        service.submit(**spec(dataset, rows="0:50")),
        service.client.get(f"/v1/jobs/{job}/report"),
        service.client.get(f"/v1/jobs/{job}/models/1/simulation"),
    ]
    for answer in answers:
        assert answer.status_code >= 400
        assert str(service.settings.data_dir) not in answer.text
        assert "/tmp" not in answer.text
        assert answer.json()["detail"]
