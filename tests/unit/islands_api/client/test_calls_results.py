"""What a finished job has brought, through the client: models, result, exports, figures, history.

The job is carried out by the coordinator's own function, with the engine that needs no Ray.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from islands.evolution.engine import SerialEngine
from islands.io.export import EXPORTS
from islands.io.models import model_from_json
from islands_api.client import ServiceError
from islands_api.schemas import HistoryPage, ModelView
from islands_service.coordinator.identification_job import identification
from islands_service.store.blobs import Blobs
from support.service import Service, csv

#: A search of a blink, by two islands.
SMALL = {
    "population": 10,
    "generations": 3,
    "max_terms": 3,
    "shooting": 50,
    "max_height": 3,
    "islands": 2,
    "migrate_every": 1,
}


@pytest.fixture(scope="module")
def finished(service: Service) -> tuple[str, str]:
    """The secret of an owner, and the id of a job of it that has succeeded."""
    _, secret = service.store.keys.create("finished", frozenset({"read", "write"}))
    headers = {"Authorization": f"Bearer {secret}"}
    files = {"file": ("record.csv", csv(400))}
    dataset = service.client.post("/v1/datasets", files=files, headers=headers).json()["id"]
    body = {"dataset": dataset, "inputs": ["u_V"], "output": "y_um", "settings": SMALL}
    job = service.client.post("/v1/jobs", json=body, headers=headers).json()["id"]
    lease = service.store.leases.claim("test", 3600.0)
    assert lease is not None
    assert lease.job.id == job
    blobs = Blobs(service.settings.blobs)
    outcome = identification(lease, service.store, blobs, SerialEngine(), lambda: None, 0.0)
    service.store.leases.finish(lease, outcome)
    return secret, job


@pytest.fixture
def job(finished: tuple[str, str]) -> str:
    return finished[1]


@pytest.fixture
def theirs(connect: Callable[..., Any], service: Service, finished: tuple[str, str]) -> Any:
    """A client of the owner whose job has succeeded."""
    return connect(service.url, finished[0])


def test_a_job_that_has_succeeded_says_at_a_glance_what_it_found(theirs: Any, job: str) -> None:
    done = theirs.wait(job)
    best = theirs.models(job)[0]
    assert done.summary["equation"] == best.equation
    assert done.summary["metrics"] == best.metrics["validation"]["free_run"]
    assert done.summary["models"] == len(theirs.models(job))
    assert (done.progress["generation"], done.attempt) == (3, 1)


def test_models_come_typed_and_best_first(theirs: Any, job: str) -> None:
    models = theirs.models(job)
    assert all(isinstance(model, ModelView) for model in models)
    assert [model.rank for model in models] == list(range(1, len(models) + 1))
    errors = [model.metrics["validation"]["free_run"]["rmse"] for model in models]
    assert errors == sorted(errors)
    assert models[0].physics["property_1"] is True
    assert models[0].size == len(models[0].terms)


def test_the_result_holds_the_models_as_they_are(theirs: Any, service: Service, job: str) -> None:
    result = theirs.result(job)
    stored = [dict(model.document) for model in service.store.results.models(job)]
    assert result["models"] == stored
    assert [model.model_dump(mode="json") for model in theirs.models(job)] == stored
    assert result["settings"]["islands"] == 2


@pytest.mark.parametrize("form", EXPORTS)
def test_every_model_is_exported_in_every_form(theirs: Any, job: str, form: str) -> None:
    for model in theirs.models(job):
        assert theirs.export(job, model.rank, form).strip()
    assert theirs.export(job) == theirs.export(job, 1, "python")


def test_an_exported_model_file_is_the_model(theirs: Any, job: str) -> None:
    best = theirs.models(job)[0]
    text = theirs.export(job, 1, "json")
    assert json.loads(text)["terms"] == best.terms
    assert model_from_json(text, "model 1").regressors


def test_figures_are_named_and_fetched(theirs: Any, service: Service, job: str, tmp_path: Path) -> None:
    names = theirs.figures(job)
    of_search = ("record", "front", "convergence", "islands")
    assert names == (
        *((name, None) for name in of_search),
        *((name, 1) for name in ("free-run", "loop", "hold", "residuals")),
    )
    # Drawn already, so that nobody waits for matplotlib; tests/acceptance has them drawn.
    blobs = Blobs(service.settings.blobs)
    service.store.results.keep(job, {"front.svg": blobs.write(b"<svg>front</svg>")})
    assert theirs.figure(job, "front", None) == b"<svg>front</svg>"


@pytest.mark.parametrize(
    ("call", "status"),
    [
        (lambda client, job: client.export(job, 99), 404),
        (lambda client, job: client.export(job, 1, "cobol"), 422),
        (lambda client, job: client.figure(job, "portrait"), 404),
        (lambda client, job: client.figure(job, "../../loop"), 404),
        (lambda client, _: client.result("nobody"), 404),
    ],
)
def test_what_there_is_not_is_told(theirs: Any, job: str, call: Any, status: int) -> None:
    with pytest.raises(ServiceError) as caught:
        call(theirs, job)
    assert caught.value.status == status


def test_the_history_goes_on_behind_a_generation(theirs: Any, job: str) -> None:
    history = theirs.history(job)
    assert isinstance(history, HistoryPage)
    generations = [point.generation for point in history.items]
    assert generations[0] == 0
    assert generations[-1] == 3
    assert history.items[-1].evaluations == 2 * 4 * 10
    assert len(history.items[-1].islands) == 2
    assert [point.generation for point in theirs.history(job, after=0).items] == generations[1:]
    assert theirs.history(job, after=3).items == ()


def test_a_job_without_a_result_says_so(client: Any, me: Any) -> None:
    waiting = client.submit(me.dataset, ["u_V"], "y_um")
    assert client.models(waiting) == ()
    assert client.history(waiting).items == ()
    for call in (client.result, client.figures, client.export):
        with pytest.raises(
            ServiceError, match="is queued and has no result: wait until it has succeeded"
        ) as caught:
            call(waiting)
        assert (caught.value.status, caught.value.type) == (409, "/problems/not-finished")
