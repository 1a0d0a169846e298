"""A client that openapi-python-client generates from the OpenAPI document of a service can use it."""

import importlib
import io
import subprocess
import sys
import sysconfig
from importlib.util import find_spec
from pathlib import Path

import httpx
import pytest

from support.service import csv, run_identification, spec

pytestmark = [
    pytest.mark.ci,
    pytest.mark.skipif(
        find_spec("openapi_python_client") is None, reason="needs openapi-python-client: run make test"
    ),
]

#: The generator knows no SVG unless its configuration names a media type that it knows.
CONFIGURATION = "content_type_overrides: {image/svg+xml: text/plain}\npost_hooks: []\n"


@pytest.fixture(scope="module")
def running(serve):
    with serve() as service:
        yield service


@pytest.fixture(scope="module")
def generated(running, tmp_path_factory):
    """Generate a client, and return a function that imports its modules."""
    folder = tmp_path_factory.mktemp("generated")
    (folder / "openapi.json").write_bytes(running.client.get("/openapi.json").content)
    (folder / "configuration.yaml").write_text(CONFIGURATION)
    program = Path(sysconfig.get_path("scripts")) / "openapi-python-client"
    command = [program, "generate", "--path", "openapi.json", "--config", "configuration.yaml"]
    done = subprocess.run(
        [*command, "--meta", "none", "--output-path", "generated_islands", "--fail-on-warning"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    sys.path.insert(0, str(folder))
    yield lambda name: importlib.import_module(f"generated_islands.{name}")
    sys.path.remove(str(folder))


def test_a_generated_client_uploads_submits_and_reads_results(running, generated):
    with generated("client").Client(base_url=running.url, timeout=httpx.Timeout(60.0)) as client:
        models = generated("models")
        file = generated("types").File(payload=io.BytesIO(csv(100)), file_name="record.csv")
        (body,) = (each for name, each in vars(models).items() if name.startswith("BodyUpload"))
        uploaded = generated("api.data_sets.upload_v1_datasets_post").sync(
            client=client, body=body(file=file)
        )
        assert uploaded.preview.samples == 100

        job = generated("api.jobs.submit_v1_jobs_post").sync(
            client=client, body=models.JobRequest.from_dict(spec(uploaded.id))
        )
        cancelled = generated("api.jobs.cancel_v1_jobs_job_cancel_post").sync(job.id, client=client)
        assert cancelled.state == "cancelled"
        events = generated("api.jobs.events_v1_jobs_job_events_get").sync(job.id, client=client)
        assert "event: cancelled" in events

        finished = run_identification(running, islands=2)
        polled = generated("api.jobs.job_v1_jobs_job_get").sync(finished, client=client)
        assert polled.state == "succeeded"
        page = generated("api.models.models_v1_jobs_job_models_get").sync(finished, client=client)
        assert page.items[0].rank == 1
        figure = generated("api.figures.search_figure_v1_jobs_job_figures_figure_svg_get")
        assert "<svg" in figure.sync(finished, "front", client=client)
