"""REST interface behind proxies: origins, prefixes, client addresses, HEAD, readiness."""

import errno
import threading
from functools import partial

import pytest
from sqlalchemy import event

from islands.errors import SettingsError
from islands_api.web import app
from islands_api.web.routes import service as routes
from islands_service.settings import service_settings
from support.processes import eventually
from support.service import csv, kept, problem_of, queued, spec

#: Header of the proxy of another site or of the service's own page, as browsers send it.
SITE = "Sec-Fetch-Site"


@pytest.fixture(scope="module")
def behind_proxy(serve):
    """A service with keys that a proxy on this machine offers under a prefix."""
    with serve(require_keys=True, root_path="/tools/islands", trusted_proxies="127.0.0.1") as running:
        yield running


def test_the_default_of_a_proxy_that_changes_the_host_is_accepted(behind_proxy):
    """By default nginx sends the name of the upstream as Host, and passes Origin on."""
    headers = {**behind_proxy.key(), "Origin": "https://islands.example.org"}
    order = spec(kept(behind_proxy.store, behind_proxy.store.keys.all()[0].owner))
    assert behind_proxy.submit(headers, **order).status_code == 202
    assert behind_proxy.submit({**headers, SITE: "same-origin"}, **order).status_code == 202
    for site in ("cross-site", "same-site"):
        problem_of(behind_proxy.submit({**headers, SITE: site}, **order), 403, "cross-origin")


@pytest.mark.parametrize("site", ["cross-site", "same-site", "same-origin"])
def test_a_service_without_keys_believes_the_browser_about_the_site(service, site):
    """A proxy on another port of this machine changes the host, and the browser knows it better."""
    headers = {"Origin": "http://127.0.0.1:1", SITE: site}
    answer = service.submit(headers, **spec(kept(service.store)))
    assert answer.status_code == (202 if site == "same-origin" else 403)
    rebound = {"Origin": "http://evil.example", "Host": "evil.example", SITE: "same-origin"}
    assert "--require-keys" in problem_of(
        service.client.get("/v1/jobs", headers=rebound), 403, "cross-origin"
    )


@pytest.mark.ci
@pytest.mark.parametrize("prefix", ["", "/tools/islands"])
def test_a_location_has_the_prefix_of_the_proxy(behind_proxy, prefix, monkeypatch):
    """Some proxies remove the prefix from the path, and some do not."""
    monkeypatch.setattr("islands_api.web.middleware.MAX_BODY_BYTES", 1000)  # less than the upload
    headers = behind_proxy.key()
    answer = behind_proxy.client.post(
        f"{prefix}/v1/datasets", files={"file": ("record.csv", csv())}, headers=headers
    )
    assert answer.status_code in (200, 201), answer.text
    dataset = answer.json()["id"]
    assert answer.headers["location"] == f"/tools/islands/v1/datasets/{dataset}"
    answer = behind_proxy.client.post(f"{prefix}/v1/jobs", json=spec(dataset), headers=headers)
    assert answer.headers["location"] == f"/tools/islands/v1/jobs/{answer.json()['id']}"
    assert behind_proxy.client.get(answer.headers["location"], headers=headers).status_code == 200
    assert behind_proxy.client.get("/openapi.json").json()["servers"] == [{"url": "/tools/islands"}]


def test_only_a_trusted_proxy_names_the_address_of_a_client(serve):
    """Otherwise a client would escape the rate limit of its address with a new address in each request."""
    wrong = {"Authorization": "Bearer islands_wrong"}
    for proxies, expected in (("", {401, 429}), ("192.0.2.0/24", {401, 429}), ("127.0.0.0/8, ::1", {401})):
        with serve(require_keys=True, trusted_proxies=proxies, rate=0.1, burst=20) as running:
            answers = [
                running.client.get("/v1/jobs", headers={**wrong, "X-Forwarded-For": f"203.0.113.{number}"})
                for number in range(6)
            ]
            assert {answer.status_code for answer in answers} == expected


def test_the_last_untrusted_address_is_that_of_the_client(serve):
    """A client may send X-Forwarded-For itself: the proxy appends the address that it sees."""
    with serve(require_keys=True, trusted_proxies="127.0.0.1", rate=0.1, burst=20) as running:
        answers = [
            running.client.get(
                "/v1/jobs",
                headers={"Authorization": "Bearer x", "X-Forwarded-For": f"203.0.113.{number}, 198.51.100.7"},
            )
            for number in range(6)
        ]
    assert {answer.status_code for answer in answers} == {401, 429}


