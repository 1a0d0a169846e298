"""Keys and owners over REST: administration with the scope admin, and quotas of single owners."""

from contextlib import ExitStack

import pytest

from islands_api.admin_schemas import CreatedKey, KeyPage, KeyView
from support.processes import eventually
from support.service import problem_of, queued


@pytest.fixture(scope="module")
def shared(serve):
    with serve(require_keys=True, rate=0.0, max_active=3, max_running_islands=5) as running:
        yield running


@pytest.fixture
def admin(service):
    return service.key("admin", owner="operator")


@pytest.fixture
def mine(service):
    return service.key(owner="me")


@pytest.fixture
def change(service, admin, mine):
    """Return a function that changes the owner ``me``."""

    def change(owner="me", /, **changes):
        return service.client.patch(f"/v1/admin/owners/{owner}", json=changes, headers=admin)

    return change


def test_created_key_is_accepted_until_it_is_revoked(service, admin):
    wanted = {"name": "lab-3", "owner": "lab", "scopes": ["write", "read"], "days": 2}
    answer = service.client.post("/v1/admin/keys", json=wanted, headers=admin)
    assert (answer.status_code, answer.headers["cache-control"]) == (201, "no-store")
    key = CreatedKey.model_validate(answer.json())
    assert (key.name, key.owner, key.scopes, key.valid) == ("lab-3", "lab", ("read", "write"), True)
    assert (key.expires - key.created).total_seconds() == pytest.approx(2 * 86_400.0, abs=0.1)
    header = {"Authorization": f"Bearer {key.secret}"}
    assert service.client.get("/v1/jobs", headers=header).status_code == 200
    listed = service.client.get("/v1/admin/keys", headers=admin)
    assert key.id in {each.id for each in KeyPage.model_validate(listed.json()).items}
    assert key.secret not in listed.text
    revoked = service.client.post(f"/v1/admin/keys/{key.id}/revoke", headers=admin)
    assert revoked.status_code == 200
    assert KeyView.model_validate(revoked.json()).revoked >= key.created
    eventually(lambda: service.client.get("/v1/jobs", headers=header).status_code == 401)


@pytest.mark.parametrize(
    ("body", "kind"),
    [
        ({}, "invalid-request"),
        ({"scopes": []}, "invalid-request"),
        ({"scopes": ["root"]}, "invalid-settings"),
        ({"scopes": ["read"], "owner": "a/b"}, "invalid-request"),
        ({"scopes": ["read"], "owner": "x" * 65}, "invalid-request"),
        ({"scopes": ["read"], "days": 0}, "invalid-request"),
        ({"scopes": ["read"], "secret": "x" * 32}, "invalid-request"),
    ],
)
def test_invalid_key_is_refused(service, admin, body, kind):
    before = service.store.keys.all()
    problem_of(service.client.post("/v1/admin/keys", json=body, headers=admin), 422, kind)
    assert service.store.keys.all() == before


@pytest.mark.parametrize(
    "wrong", [{"weight": 0}, {"weight": 10_001}, {"max_active": -1}, {"max_jobs": 1}, {"max_stored": "many"}]
)
def test_invalid_change_is_refused(service, change, wrong):
    problem_of(change(**wrong), 422, "invalid-request")
    assert service.store.owners.get("me").weight == 100


def test_event_streams_of_an_owner_are_limited_until_they_end(service, mine, change):
    path = f"/v1/jobs/{queued(service.store, 'me').id}/events"
    change(max_streams=2)
    with ExitStack() as stack:
        for _ in range(2):
            stack.enter_context(service.client.stream("GET", path, headers=mine))
        answer = service.client.get(path, headers=mine)
        assert "2 event streams of this owner" in problem_of(answer, 429, "quota-exceeded")

    def is_open():
        with service.client.stream("GET", path, headers=mine) as answer:
            return answer.status_code == 200

    eventually(is_open)


def test_an_administrator_lists_and_cancels_the_jobs_of_all_owners(service, admin, mine):
    jobs = {queued(service.store, owner).id: owner for owner in ("me", "lab")}
    path = "/v1/admin/jobs"
    problem_of(service.client.get(path, headers=mine), 403, "scope-missing")
    listed = service.client.get(path, headers=admin).json()["items"]
    assert {item["id"]: item["owner"] for item in listed} == jobs
    found = service.client.get(path, params={"owner": "lab", "state": "queued"}, headers=admin).json()
    (job,) = (item["id"] for item in found["items"])
    assert jobs[job] == "lab"
    problem_of(service.client.post(f"{path}/{job}/cancel", headers=mine), 403, "scope-missing")
    answer = service.client.post(f"{path}/{job}/cancel", headers=admin)
    assert (answer.status_code, answer.json()["state"], answer.json()["owner"]) == (202, "cancelled", "lab")
    (entry,) = (e for e in service.store.audit.entries() if e.action == "cancel-job-as-administrator")
    keys = {key.id: key.owner for key in service.store.keys.all()}
    assert (entry.owner, entry.subject, keys[entry.key_id]) == ("lab", job, "operator")
    problem_of(service.client.post(f"{path}/{job}/cancel", headers=admin), 409, "wrong-state")
    problem_of(service.client.post(f"{path}/nothing/cancel", headers=admin), 404, "no-such-job")
