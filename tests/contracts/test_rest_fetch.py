"""Data sets from URLs: listed hosts and buckets only, within the limits of uploads, with their source."""

import ssl
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import httpx
import pytest
import trustme

from islands.errors import SettingsError
from islands_api.client import Client
from islands_api.web import uploads
from islands_service import outbound
from islands_service.outbound import CheckedClient
from islands_service.settings import service_settings
from support.object_stores import make_bucket, s3_server
from support.service import Service, csv, problem_of

HOST, OTHER = "data.example.org", "other.example.org"


@dataclass
class Site:
    """HTTPS server of both hosts on this machine: responses by path, and the paths that were requested."""

    port: int = 0
    pages: dict[str, Callable[[BaseHTTPRequestHandler], None]] = field(default_factory=dict)
    asked: list[str] = field(default_factory=list)

    def url(self, path: str, host: str = HOST) -> str:
        return f"https://{host}:{self.port}{path}"


def send(status: int, content: bytes = b"", /, **headers: str) -> Callable[[BaseHTTPRequestHandler], None]:
    def respond(request: BaseHTTPRequestHandler) -> None:
        request.send_response(status)
        for name, value in {"Content_Length": str(len(content)), **headers}.items():
            request.send_header(name.replace("_", "-"), value)
        request.end_headers()
        request.wfile.write(content)

    return respond


@pytest.fixture(scope="module")
def authority() -> trustme.CA:
    return trustme.CA()


@pytest.fixture(scope="module")
def _server(authority: trustme.CA) -> Iterator[Site]:
    site = Site()
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    authority.issue_cert(HOST, OTHER).configure_cert(context)

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            site.asked.append(self.path)
            site.pages[self.path.partition("?")[0]](self)

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.socket = context.wrap_socket(server.socket, server_side=True, do_handshake_on_connect=False)
    site.port = server.server_address[1]
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    yield site
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.fixture
def site(_server: Site) -> Site:
    _server.pages.clear()
    _server.asked.clear()
    return _server


@pytest.fixture(scope="module")
def service(serve: Any, authority: trustme.CA) -> Iterator[Service]:
    listed = {"dataset_hosts": HOST, "dataset_buckets": "s3://measured/lab", "max_upload": 100_000}
    with (
        serve(**listed, max_stored=150_000, body_timeout=0.3) as running,
        pytest.MonkeyPatch.context() as patch,
    ):
        tls = ssl.create_default_context()
        authority.configure_trust(tls)

        async def resolve(_host: str, _port: int, _threads: object) -> tuple[str, ...]:
            return ("127.0.0.1",)

        patch.setattr(outbound, "resolve", resolve)
        state = running.app.state.islands
        running.app.state.islands = replace(state, outbound=CheckedClient((HOST, OTHER), (), tls))
        yield running


def fetch(
    service: Service, url: str, headers: dict[str, str] | None = None, /, **asked: Any
) -> httpx.Response:
    return service.client.post("/v1/datasets/fetch", json={"url": url, **asked}, headers=headers)


@pytest.mark.ci
def test_a_record_is_downloaded_checked_and_stored_with_its_source(service: Service, site: Site) -> None:
    content = csv(300)
    site.pages = {
        "/a.csv": send(200, content),
        "/moved": send(302, Location=f"https://{HOST}:{site.port}/a.csv"),
        "/text": send(200, csv(310)),
    }
    made = fetch(service, site.url("/a.csv?signature=secret#part"), inputs=["u_V"], output="y_um")
    assert made.status_code == 201, made.text
    document = made.json()
    assert (document["name"], document["bytes"]) == ("a.csv", len(content))
    assert document["source"] == site.url("/a.csv")
    assert service.client.get(made.headers["location"]).json() == document
    assert service.client.get("/v1/datasets").json()["items"][0]["source"] == site.url("/a.csv")
    (entry,) = service.store.audit.entries(limit=1)
    assert (entry.action, entry.subject) == ("upload-dataset", document["id"])
    assert "a.csv" in str(entry.details)
    assert "secret" not in str(entry.details)
    assert not [line for line in service.logs if "secret" in str(line)]
    # The same bytes are the same data set, by whatever way they come.
    assert fetch(service, site.url("/moved"), name="b.csv").json()["id"] == document["id"]
    assert service.upload(content).status_code == 200
    with Client(service.url) as client:
        assert client.fetch(site.url("/text"), name="c.csv").source == site.url("/text")
    # Checked like an upload.
    problem_of(
        fetch(service, site.url("/text"), name="c.csv", inputs=["absent"], output="y_um"),
        422,
        "invalid-record",
    )