@pytest.mark.parametrize("value", ["localhost", "10.0.0.1/8", "*", "10.0.0.0/33"])
def test_a_proxy_that_is_no_network_is_refused(value):
    with pytest.raises(SettingsError, match=r"ISLANDS_TRUSTED_PROXIES.*give addresses or networks"):
        service_settings(trusted_proxies=value)


@pytest.mark.parametrize("value", ["islands", "/islands/", "/", "//evil", "/a b"])
def test_a_root_path_that_is_no_path_is_refused(value):
    with pytest.raises(SettingsError, match="ISLANDS_ROOT_PATH"):
        service_settings(root_path=value)


@pytest.mark.parametrize("path", ["/", "/healthz", "/v1/jobs", "/v1/jobs/{job}", "/openapi.json", "/nothing"])
def test_head_has_the_headers_of_get_and_no_body(service, path):
    path = path.format(job=queued(service.store).id)
    got, head = service.client.get(path), service.client.head(path)
    assert head.status_code == got.status_code
    assert head.content == b""
    varying = {"x-request-id", "date"}
    assert {name: value for name, value in head.headers.items() if name not in varying} == {
        name: value for name, value in got.headers.items() if name not in varying
    }
    assert service.client.get("/healthz").status_code == 200  # the connection is still usable


@pytest.mark.parametrize("failure", [errno.EROFS, errno.EACCES, errno.ENOENT])
def test_a_service_that_cannot_write_is_not_ready(service, monkeypatch, failure):
    def refuse(*_, **__):
        raise OSError(failure, "it is read-only", "/srv/secret")

    monkeypatch.setattr("tempfile.NamedTemporaryFile", refuse)
    answer = service.client.get("/readyz")
    assert "The data folder cannot be written now" in problem_of(answer, 503, "data-folder-unavailable")
    assert "/srv" not in answer.text


def test_a_database_that_hangs_is_not_ready_within_the_deadline(service, monkeypatch):
    released = threading.Event()
    monkeypatch.setattr(routes, "_READY_SECONDS", 0.1)
    monkeypatch.setattr(service.store.readiness, "check", lambda: released.wait(20.0))
    try:
        for _ in range(3):
            answer = service.client.get("/readyz", timeout=5.0)
            assert "has not answered within" in problem_of(answer, 503, "not-ready")
            assert answer.headers["retry-after"] == "1"
        assert service.client.get("/healthz").status_code == 200
    finally:
        released.set()


def damage_pages(store, path):
    for number in range(40):
        queued(store, name=f"{number}" * 50)
    with store.database.engine.connect() as connection:
        connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")
    with path.open("r+b") as file:
        file.seek(4096)
        file.write(b"\xaa" * (path.stat().st_size - 4096))


def drop_table(store, _path):
    store.database.write(lambda connection: connection.exec_driver_sql("DROP TABLE models"))


def refuse_writes(store, _path):
    @event.listens_for(store.database.engine, "checkout")
    def _configure(connection, *_):
        connection.execute("PRAGMA query_only=ON")


@pytest.mark.ci
def test_damage_behind_the_first_pages_is_found_in_the_background(serve, monkeypatch):
    monkeypatch.setattr(app, "CHECK_SECONDS", 0.2)
    with serve() as running:
        path = running.settings.data_dir / "islands.db"
        store, ready = running.store, partial(running.client.get, "/readyz")
        for number in range(400):
            queued(store, name=f"{number}" * 50, spec={"text": "x" * 50_000})
        with store.database.engine.connect() as connection:
            connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")
        eventually(lambda: ready().status_code == 200)
        with path.open("r+b") as file:
            file.seek(path.stat().st_size - 8192)
            file.write(b"\xaa" * 4096)
        eventually(lambda: ready().status_code == 503)
        problem_of(ready(), 503, "store-unavailable")


@pytest.mark.parametrize("damage", [damage_pages, drop_table, refuse_writes])
def test_a_database_that_cannot_accept_a_job_is_not_ready(serve, damage):
    with serve() as running:
        assert running.client.get("/readyz").status_code == 200
        damage(running.store, running.settings.data_dir / "islands.db")
        answer = running.client.get("/readyz")
        problem_of(answer, 503, "store-unavailable")
        assert str(running.settings.data_dir) not in answer.text
        assert running.client.get("/healthz").status_code == 200
