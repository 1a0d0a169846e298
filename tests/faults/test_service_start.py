"""Start of a service: each refusal says what to do and exits with status 2. And TLS."""

import resource
import socket
import ssl
from pathlib import Path

import pytest
import trustme

from islands_service.liveness import MISCONFIGURED
from support.command_line import islands, succeed
from support.processes import eventually, kill
from support.service_processes import free_port, serving, started

pytestmark = pytest.mark.nightly

#: Settings without coordinators, since these tests need no Ray.
API_ONLY = {"ISLANDS_COORDINATORS": "0"}


def refused(*options: object, **environment: str) -> str:
    status, said = ended(*options, **environment)
    assert status == MISCONFIGURED, said
    assert "Traceback" not in said
    assert "started again" not in said
    return said


def ended(*options: object, **environment: str) -> tuple[int, str]:
    """Return the exit status and the output of a service that ends by itself."""
    process = started(*options, **{**API_ONLY, **environment})
    try:
        _, said = process.communicate(timeout=180)
    finally:
        process.kill()
    return process.returncode, " ".join(said.split())


def test_second_service_on_the_same_folder_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    with serving(folder, environment=API_ONLY) as service:
        said = refused("--data-dir", folder, "--port", free_port())
        assert f"{folder} belongs to another 'islands serve' (process {service.process.pid})" in said
        assert "give another --data-dir" in said
        service.ready()


@pytest.mark.parametrize("coordinators", ["0", "1"])
def test_a_file_that_is_no_database_is_refused(tmp_path: Path, coordinators: str) -> None:
    (tmp_path / "islands.db").write_bytes(b"not a database" * 1000)
    said = refused("--data-dir", tmp_path, "--port", free_port(), ISLANDS_COORDINATORS=coordinators)
    assert "the database cannot be used (file is not a database): restore a backup" in said


def test_service_waits_for_a_database_that_does_not_answer_yet(tmp_path: Path) -> None:
    """The database of a machine may start after the service."""
    url = f"postgresql+psycopg://islands@127.0.0.1:{free_port()}/islands"
    process = started("--data-dir", tmp_path, "--port", free_port(), "--database", url, **API_ONLY)
    with process:
        try:
            assert process.stderr is not None
            again = (line for line in process.stderr if "it is started again" in line)
            assert {next(again) for _ in range(7)} == {"islands serve: api ended (75): it is started again\n"}
            process.terminate()
            assert process.wait(30) == 0
        finally:
            process.kill()


def test_key_in_a_file_is_enough_for_the_first_start(tmp_path: Path) -> None:
    secret = tmp_path / "admin-key"
    secret.write_text("0123456789abcdef" * 4)
    environment = {**API_ONLY, "ISLANDS_ADMIN_KEY_FILE": str(secret)}
    with serving(tmp_path / "data", "--host", "0.0.0.0", environment=environment) as service:
        header = {"Authorization": f"Bearer {secret.read_text()}"}
        made = service.client.post("/v1/admin/keys", json={"scopes": ["read"]}, headers=header).json()
        answer = service.client.get("/v1/jobs", headers={"Authorization": f"Bearer {made['secret']}"})
        assert answer.status_code == 200
        missing = refused("--data-dir", tmp_path / "other", ISLANDS_ADMIN_KEY_FILE=str(tmp_path / "none"))
    assert "cannot read the file of ISLANDS_ADMIN_KEY_FILE" in missing


def test_api_without_a_valid_key_starts_when_a_key_is_created(tmp_path: Path) -> None:
    """No other role ends, so that jobs continue to run."""
    folder = tmp_path / "data"
    _, key, *_ = islands("admin", "keys", "--scope", "read", "--data-dir", folder).stderr.split()
    with serving(folder, "--host", "0.0.0.0", environment=API_ONLY) as service:
        succeed("admin", "keys", "--revoke", key, "--data-dir", folder)
        kill(service.one("api"))
        eventually(lambda: "api ended (2): it is started again" in service.log.read_text())
        assert "there is no key: create one" in " ".join(service.log.read_text().split())
        succeed("admin", "keys", "--scope", "read", "--data-dir", folder)
        service.ready()


def test_api_may_open_as_many_files_as_the_machine_allows(tmp_path: Path) -> None:
    """Every connection is a file: a thousand idle ones would otherwise block the API."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(soft, 256), hard))
    try:
        with serving(tmp_path / "data", environment=API_ONLY) as service:
            theirs = resource.prlimit(service.one("api"), resource.RLIMIT_NOFILE)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    assert theirs == (min(hard, 65_536), hard)


@pytest.fixture
def certificate(tmp_path: Path) -> tuple[Path, Path, ssl.SSLContext]:
    """A certificate, its key, and a client context that trusts it."""
    authority, trusting = trustme.CA(), ssl.create_default_context()
    authority.configure_trust(trusting)
    issued = authority.issue_cert("127.0.0.1")
    certificate, key = tmp_path / "certificate.pem", tmp_path / "key.pem"
    certificate.write_bytes(b"".join(pem.bytes() for pem in issued.cert_chain_pems))
    issued.private_key_pem.write_to_path(key)
    return certificate, key, trusting


def test_service_with_a_certificate_uses_tls_only(
    tmp_path: Path, certificate: tuple[Path, Path, ssl.SSLContext]
) -> None:
    files = ("--tls-certificate", certificate[0], "--tls-key", certificate[1])
    with serving(tmp_path / "data", *files, tls=certificate[2], environment=API_ONLY) as service:
        answer = service.client.get("/healthz")
        assert answer.json() == {"status": "alive"}
        assert answer.headers["strict-transport-security"] == "max-age=31536000"
        job = service.submit(5)
        assert service.job(job)["state"] == "queued"
        port = service.client.base_url.port
        with socket.create_connection(("127.0.0.1", port)) as plain:
            plain.sendall(b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            assert b"alive" not in plain.recv(1000)
    assert "https://127.0.0.1" in service.log.read_text()


def test_event_stream_ends_cleanly_when_the_service_stops(tmp_path: Path) -> None:
    with serving(tmp_path / "data", environment={"ISLANDS_COORDINATORS": "0"}) as service:
        job = service.submit(5)
        with service.client.stream("GET", f"/v1/jobs/{job}/events") as answer:
            lines = answer.iter_lines()
            assert next(lines) == "id: 1"
            service.process.terminate()
            # A truncated response would raise an error here.
            assert not [line for line in lines if line.startswith("id: ")]
        assert service.process.wait(30) == 0
