"""``islands keys`` in this process, on the database of a running service."""

import shutil
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from islands_api.client import Client, ServiceError
from islands_service.store.tenants.keys import SCOPES, Key
from support.processes import eventually
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
    """Run ``islands keys`` on the service's data folder; return exit code, standard output and error."""
    monkeypatch.setenv("ISLANDS_DATA_DIR", str(service.settings.data_dir))
    return partial(command_line, "keys")


def create_key(run: Run, *words: object) -> str:
    """Create a key and return its secret."""
    code, out, _ = run("create", *words)
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
    code, out, err = run("create", *ALL, "--name", "lab-3")
    secret = out.removesuffix("\n")
    key = get_key(service, secret)
    assert (code, err) == (0, f"key {key.id} of owner {key.owner}: metrics, read, write\n")
    assert secret.startswith("islands_")
    assert key.name == "lab-3"
    assert is_accepted(service, secret)


def test_secret_is_shown_once_and_not_stored(run: Run, service: Service) -> None:
    secret = create_key(run, *ALL)
    assert secret not in run("list")[1]
    assert run("create", *ALL)[1].count("islands_") == 1
    for path in service.settings.data_dir.rglob("*"):
        assert not path.is_file() or secret.encode() not in path.read_bytes(), path


@pytest.mark.parametrize("scope", SCOPES)
def test_scopes_of_a_key_limit_its_permissions(run: Run, service: Service, scope: str) -> None:
    headers = {"Authorization": f"Bearer {create_key(run, '--scope', scope)}"}
    answers = {
        "read": service.client.get("/v1/jobs", headers=headers),
        "write": service.client.post("/v1/jobs/0/cancel", headers=headers),
        "metrics": service.client.get("/metrics", headers=headers),
        "admin": service.client.get("/v1/admin/keys", headers=headers),
    }
    assert {name for name, answer in answers.items() if answer.status_code != 403} == {scope}
    assert answers[scope].status_code == (404 if scope == "write" else 200)


def test_keys_have_separate_owners_by_default(run: Run, service: Service) -> None:
    one, other = (get_key(service, create_key(run, *ALL, "--owner", "lab")) for _ in range(2))
    assert one.owner == other.owner == "lab"
    alone = [get_key(service, create_key(run, *ALL)).owner for _ in range(2)]
    assert len({"lab", *alone}) == 3


def test_key_expires_after_its_days(run: Run, service: Service) -> None:
    day, moment = create_key(run, *ALL, "--days", 1), create_key(run, *ALL, "--days", 1e-6)
    key = get_key(service, day)
    assert key.expires == pytest.approx(time.time() + 86_400.0, abs=60.0)
    assert is_accepted(service, day)
    eventually(lambda: get_key(service, moment).expired)
    assert not is_accepted(service, moment)
    assert f"│ {get_key(service, moment).id} │" in run("list")[1]
    assert "expired" in get_line(run, get_key(service, moment).id)
    assert get_key(service, create_key(run, *ALL)).expires is None


@pytest.mark.parametrize("days", [0, -1, "nan", "inf", "-inf"])
def test_invalid_days_are_rejected(run: Run, service: Service, days: object) -> None:
    before = service.store.keys.all()
    code, out, err = run("create", *ALL, "--days", days)
    assert (code, out) == (2, "")
    assert err.strip() == f"error: --days is a number of days above 0, got {days}"
    assert service.store.keys.all() == before


@pytest.mark.ci
def test_revoked_key_is_rejected_soon(run: Run, service: Service) -> None:
    secret = create_key(run, *ALL)
    key = get_key(service, secret).id
    assert is_accepted(service, secret)
    assert "valid" in get_line(run, key)
    assert run("revoke", key) == (0, f"key {key} is revoked\n", "")
    began = time.monotonic()
    eventually(lambda: not is_accepted(service, secret))
    assert time.monotonic() - began < 25.0
    assert "revoked" in get_line(run, key)
    at = get_key(service, secret).revoked
    assert run("revoke", key)[0] == 0
    assert get_key(service, secret).revoked == at


def test_list_wraps_long_names_without_truncation(run: Run, service: Service) -> None:
    key = get_key(service, create_key(run, *ALL, "--name", "[/red] " + "long " * 30, "--owner", "Q" * 60))
    out = run("list")[1]
    assert f"│ {key.id} │" in out
    assert "[/red]" in out
    assert out.count("Q") == 60
    assert max(map(len, out.splitlines())) <= 80


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
        out = run("list", *where)[1]
        assert "here" in out
        assert out.count("valid") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("create", "--scope", "read", "--scope", "root"),
            "unknown scopes root: take some of read, write, metrics",
        ),
        (("create", "--scope", "read,write"), "unknown scopes read,write"),
        (("create", "--scope", ""), "unknown scopes"),
        (("revoke", "nothing"), "there is no key 'nothing': list them with 'islands keys list'"),
        (("list", "--data-dir", "/dev/null"), "/dev/null"),
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


def test_key_without_a_scope_is_rejected(run: Run, service: Service) -> None:
    before = service.store.keys.all()
    code, _, err = run("create")
    assert code == 2
    assert "--scope" in err
    assert service.store.keys.all() == before


def get_line(run: Run, key: str) -> str:
    """Return the line of a key in the list."""
    return next(line for line in run("list")[1].splitlines() if key in line)


@pytest.mark.parametrize(("option", "most"), [("--name", 200), ("--owner", 64)])
def test_too_long_name_or_owner_is_rejected(run: Run, option: str, most: int) -> None:
    create_key(run, *ALL, option, "ü" * most)
    code, out, err = run("create", *ALL, option, "ü" * (most + 1))
    assert (code, out) == (2, "")
    message = (
        f"the {option[2:]} of a key has at most {most} characters, this one has {most + 1}: take a shorter"
    )
    assert message in err
