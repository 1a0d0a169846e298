"""``islands keys`` from inside, on the database of a service that runs: made, used, listed, revoked."""

import shutil
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from islands_api.client import Client, ServiceError
from islands_service.store.keys import SCOPES, Key
from support.processes import eventually
from support.service import Service

Run = Callable[..., tuple[int, str, str]]

ALL = ("--scope", "read", "--scope", "write", "--scope", "metrics")


@pytest.fixture(scope="module")
def service(serve: Any) -> Iterator[Service]:
    """A service that asks everybody for a key."""
    with serve(rate=0, require_keys=True) as running:
        yield running


@pytest.fixture
def run(service: Service, monkeypatch: pytest.MonkeyPatch, command_line: Run) -> Run:
    """Run ``islands keys`` on the service's data folder; return exit code, standard output and error."""
    monkeypatch.setenv("ISLANDS_DATA_DIR", str(service.settings.data_dir))
    return partial(command_line, "keys")


def made(run: Run, *words: object) -> str:
    """Make a key, and return its secret."""
    code, out, err = run("create", *words)
    assert (code, err) == (0, "")
    return out.splitlines()[0]


def key_of(service: Service, secret: str) -> Key:
    key = service.store.keys.find(secret)
    assert key is not None
    return key


def opens(service: Service, secret: str) -> bool:
    """Tell whether a key opens the list of jobs."""
    with Client(service.url, secret, retry=0.0) as client:
        try:
            client.jobs()
        except ServiceError as error:
            if error.status != 401:
                raise
            return False
        return True


def test_a_key_s_secret_is_the_first_line_and_opens_the_service(run: Run, service: Service) -> None:
    code, out, err = run("create", *ALL, "--name", "lab-3")
    secret, about = out.splitlines()
    key = key_of(service, secret)
    assert (code, err, about) == (0, "", f"key {key.id} of owner {key.owner}: metrics, read, write")
    assert secret.startswith("islands_")
    assert key.name == "lab-3"
    assert opens(service, secret)


def test_a_secret_is_shown_once_and_kept_nowhere(run: Run, service: Service) -> None:
    secret = made(run, *ALL)
    assert secret not in run("list")[1]
    assert run("create", *ALL)[1].count("islands_") == 1
    for path in service.settings.data_dir.rglob("*"):
        assert not path.is_file() or secret.encode() not in path.read_bytes(), path


@pytest.mark.parametrize("scope", SCOPES)
def test_a_key_allows_what_its_scopes_say_and_no_more(run: Run, service: Service, scope: str) -> None:
    headers = {"Authorization": f"Bearer {made(run, '--scope', scope)}"}
    asked = {
        "read": service.client.get("/v1/jobs", headers=headers),
        "write": service.client.post("/v1/jobs/0/cancel", headers=headers),
        "metrics": service.client.get("/metrics", headers=headers),
    }
    assert {name for name, answer in asked.items() if answer.status_code != 403} == {scope}
    assert asked[scope].status_code == (404 if scope == "write" else 200)


def test_keys_of_one_owner_share_what_is_its_own(run: Run, service: Service) -> None:
    one, other = (key_of(service, made(run, *ALL, "--owner", "lab")) for _ in range(2))
    assert one.owner == other.owner == "lab"
    alone = [key_of(service, made(run, *ALL)).owner for _ in range(2)]
    assert len({"lab", *alone}) == 3


def test_a_key_expires_when_its_days_are_over(run: Run, service: Service) -> None:
    day, moment = made(run, *ALL, "--days", 1), made(run, *ALL, "--days", 1e-6)
    key = key_of(service, day)
    assert key.expires == pytest.approx(time.time() + 86_400.0, abs=60.0)
    assert opens(service, day)
    eventually(lambda: key_of(service, moment).expired)
    assert not opens(service, moment)
    assert f"│ {key_of(service, moment).id} │" in run("list")[1]
    assert "expired" in line_of(run, key_of(service, moment).id)
    assert key_of(service, made(run, *ALL)).expires is None


@pytest.mark.parametrize("days", [0, -1, "nan", "inf", "-inf"])
def test_days_that_are_none_are_refused(run: Run, service: Service, days: object) -> None:
    before = service.store.keys.all()
    code, out, err = run("create", *ALL, "--days", days)
    assert (code, out) == (2, "")
    assert err.strip() == f"error: --days is a number of days above 0, got {days}"
    assert service.store.keys.all() == before


@pytest.mark.ci
def test_a_revoked_key_opens_nothing_after_a_second(run: Run, service: Service) -> None:
    secret = made(run, *ALL)
    key = key_of(service, secret).id
    assert opens(service, secret)
    assert "valid" in line_of(run, key)
    assert run("revoke", key) == (0, f"key {key} is revoked\n", "")
    began = time.monotonic()
    eventually(lambda: not opens(service, secret))
    assert time.monotonic() - began < 25.0
    assert "revoked" in line_of(run, key)
    at = key_of(service, secret).revoked
    assert run("revoke", key)[0] == 0
    assert key_of(service, secret).revoked == at


def test_the_list_cuts_nothing_off_however_long_the_names(run: Run, service: Service) -> None:
    key = key_of(service, made(run, *ALL, "--name", "[/red] " + "long " * 30, "--owner", "Q" * 60))
    out = run("list")[1]
    assert f"│ {key.id} │" in out
    assert "[/red]" in out
    assert out.count("Q") == 60
    assert max(map(len, out.splitlines())) <= 80


def test_a_data_folder_and_a_database_may_be_named(run: Run, tmp_path: Path, prepared_sqlite: Path) -> None:
    (tmp_path / "new").mkdir()
    shutil.copyfile(prepared_sqlite, tmp_path / "new" / "islands.db")
    made(run, *ALL, "--name", "here", "--data-dir", tmp_path / "new")
    for where in (
        ("--data-dir", tmp_path / "new"),
        ("--database", f"sqlite:///{tmp_path / 'new' / 'islands.db'}"),
    ):
        out = run("list", *where)[1]
        assert "here" in out
        assert out.count("valid") == 1


@pytest.mark.parametrize(
    ("arguments", "told"),
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
def test_a_refusal_is_one_line(run: Run, service: Service, arguments: tuple[str, ...], told: str) -> None:
    before = service.store.keys.all()
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert told in err
    assert len(err.splitlines()) == 1
    assert service.store.keys.all() == before


def test_a_key_without_a_scope_is_not_made(run: Run, service: Service) -> None:
    before = service.store.keys.all()
    code, _, err = run("create")
    assert code == 2
    assert "--scope" in err
    assert service.store.keys.all() == before


def line_of(run: Run, key: str) -> str:
    """The line of a key in the list."""
    return next(line for line in run("list")[1].splitlines() if key in line)


@pytest.mark.parametrize(("option", "most"), [("--name", 200), ("--owner", 64)])
def test_a_name_or_an_owner_that_no_database_holds_is_refused(run: Run, option: str, most: int) -> None:
    made(run, *ALL, option, "ü" * most)
    code, out, err = run("create", *ALL, option, "ü" * (most + 1))
    assert (code, out) == (2, "")
    told = f"the {option[2:]} of a key has at most {most} characters, this one has {most + 1}: take a shorter"
    assert told in err
