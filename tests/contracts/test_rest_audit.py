"""Audit trail of REST requests: every accepted change has one entry, with its key and address."""

from islands_service.domain.job import JobState
from islands_service.store.audit import Action
from support.service import csv, held, kept, spec
from support.stores import job_in

#: Changes by method and route.
CHANGES = {
    ("POST", "/v1/datasets"): Action.UPLOAD,
    ("DELETE", "/v1/datasets/{dataset}"): Action.DELETE_DATASET,
    ("POST", "/v1/jobs"): Action.SUBMIT,
    ("POST", "/v1/discrepancies"): Action.SUBMIT,
    ("PATCH", "/v1/jobs/{job}"): Action.LABEL,
    ("POST", "/v1/jobs/{job}/cancel"): Action.CANCEL,
    ("POST", "/v1/admin/jobs/{job}/cancel"): Action.CANCEL_AS_ADMINISTRATOR,
    ("POST", "/v1/jobs/{job}/stop"): Action.STOP,
    ("POST", "/v1/jobs/{job}/resume"): Action.RESUME,
    ("DELETE", "/v1/jobs/{job}"): Action.DELETE,
    ("POST", "/v1/admin/keys"): Action.CREATE_KEY,
    ("POST", "/v1/admin/keys/{key}/revoke"): Action.REVOKE_KEY,
    ("PATCH", "/v1/admin/owners/{owner}"): Action.CHANGE_OWNER,
    ("POST", "/v1/webhooks"): Action.CREATE_WEBHOOK,
    ("DELETE", "/v1/webhooks/{webhook}"): Action.DELETE_WEBHOOK,
    ("POST", "/v1/monitors"): Action.CREATE_MONITOR,
    ("POST", "/v1/monitors/{monitor}/records"): Action.SUBMIT,
    ("DELETE", "/v1/monitors/{monitor}"): Action.DELETE_MONITOR,
}


#: Changes of `test_rest_fetch`, which needs a server, `test_rest_readings` and `test_rest_fmus`.
OTHERS = {
    ("POST", "/v1/datasets/fetch"),
    ("POST", "/v1/datasets/{dataset}/readings"),
    ("POST", "/v1/fmus"),
    ("DELETE", "/v1/fmus/{fmu}"),
}

#: Routes that answer a document and change nothing.
ANSWERS = {
    ("POST", "/v1/jobs/{job}/models/{rank}/simulate"),
    ("POST", "/v1/jobs/{job}/models/{rank}/scenarios"),
    ("POST", "/v1/simulations/equations"),
    ("POST", "/v1/simulations/preview"),
}


def test_every_changing_route_has_an_action(service):
    paths = service.client.get("/openapi.json").json()["paths"]
    routes = {(method.upper(), path) for path, entry in paths.items() for method in entry}
    assert {route for route in routes if route[0] != "GET"} == CHANGES.keys() | OTHERS | ANSWERS
    assert set(CHANGES.values()) == set(Action) - {Action.EXPIRE_DATASET}  # by a sweep


def test_every_change_is_recorded_with_its_key_and_address(service):
    header = service.key("read", "write", "admin", owner="me")
    (key,) = service.store.keys.all()
    used, unused = kept(service.store, "me"), kept(service.store, "me", b"2")
    failed = job_in(service.store, JobState.FAILED, "me", spec=spec(used)).id
    running = job_in(service.store, JobState.RUNNING, "me", spec=spec(used)).id
    webhook = service.store.webhooks.create("me", "https://1.1.1.1", ("job.succeeded",), 1)[0].id
    columns = {name: value for name, value in held(used).items() if name != "dataset"}
    monitor = service.store.monitors.create("me", "press", columns, 0, 1).id
    requests = [
        ("POST", "/v1/datasets", {"files": {"file": ("a.csv", csv())}}),
        ("DELETE", "/v1/datasets/{dataset}", {}),
        ("POST", "/v1/jobs", {"json": spec(used)}),
        ("POST", "/v1/discrepancies", {"json": held(used)}),
        ("PATCH", "/v1/jobs/{job}", {"json": {"tags": ["rig 2"]}}),
        ("POST", "/v1/jobs/{job}/resume", {}),
        ("POST", "/v1/admin/jobs/{job}/cancel", {}),
        ("POST", "/v1/jobs/{job}/resume", {}),
        ("POST", "/v1/jobs/{job}/cancel", {}),
        ("DELETE", "/v1/jobs/{job}", {}),
        ("POST", "/v1/jobs/{job}/stop", {}),
        ("POST", "/v1/monitors", {"json": columns}),
        ("POST", "/v1/monitors/{monitor}/records", {"json": {"dataset": used}}),
        ("DELETE", "/v1/monitors/{monitor}", {}),
        ("POST", "/v1/admin/keys", {"json": {"scopes": ["read"], "owner": "me"}}),
        ("PATCH", "/v1/admin/owners/{owner}", {"json": {"weight": 7}}),
        ("DELETE", "/v1/webhooks/{webhook}", {}),
        ("POST", "/v1/webhooks", {"json": {"url": "https://1.1.1.1"}}),
        # The last one, since it is the key of these requests.
        ("POST", "/v1/admin/keys/{key}/revoke", {}),
    ]
    assert {(method, route) for method, route, _ in requests} == set(CHANGES)
    for method, route, body in requests:
        subjects = {"job": failed, "dataset": unused, "owner": "me", "key": key.id}
        subjects |= {"webhook": webhook, "monitor": monitor}
        if route.endswith("/stop"):
            subjects["job"] = running
        path = route.format(**subjects)
        answer = service.client.request(method, path, headers=header, **body)
        assert answer.is_success, (route, answer.text)
        subject = subjects.get(route.partition("{")[2].partition("}")[0])
        if "{" not in route or route.endswith("/records"):
            subject = answer.json()["id"]
        (entry,) = service.store.audit.entries("me", limit=1)
        assert (entry.action, entry.subject) == (CHANGES[method, route], subject)
        assert (entry.owner, entry.key_id, entry.address) == ("me", key.id, "127.0.0.1")
    assert len(service.store.audit.entries()) == len(requests)


def test_refused_and_repeated_requests_are_not_recorded(service):
    order = spec(kept(service.store))
    first = service.submit({"Idempotency-Key": "k"}, **order)
    before = service.store.audit.entries()
    assert [entry.key_id for entry in before] == [None]
    assert service.submit({"Idempotency-Key": "k"}, **order).status_code == 202
    service.submit(**{**order, "dataset": "gone-csv"})
    assert service.client.delete(first.headers["location"]).status_code == 409
    assert service.store.audit.entries() == before
