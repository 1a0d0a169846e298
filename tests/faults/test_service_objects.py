"""`islands serve` with an object store that vanishes during a search, or refuses the service."""

from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from support.object_stores import ACCESS, CuttingProxy, make_bucket, s3_server
from support.processes import eventually
from support.service_processes import serving

pytestmark = pytest.mark.nightly

#: Generations of a job of some seconds.
GENERATIONS = 300


@pytest.fixture
def endpoint(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    with s3_server(monkeypatch) as endpoint:
        make_bucket(endpoint)
        monkeypatch.setenv("ISLANDS_BLOB_STORE", "s3://bucket/prefix")
        yield endpoint


def test_a_search_survives_the_absence_of_the_object_store(
    tmp_path: Path, endpoint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    host, _, port = endpoint.removeprefix("http://").partition(":")
    with CuttingProxy((host, int(port))) as proxy:
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{proxy.port}")
        with serving(tmp_path / "data") as service:
            undisturbed = service.found(service.submit(GENERATIONS))
            job = service.submit(GENERATIONS)
            reached = service.under_way(job, 20)
            proxy.vanish()

            def unready() -> bool:
                return httpx.get(f"{service.url}/readyz", trust_env=False).status_code == 503

            eventually(unready)
            service.under_way(job, reached + 5)  # the search goes on
            waiting = service.submit(5, seed=1)
            proxy.refuse = False
            service.ready()
            assert service.found(job) == undisturbed
            assert service.found(waiting)
            log = service.log.read_text()
            assert ACCESS["AWS_SECRET_ACCESS_KEY"] not in log
            assert not (service.folder / "blobs").exists()
