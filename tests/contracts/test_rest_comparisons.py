"""Report of a comparison of models over REST."""

import pytest

from islands_api.client import Client
from islands_service.coordinator.identification_job import run_identification_job
from islands_service.store.blobs import Blobs
from support.job_runs import make_run
from support.service import csv
from support.stores import LONG, taken

pytestmark = pytest.mark.ci

SETTINGS = {
    "population": 10,
    "generations": 2,
    "max_terms": 2,
    "shooting": 50,
    "max_height": 3,
    "islands": 1,
    "average": 1,
}

#: Seconds for a request that draws figures in another process.
PATIENCE = 300.0


@pytest.fixture
def jobs(service, tmp_path):
    """Two jobs of one record and of one name."""
    path = tmp_path / "record.csv"
    path.write_bytes(csv(400))
    with Client(service.url) as client:
        dataset = client.upload(path)
        found = [
            client.submit(dataset, "u_V", "y_um", preset="narx", name="piezo", seed=seed, **SETTINGS)
            for seed in (1, 2)
        ]
    for job in found:
        blobs, lease = Blobs(service.settings.blobs), taken(service.store, job.id)
        outcome = run_identification_job(make_run(lease, service.store, blobs, lambda: None, LONG))
        service.store.leases.finish(lease, outcome)
    return found


def test_models_of_two_jobs_are_compared_in_one_file(service, jobs):
    first, second = jobs
    with Client(service.url, timeout=PATIENCE) as client:
        ranks = {each.rank: each.recommended for each in client.models(second)}
        other = next(rank for rank, recommended in ranks.items() if not recommended)
        page = client.comparison_report([first, second, (second, other)]).decode()
    assert page.count("<img") == 1
    assert "src=" not in page.replace('src="data:', "")
    assert "All models were validated on the same samples." in page
    for letter, job in zip("ABC", (first, second, second), strict=True):
        assert f'<th scope="row">{letter}: piezo {job.id[:8]}, model ' in page
    settings = page[page.index("Settings that differ") :]
    assert '<th scope="row">seed</th><td>1</td><td>2</td><td>2</td>' in settings
    # The free run of the model that is not recommended is kept for the next request.
    assert service.store.results.artefact(second.id, f"{other}/free-run.json")
