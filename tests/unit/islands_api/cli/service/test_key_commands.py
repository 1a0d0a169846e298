"""``islands admin keys`` in this process, on the database of a running service."""

import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from islands_api.client import Client, ServiceError
from islands_service.store.keys import Key
from support.service import Service

Run = Callable[..., tuple[int, str, str]]

ALL = ("--scope", "read", "--scope", "write", "--scope", "metrics")


@pytest.fixture(scope="module")
def service(serve: Any) -> Iterator[Service]:
    """A service that requires keys from all clients."""
    with serve(rate=0, require_keys=True) as running:
        yield running


@pytest.fixture
def run(service: Service, monkeypatch: pytest.MonkeyPatch, command_line: Run) -> Run:
    """Run ``islands admin keys`` on the service's data folder; return code, output and error."""
    monkeypatch.setenv("ISLANDS_DATA_DIR", str(service.settings.data_dir))
    return partial(command_line, "admin", "keys")


def create_key(run: Run, *words: object) -> str:
    """Create a key and return its secret."""
    code, out, _ = run(*words)
    assert code == 0
    return out.strip()


def get_key(service: Service, secret: str) -> Key:
    key = service.store.keys.find(secret)
    assert key is not None
    return key


def is_accepted(service: Service, secret: str) -> bool:
    """Return whether the service accepts a key."""
    with Client(service.url, secret, retry=0.0) as client:
        try:
            client.jobs()
        except ServiceError as error:
            if error.status != 401:
                raise
            return False
        return True


def test_create_prints_a_valid_secret_and_describes_it_in_a_message(run: Run, service: Service) -> None:
    code, out, err = run(*ALL, "--name", "lab-3")
    secret = out.removesuffix("\n")
    key = get_key(service, secret)
    assert (code, err) == (0, f"key {key.id} of owner {key.owner}: metrics, read, write\n")
    assert secret.startswith("islands_")
    assert key.name == "lab-3"
    assert is_accepted(service, secret)


@pytest.mark.parametrize("days", [0, -1, "nan", "inf", "-inf"])
def test_invalid_days_are_rejected(run: Run, service: Service, days: object) -> None:
    before = service.store.keys.all()
    code, out, err = run(*ALL, "--days", days)
    assert (code, out) == (2, "")
    assert err.strip() == f"error: --days is a number of days above 0, got {days}"
    assert service.store.keys.all() == before


def test_options_name_the_data_folder_and_the_database(
    run: Run, tmp_path: Path, prepared_sqlite: Path
) -> None:
    (tmp_path / "new").mkdir()
    shutil.copyfile(prepared_sqlite, tmp_path / "new" / "islands.db")
    create_key(run, *ALL, "--name", "here", "--data-dir", tmp_path / "new")
    for where in (
        ("--data-dir", tmp_path / "new"),
        ("--database", f"sqlite:///{tmp_path / 'new' / 'islands.db'}"),
    ):
        out = run(*where)[1]
        assert "here" in out
        assert out.count("valid") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("--scope", "read", "--scope", "root"),
            "unknown scopes root: take some of read, write, metrics",
        ),
        (("--scope", "read,write"), "unknown scopes read,write"),
        (("--scope", ""), "unknown scopes"),
        (("--revoke", "nothing"), "there is no key 'nothing': list them with 'islands admin keys'"),
        (("--data-dir", "/dev/null"), "/dev/null"),
    ],
)
def test_error_is_one_line(run: Run, service: Service, arguments: tuple[str, ...], message: str) -> None:
    before = service.store.keys.all()
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert message in err
    assert len(err.splitlines()) == 1
    assert service.store.keys.all() == before


@pytest.mark.parametrize(("option", "most"), [("--name", 200), ("--owner", 64)])
def test_too_long_name_or_owner_is_rejected(run: Run, option: str, most: int) -> None:
    create_key(run, *ALL, option, "ü" * most)
    code, out, err = run(*ALL, option, "ü" * (most + 1))
    assert (code, out) == (2, "")
    message = (
        f"the {option[2:]} of a key has at most {most} characters, this one has {most + 1}: take a shorter"
    )
    assert message in err
