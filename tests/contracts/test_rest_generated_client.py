"""A client that openapi-python-client generates from the OpenAPI document of a service can use it."""

import importlib
import io
import re
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from pathlib import Path

import httpx
import pytest

from support.processes import eventually
from support.repository import DOCS
from support.service import csv, execute_identification, identification

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.skipif(
        find_spec("openapi_python_client") is None, reason="needs openapi-python-client: run make test"
    ),
]

#: The configuration of the generator that the guide states.
GUIDE = (DOCS / "how-to/use-the-rest-api.md").read_text("utf-8")


@pytest.fixture(scope="module")
def running(serve):
    with serve() as service:
        yield service


@pytest.fixture(scope="module")
def generated(running, tmp_path_factory):
    """Generate a client, and return a function that imports its modules."""
    folder = tmp_path_factory.mktemp("generated")
    (folder / "openapi.json").write_bytes(running.client.get("/openapi.json").content)
    (folder / "configuration.yaml").write_text(re.search(r"^```yaml\n(.*?)^```", GUIDE, re.M | re.S)[1])
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


def test_a_generated_client_walks_from_the_upload_to_the_result(running, generated):
    with (
        generated("client").Client(base_url=running.url, timeout=httpx.Timeout(180.0)) as client,
        ThreadPoolExecutor() as coordinator,
    ):
        models, jobs = generated("models"), "api.jobs"
        file = generated("types").File(payload=io.BytesIO(csv(400)), file_name="record.csv")
        (name,) = (name for name in vars(models) if name.startswith("BodyUpload") and "Fmu" not in name)
        body = getattr(models, name)
        uploaded = generated("api.data_sets.upload_v1_datasets_post").sync(
            client=client, body=body(file=file)
        )
        assert uploaded.preview.samples == 400

        order = models.JobRequest.from_dict(identification(uploaded.id, islands=2))
        submitted = generated(f"{jobs}.submit_v1_jobs_post").sync(client=client, body=order)
        assert submitted.state == "queued"
        executed = coordinator.submit(execute_identification, running)
        poll = generated(f"{jobs}.job_v1_jobs_job_get")
        ended = eventually(
            lambda: (job := poll.sync(submitted.id, client=client)).state not in ("queued", "running") and job
        )
        assert (executed.result(), ended.state) == (submitted.id, "succeeded")
        events = generated(f"{jobs}.events_v1_jobs_job_events_get").sync(submitted.id, client=client)
        assert "event: succeeded" in events

        page = generated("api.models.models_v1_jobs_job_models_get").sync(submitted.id, client=client)
        assert page.items[0].rank == 1
        result = generated("api.models.result_v1_jobs_job_result_get").sync(submitted.id, client=client)
        assert isinstance(result, models.IdentificationResult)
        assert result.models[0].equation == page.items[0].equation
        run = generated("api.figures.simulation_v1_jobs_job_models_rank_simulation_get")
        drawn = run.sync(submitted.id, 1, client=client)
        assert len(drawn.free_run) == len(drawn.measured) == len(drawn.time_s)
        figure = generated("api.figures.search_figure_v1_jobs_job_figures_figure_svg_get")
        assert "<svg" in figure.sync(submitted.id, "front", client=client)


def test_a_generated_client_cancels_a_job_and_reads_a_problem_type(running, generated):
    with generated("client").Client(base_url=running.url, timeout=httpx.Timeout(180.0)) as client:
        job = running.submit(**identification(running.upload(csv(100)).json()["id"])).json()["id"]
        cancelled = generated("api.jobs.cancel_v1_jobs_job_cancel_post").sync(job, client=client)
        assert cancelled.state == "cancelled"
        kind = generated("api.service.problem_problems_kind_get").sync("no-such-job", client=client)
        assert (kind.status, kind.title) == (404, "There is no such job")
