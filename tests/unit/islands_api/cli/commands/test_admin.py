"""``islands admin`` in this process, on the database of a service."""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from sqlalchemy import update

from islands_service.domain.job import JobState, Requester
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.tables import audit
from support.stores import claimed, submitted

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def folder(prepared_sqlite: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "islands.db").write_bytes(prepared_sqlite.read_bytes())
    monkeypatch.setenv("ISLANDS_DATA_DIR", str(tmp_path))
    return tmp_path


@pytest.fixture
def run(folder: Path, command_line: Run) -> Run:
    return partial(command_line, "admin", "audit")


@pytest.fixture
def subjects(folder: Path) -> list[str]:
    """Make three changes, a day apart; return their subjects, the newest first."""
    with Store(ServiceSettings(data_dir=folder).url) as store:
        job = submitted(store, "alice").id
        store.jobs.cancel("alice", job, Requester("192.0.2.7", "0123456789abcdef"))
        key, _ = store.keys.create("lab", frozenset({"read"}), "bob", by=Requester("command line"))
        store.jobs.delete("alice", job, Requester("2001:db8::1"))
        moment = 86_400.0 * (20_000 + audit.c.number)
        store.database.write(lambda connection: connection.execute(update(audit).values(at=moment)))
    return [job, key.id, job]


def read(run: Run, *words: str) -> list[dict[str, object]]:
    code, out, err = run("--json", *words)
    assert (code, err) == (0, "")
    return [json.loads(line) for line in out.splitlines()]


def test_audit_lists_changes_newest_first(run: Run, subjects: list[str]) -> None:
    found = read(run)
    assert [entry["subject"] for entry in found] == subjects
    assert found[2] == {
        "at": "2024-10-05T00:00:00Z",
        "action": "cancel-job",
        "owner": "alice",
        "subject": subjects[2],
        "key_id": "0123456789abcdef",
        "address": "192.0.2.7",
        "details": None,
    }
    code, out, _ = run()
    assert code == 0
    assert out.index("bob") < out.index("192.0.2.7")


def test_owners_are_listed_and_changed(run: Run, subjects: list[str], command_line: Run) -> None:
    owners = partial(command_line, "admin", "owners")
    assert owners("bob", "--set", "weight=200", "--set", "max_running=2", "--set", "max-islands=8") == (
        0,
        "owner bob: weight 200, max_running 2, max_islands 8\n",
        "",
    )
    code, out, _ = owners("--json")
    listed = {each["name"]: each for each in map(json.loads, out.splitlines())}
    assert (code, set(listed)) == (0, {"bob"})
    assert (listed["bob"]["weight"], listed["bob"]["quotas"]["max_running"]) == (200, 2)
    assert "200" in owners()[1]
    assert owners("bob", "--unset", "max-running", "--unset", "max_islands", "--unset", "weight")[1] == (
        "owner bob: weight 100, default quotas\n"
    )
    restored, changed = read(run, "--limit", "2")
    assert (changed["action"], changed["owner"], changed["address"]) == (
        "change-owner",
        "bob",
        "command line",
    )
    assert json.loads(str(changed["details"])) == {"weight": 200, "max_running": 2, "max_islands": 8}
    assert json.loads(str(restored["details"])) == {"weight": 100, "max_running": None, "max_islands": None}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("unknown", "--set", "weight=2"), "there is no owner 'unknown'"),
        (("bob", "--set", "weight=0"), "weight is an integer from 1 to 10000, got 0"),
        (("bob", "--set", "max_stored=-1"), "max_stored is an integer of at least 0, got -1"),
        (("bob", "--set", "weight=much"), "weight is an integer, got 'much'"),
        (("bob", "--unset", "size"), "size is no quota: take one of max_active"),
    ],
)
def test_invalid_change_of_an_owner_is_refused(
    run: Run, subjects: list[str], command_line: Run, words: tuple[object, ...], message: str
) -> None:
    before = read(run)
    code, out, err = command_line("admin", "owners", *words)
    assert (code, out) == (2, "")
    assert message in " ".join(err.split())
    assert read(run) == before


@pytest.mark.parametrize(
    "command",
    [
        ("admin", "keys", "--database={}"),
        ("admin", "audit", "--database={}"),
        ("serve", "--database={}"),
        ("serve", "--set", "database={}"),
    ],
)
@pytest.mark.parametrize(
    "url", ["postgresql+psycopg://me:hidden@h/db", "postgresql+psycopg://h/db?password=hidden"]
)
def test_password_on_the_command_line_is_refused(
    command_line: Run, command: tuple[str, ...], url: str, folder: Path
) -> None:
    """The arguments of a process are visible to every user of the machine."""
    code, out, err = command_line(*(word.format(url) for word in command))
    assert code == 2
    assert "ISLANDS_DATABASE_FILE" in err
    assert "hidden" not in out + err


def test_password_in_the_options_file_is_accepted(run: Run, command_line: Run, tmp_path: Path) -> None:
    options = tmp_path / "options.toml"
    options.write_text('[admin.keys]\ndatabase = "postgresql+psycopg://me:hidden@127.0.0.1:9/islands"\n')
    code, _, err = command_line("--config", options, "admin", "keys")
    assert (code, "127.0.0.1" in err) == (2, True), err
    assert "every user of this machine" not in err


def test_operator_lists_and_cancels_jobs_of_all_owners(folder: Path, command_line: Run) -> None:
    admin = partial(command_line, "admin", "jobs")
    with Store(ServiceSettings(data_dir=folder).url) as store:
        first = submitted(store, "alice")
        store.leases.renew(claimed(store), 60.0, ran=71.4)
        second = submitted(store, "[bob]")
        code, out, err = admin()
        assert (code, err) == (0, "")
        rows = [line.split() for line in out.splitlines() if first.id in line or second.id in line]
        assert [row[1:-1:2] for row in rows] == [
            [second.id, "[bob]", "queued", "0"],
            [first.id, "alice", "running", "71"],
        ]
        assert second.id not in admin("--owner", "alice")[1]
        assert first.id not in admin("--state", "queued")[1]
        assert admin("--state", "asleep")[:2] == (2, "")
        assert admin("--cancel", first.id)[1] == f"job {first.id} of owner alice is being cancelled\n"
        assert admin("--cancel", second.id)[1] == f"job {second.id} of owner [bob] is cancelled\n"
        code, _, err = admin("--cancel", second.id)
        assert code == 2
        assert "there is nothing to cancel" in err
        assert store.jobs.get("[bob]", second.id).state == JobState.CANCELLED
    actions = [
        (entry["action"], entry["owner"]) for entry in read(partial(command_line, "admin", "audit"))[:2]
    ]
    assert actions == [("cancel-job-as-administrator", "[bob]"), ("cancel-job-as-administrator", "alice")]