@pytest.mark.ci
def test_an_object_of_a_listed_bucket_is_copied(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    with s3_server(monkeypatch) as endpoint:
        uploads._open_bucket.cache_clear()
        client = make_bucket(endpoint, "measured")
        for key, content in (("lab/a.csv", csv(320)), ("lab/big.csv", bytes(100_001)), ("b.csv", csv())):
            client.put_object(Bucket="measured", Key=key, Body=content)
        made = fetch(service, "s3://measured/lab/a.csv")
        assert (made.status_code, made.json()["source"]) == (201, "s3://measured/lab/a.csv")
        problem_of(fetch(service, "s3://measured/lab/big.csv"), 413, "too-large")
        problem_of(fetch(service, "s3://measured/lab/absent.csv"), 422, "source-failed")
        assert "ISLANDS_DATASET_BUCKETS" in problem_of(
            fetch(service, "s3://measured/b.csv"), 422, "invalid-settings"
        )
    uploads._open_bucket.cache_clear()


@pytest.mark.parametrize(
    ("url", "reason"),
    [
        (
            "https://other.example.org/a.csv",
            "other.example.org is not a host for data sets: ask the operator",
        ),
        ("https://data.example.org.evil.test/a.csv", "is not a host for data sets"),
        ("http://data.example.org/a.csv", "none of HTTPS"),
        ("https://user:word@data.example.org/a.csv", "without a password"),
        ("file:///etc/passwd.csv", "none of HTTPS"),
        ("s3://measured/lab/../secret/a.csv", "not one of an object"),
        ("s3://measured/lab//a.csv", "not one of an object"),
        ("https://xn--]data.example.org/a.csv", "none of HTTPS"),
        ("https://xn--/a.csv", "HTTPS"),
        ("s3://measured/lab/a.csv?versionId=1", "not one of an object"),
        ("s3://measured/laboratory/a.csv", "ISLANDS_DATASET_BUCKETS"),
        ("s3://other/lab/a.csv", "ISLANDS_DATASET_BUCKETS"),
    ],
)
def test_a_url_that_is_not_listed_is_refused_without_a_request(
    service: Service, site: Site, url: str, reason: str
) -> None:
    assert reason in problem_of(fetch(service, url), 422, "invalid-settings")
    assert not site.asked


def test_nothing_is_listed_by_default(serve: Any) -> None:
    with serve() as plain:
        for url, setting in (("https://a.org/a.csv", "HOSTS"), ("s3://bucket/a.csv", "BUCKETS")):
            detail = problem_of(fetch(plain, url), 422, "invalid-settings")
            assert f"ISLANDS_DATASET_{setting}" in detail


def test_a_listed_host_with_a_private_address_needs_another_permission(service: Service, site: Site) -> None:
    state = service.app.state.islands
    service.app.state.islands = replace(state, outbound=CheckedClient())
    try:
        detail = problem_of(fetch(service, site.url("/a.csv")), 422, "invalid-settings")
    finally:
        service.app.state.islands = state
    assert "ISLANDS_PRIVATE_HOSTS" in detail
    assert "127.0.0.1" not in detail
    assert not site.asked


@pytest.mark.parametrize(
    "target",
    [
        "https://other.example.org:{port}/a.csv",
        "https://xn--]a.org/a.csv",
        "http://data.example.org:{port}/a.csv",
        "s3://other/a.csv",
    ],
)
def test_a_redirect_to_an_address_that_is_not_listed_is_refused(
    service: Service, site: Site, target: str
) -> None:
    site.pages = {"/a.csv": send(307, Location=target.format(port=site.port))}
    answer = fetch(service, site.url("/a.csv"))
    assert answer.json()["type"] in ("/problems/invalid-settings", "/problems/source-failed")
    assert answer.status_code == 422
    assert site.asked == ["/a.csv"]


def test_redirects_are_followed_three_times(service: Service, site: Site) -> None:
    site.pages = {"/a.csv": send(302, Location="/a.csv")}
    assert "redirects more than 3 times" in problem_of(
        fetch(service, site.url("/a.csv")), 422, "source-failed"
    )
    assert len(site.asked) == 4


def test_a_response_that_is_no_file_is_refused(service: Service, site: Site) -> None:

    def stall(request: BaseHTTPRequestHandler) -> None:
        send(200, Content_Length="100")(request)
        threading.Event().wait(0.5)

    site.pages = {
        "/absent.csv": send(404),
        "/packed.csv": send(200, b"x", Content_Encoding="gzip"),
        "/cut.csv": send(200, b"short", Content_Length="100"),
        "/slow.csv": stall,
    }
    for path, reason in (
        ("absent", "status 404"),
        ("packed", "compresses"),
        ("cut", "failed"),
        ("slow", "has sent nothing for 0.3 s"),
    ):
        assert reason in problem_of(fetch(service, site.url(f"/{path}.csv")), 422, "source-failed")
    problem_of(fetch(service, site.url("/record.mf4")), 422, "invalid-record")
    assert "/record.mf4" not in site.asked  # its name is refused before
    site.pages["/page.html"] = send(200, b"<html><p>1</p></html>")
    assert "HTML" in problem_of(fetch(service, site.url("/page.html")), 422, "invalid-record")


def test_a_file_beyond_the_limits_ends_while_it_is_received(service: Service, site: Site) -> None:
    """Whether its size is declared or not."""
    sent: list[int] = []

    def endless(request: BaseHTTPRequestHandler) -> None:
        request.send_response(200)
        request.end_headers()
        try:
            for _ in range(10_000):
                request.wfile.write(bytes(10_000))
                sent.append(10_000)
        except OSError:
            pass

    site.pages = {"/endless.csv": endless, "/big.csv": send(200, bytes(100_001))}
    for path in ("endless", "big"):
        problem_of(fetch(service, site.url(f"/{path}.csv")), 413, "too-large")
    assert sum(sent) < 50_000_000
    assert not [path for path in service.settings.blobs.glob("*") if path.is_file()]


@pytest.mark.parametrize(
    "listed", ["s3://islands", "s3://islands/blobs", "s3://islands/blobs/ab", "s3://abc,s3://islands"]
)
def test_the_bucket_of_the_service_cannot_be_listed(listed: str) -> None:
    """An owner could otherwise read the uploads of all others."""
    with pytest.raises(SettingsError, match="ISLANDS_BLOB_STORE"):
        service_settings(blob_store="s3://islands/blobs", dataset_buckets=listed)
    settings = service_settings(blob_store="s3://islands/blobs", dataset_buckets="s3://islands/blobs-of-labs")
    assert settings.dataset_buckets
