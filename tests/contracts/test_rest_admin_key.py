"""Key of the operator: in a file, with the scope admin, so that the first keys need no shell."""

import pytest

from islands.errors import SettingsError
from islands_api.__main__ import check_safe, install_admin_key
from islands_service.store.keys import ADMIN_KEY
from support.processes import eventually
from support.service import problem_of


@pytest.fixture(scope="module")
def shared(serve):
    with serve(require_keys=True, rate=0.0) as running:
        yield running


@pytest.fixture
def start(service, tmp_path):
    """Return a function that starts the API with a key in the operator's file, or without a file."""
    path = tmp_path / "admin-key"

    def start(secret):
        if secret is not None:
            path.write_text(f"{secret}\n")
        file = None if secret is None else path
        install_admin_key(service.settings.model_copy(update={"admin_key_file": file}), service.store)
        check_safe(service.settings, service.store)

    return start


def ask(service, secret):
    """Return the status of a request with a key."""
    return service.client.get("/v1/admin/keys", headers={"Authorization": f"Bearer {secret}"}).status_code


def test_first_key_is_created_with_the_key_of_the_operator(service, start):
    secret = "first" * 8
    # No other machine reaches 127.0.0.1, so that the advice is not to serve there.
    with pytest.raises(
        SettingsError, match=r"^every .* ISLANDS_ADMIN_KEY_FILE, or serve without --require-k"
    ):
        start(None)
    start(secret)
    header = {"Authorization": f"Bearer {secret}"}
    made = service.client.post("/v1/admin/keys", json={"scopes": ["read"]}, headers=header)
    assert made.status_code == 201
    problem_of(service.client.get("/v1/jobs", headers=header), 403, "scope-missing")
    before = service.store.keys.all()
    start(secret)
    assert service.store.keys.all() == before
    for path in service.settings.data_dir.rglob("*"):
        assert path.is_dir() or secret.encode() not in path.read_bytes()


@pytest.mark.ci
def test_key_of_the_operator_is_replaced_and_revoked_with_its_file(service, start):
    service.key()
    start("first" * 8)
    assert ask(service, "first" * 8) == 200
    start("second" * 8)
    assert ask(service, "second" * 8) == 200
    eventually(lambda: ask(service, "first" * 8) == 401)
    start(None)
    eventually(lambda: ask(service, "second" * 8) == 401)
    changes = [entry.action for entry in service.store.audit.entries(ADMIN_KEY)]
    assert changes == ["revoke-key", "create-key", "create-key"]


def test_revoked_key_of_the_operator_is_valid_again_only_if_it_is_replaced(service, start):
    service.key()
    start("third" * 8)
    service.store.keys.revoke(ADMIN_KEY)
    start("third" * 8)
    assert ask(service, "third" * 8) == 401
    start("fourth" * 8)
    assert ask(service, "fourth" * 8) == 200


@pytest.mark.parametrize("secret", ["", "x" * 31, "two words " * 8, "ü" * 40])
def test_key_of_the_operator_that_could_be_guessed_or_sent_wrongly_is_refused(service, start, secret):
    with pytest.raises(SettingsError, match="at least 32 printable characters"):
        start(secret)
    assert service.store.keys.all() == ()


def test_key_of_the_operator_is_no_other_key(service, start):
    secret = service.key()["Authorization"].removeprefix("Bearer ")
    with pytest.raises(SettingsError, match="choose another one"):
        start(secret)
