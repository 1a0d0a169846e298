"""API keys and certificates: keys are sent but never shown, and certificates are verified."""

import shutil
import ssl
import traceback
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import trustme

from islands.errors import SettingsError
from islands_api.client import ServiceError, ServiceUnreachableError
from islands_api.web.app import create_app
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from support.service import Service, listening

#: Unknown API key that must not appear in any output.
SECRET = "islands_this-is-an-unknown-key-and-secret-all-the-same"


@pytest.fixture(scope="module")
def guarded(serve: Any) -> Iterator[Service]:
    """A service that requires keys from all clients."""
    with serve(rate=0, require_keys=True) as running:
        yield running


@pytest.fixture(scope="module")
def authority() -> trustme.CA:
    return trustme.CA()


@pytest.fixture(scope="module")
def secure(
    tmp_path_factory: pytest.TempPathFactory, prepared_sqlite: Path, authority: trustme.CA
) -> Iterator[int]:
    """Port of a service with TLS and a certificate of a private authority for 127.0.0.1."""
    folder = tmp_path_factory.mktemp("secure")
    issued = authority.issue_cert("127.0.0.1")
    issued.private_key_pem.write_to_path(folder / "key.pem")
    for each in issued.cert_chain_pems:
        each.write_to_path(folder / "cert.pem", append=True)
    certificate = {"tls_certificate": folder / "cert.pem", "tls_key": folder / "key.pem"}
    settings = ServiceSettings(data_dir=Path(shutil.copyfile(prepared_sqlite, folder / "islands.db")).parent)
    settings = settings.model_copy(update=certificate)
    with listening(create_app(settings, Store(settings.url)), settings) as url:
        yield int(url.rpartition(":")[2])


def format_error(error: BaseException) -> str:
    """Return all texts that a program could print about an error."""
    return "".join(traceback.format_exception(error)) + repr(error) + repr(vars(error))


# Keys.


@pytest.mark.parametrize(
    ("key", "message"), [(None, "this service needs a key"), (SECRET, "the key is unknown")]
)
def test_missing_or_unknown_key_is_rejected(
    connect: Any, guarded: Service, key: str | None, message: str
) -> None:
    with pytest.raises(ServiceError, match=message) as caught:
        connect(guarded.url, key).jobs()
    assert (caught.value.status, caught.value.type) == (401, "/problems/no-key")
    with pytest.raises(ServiceError, match=message):
        list(connect(guarded.url, key).events("0"))


@pytest.mark.parametrize(
    "key", ["", "  ", f"{SECRET}\nX-Other: 1", f"{SECRET} {SECRET}", f"{SECRET}ü", f"\0{SECRET}"]
)
def test_malformed_key_is_rejected_without_showing_the_key(connect: Any, key: str) -> None:
    with pytest.raises(SettingsError, match="give it as 'islands admin keys' printed it") as caught:
        connect("http://127.0.0.1:9", key)
    assert SECRET not in format_error(caught.value)


def test_key_is_sent_and_never_shown(connect: Any, guarded: Service, scripted: Any) -> None:
    server = scripted((500, {}, b"oh"))
    clients = [
        connect(guarded.url, SECRET),
        connect(server.url, SECRET),
        connect("http://127.0.0.1:9", SECRET, retry=0.0),
        connect(scripted((200, {}, b"<html>")).url, SECRET),
    ]
    for client in clients:
        for call in (client.jobs, partial(client.wait, "0")):
            with pytest.raises((ServiceError, ServiceUnreachableError)) as caught:
                call()
            assert SECRET not in format_error(caught.value)
        assert SECRET not in repr(client) + str(client) + repr(vars(getattr(client, "client", client)))
    assert {headers["Authorization"] for *_, headers in server.requests} == {f"Bearer {SECRET}"}
    assert all(headers["User-Agent"].startswith("islands/") for *_, headers in server.requests)
    assert SECRET not in str(guarded.logs)


# Certificates.


def test_private_authority_is_trusted_if_its_file_is_given(
    connect: Any, secure: int, authority: trustme.CA, tmp_path: Path
) -> None:
    path = tmp_path / "authority.pem"
    authority.cert_pem.write_to_path(path)
    context = ssl.create_default_context(cafile=path)
    for verify in (str(path), path, context, False):
        assert connect(f"https://127.0.0.1:{secure}", verify=verify).jobs().items == ()


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_invalid_certificate_is_rejected_immediately(
    connect: Any, secure: int, authority: trustme.CA, tmp_path: Path, name: str
) -> None:
    # A certificate of an unknown authority, and one of a known authority for another name.
    path = tmp_path / "authority.pem"
    (authority if name == "localhost" else trustme.CA()).cert_pem.write_to_path(path)
    client = connect(f"https://{name}:{secure}", SECRET, verify=str(path), retry=60.0)
    for call in (client.jobs, lambda: list(client.events("0"))):
        with pytest.raises(
            ServiceUnreachableError, match=r"the certificate of the service at .* is not trusted"
        ) as caught:
            call()
        assert "SSL_CERT_FILE" in str(caught.value)
        assert SECRET not in format_error(caught.value)


def test_missing_authority_file_raises_an_error(connect: Any, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        connect("https://127.0.0.1:9", verify=str(tmp_path / "none.pem"))
