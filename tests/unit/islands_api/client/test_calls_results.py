"""Results of a finished job through the client: models, result, exports, figures, history.

The job is run by the function of the coordinator, with the serial engine.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from islands_api.client import ServiceError
from islands_api.schemas import ModelView
from islands_service.coordinator.identification_job import run_identification_job
from islands_service.store.blobs import Blobs
from support.job_runs import make_run
from support.service import Service, csv, spec

#: Settings of a very short search on two islands.
SMALL = {
    "population": 10,
    "generations": 3,
    "max_terms": 3,
    "shooting": 50,
    "max_height": 3,
    "islands": 2,
    "migrate_every": 1,
    "swap_search": False,
    "refine": False,
}


@pytest.fixture(scope="module")
def finished(service: Service) -> tuple[str, str]:
    """The API key of an owner, and the id of a succeeded job of this owner."""
    _, secret = service.store.keys.create("finished", frozenset({"read", "write"}))
    headers = {"Authorization": f"Bearer {secret}"}
    files = {"file": ("record.csv", csv(400))}
    dataset = service.client.post("/v1/datasets", files=files, headers=headers).json()["id"]
    body = spec(dataset, settings=SMALL)
    job = service.client.post("/v1/jobs", json=body, headers=headers).json()["id"]
    lease = service.store.leases.claim("test", 3600.0)
    assert lease is not None
    assert lease.job.id == job
    blobs = Blobs(service.settings.blobs)
    outcome = run_identification_job(make_run(lease, service.store, blobs, lambda: None, 0.0))
    service.store.leases.finish(lease, outcome)
    return secret, job


@pytest.fixture
def job(finished: tuple[str, str]) -> str:
    return finished[1]


@pytest.fixture
def reader(connect: Callable[..., Any], service: Service, finished: tuple[str, str]) -> Any:
    """Client of the owner of the succeeded job."""
    return connect(service.url, finished[0])


def test_models_are_typed_and_best_first(reader: Any, job: str) -> None:
    models = reader.models(job)
    assert all(isinstance(model, ModelView) for model in models)
    assert [model.rank for model in models] == list(range(1, len(models) + 1))
    errors = [model.metrics["validation"]["free_run"]["rmse"] for model in models]
    assert errors == sorted(errors)
    assert models[0].physics["property_1"] is True
    assert models[0].size == len(models[0].terms)


def test_figures_are_listed_and_fetched(reader: Any, service: Service, job: str, tmp_path: Path) -> None:
    names = reader.figures(job)
    of_search = ("record", "front", "convergence", "islands")
    rank = next(model.rank for model in reader.models(job) if model.recommended)
    assert names == (
        *((name, None) for name in of_search),
        *((name, rank) for name in ("free-run", "loop", "hold", "residuals")),
    )
    # Stored beforehand, so that the test does not wait for matplotlib; tests/acceptance draws them.
    blobs = Blobs(service.settings.blobs)
    service.store.results.keep(job, {"front.svg": blobs.write(b"<svg>front</svg>")})
    assert reader.figure(job, "front", None) == b"<svg>front</svg>"


def test_queued_job_has_no_result(client: Any, me: Any) -> None:
    waiting = client.submit(me.dataset, ["u_V"], "y_um")
    assert client.models(waiting) == ()
    assert client.history(waiting).items == ()
    for call in (client.result, client.figures, client.export):
        with pytest.raises(
            ServiceError, match="is queued and has no result: wait until it has succeeded"
        ) as caught:
            call(waiting)
        assert (caught.value.status, caught.value.type) == (409, "/problems/not-finished")
