"""Property-based tests of the whole REST interface with schemathesis, from the OpenAPI document alone."""

import re
import sqlite3
import subprocess
import sys
import threading
from contextlib import contextmanager
from importlib.util import find_spec

import pytest

from support.service import run_identification, served
from support.stores import FAILED

#: Runs: phases, selection of operations, and time limit in seconds, which the first and the last run do not
#: reach. Deletions have a separate run because other tests need the deleted data.
RUNS = {
    "coverage": ("examples,coverage", ["--exclude-method", "DELETE"], 240),
    "links": ("stateful", ["--exclude-method", "DELETE"], 30),
    "fuzzing": ("fuzzing,stateful", [], 40),
    "deleting": ("examples,coverage", ["--include-method", "DELETE"], 60),
}

#: Id of the data set in the examples of the documentation; it exists in the tested service.
DATASET = "9f86d081884c7d659a2feaa0c55ad015-csv"

#: Id of the job in the examples of the documentation; it exists, too.
JOB = "0b8f6c1f3d0e4b6f9a3f5a0d1c2b3a4e"

#: Configuration of schemathesis. The listed operations may reject data that are valid by the schema: columns
#: that the data set does not have, invented cursors, unsuitable file names, URLs without a host.
CONFIGURATION = f"""
[dictionaries]
job = {{ values = ["{JOB}"] }}
dataset = {{ values = ["{DATASET}"] }}
rank = {{ values = [1, 2] }}

[parameters]
"path.job" = {{ dictionary = "job", probability = 0.7 }}
"path.dataset" = {{ dictionary = "dataset", probability = 0.7 }}
"path.rank" = {{ dictionary = "rank", probability = 0.7 }}

[[operations]]
include-name = [
    "POST /v1/jobs", "POST /v1/discrepancies", "POST /v1/datasets", "GET /v1/jobs", "GET /v1/datasets",
    "POST /v1/datasets/fetch", "POST /v1/webhooks", "POST /v1/monitors", "GET /v1/monitors",
    "POST /v1/monitors/{{monitor}}/records", "POST /v1/jobs/{{job}}/models/{{rank}}/simulate",
    "POST /v1/simulations/equations", "POST /v1/simulations/preview", "POST /v1/fmus", "GET /v1/fmus",
]
checks.positive_data_acceptance.expected-statuses = ["2xx", "401", "403", "404", "409", "410", "422", "429"]

# The path is also that of a data set with this id, whose methods are allowed, too.
[[operations]]
include-name = "POST /v1/datasets/fetch"
checks.allow_header_conformance.enabled = false

# Only jobs of one kind have these resources, and a new monitor has no state: 404 is correct.
[[operations]]
include-name = [
    "GET /v1/jobs/{{job}}/extended", "GET /v1/jobs/{{job}}/figures", "GET /v1/jobs/{{job}}/history",
    "GET /v1/jobs/{{job}}/models", "GET /v1/jobs/{{job}}/report", "GET /v1/monitors/{{monitor}}/state",
    "GET /v1/jobs/{{job}}/extended/export", "GET /v1/jobs/{{job}}/outputs",
    "GET /v1/jobs/{{job}}/free-run",
]
checks.ensure_resource_availability.enabled = false
"""

OWNER = "me"


@pytest.fixture
def folder(tmp_path):
    """A data folder with the data set and the job of the examples, including a result and figures."""
    folder = tmp_path / "data"
    with served(folder) as service:
        job = run_identification(service, islands=2)
        dataset = service.client.get(f"/v1/jobs/{job}").json()["spec"]["dataset"]
        for path in ("report", "models/1/simulation"):
            assert service.client.get(f"/v1/jobs/{job}/{path}").status_code == 200
    with sqlite3.connect(folder / "islands.db") as connection:
        for table in ("events", "points", "results", "models", "artefacts"):
            connection.execute(f"UPDATE {table} SET job_id = ?", [JOB])
        connection.execute("UPDATE datasets SET id = ?, owner = ?", [DATASET, OWNER])
        connection.execute(
            "UPDATE jobs SET id = ?, owner = ?, spec = replace(spec, ?, ?)", [JOB, OWNER, dataset, DATASET]
        )
    connection.close()
    return folder


@contextmanager
def finish_all_jobs(store):
    """Finish every new job, so that no event stream stays open for ever."""
    stop = threading.Event()

    def work():
        while not stop.wait(0.1):
            while (lease := store.leases.claim("test", 600.0)) is not None:
                store.leases.finish(lease, FAILED)

    worker = threading.Thread(target=work)
    worker.start()
    try:
        yield
    finally:
        stop.set()
        worker.join()


@pytest.mark.nightly
@pytest.mark.skipif(find_spec("schemathesis") is None, reason="pip install schemathesis")
@pytest.mark.parametrize("run", RUNS)
def test_schemathesis_finds_no_undocumented_response(folder, tmp_path, run):
    """Run examples, coverage, fuzzing and links; all runs take about two minutes.

    To run it by hand on a running service, with a key if it needs one::

        schemathesis run http://127.0.0.1:8000/openapi.json --max-time 600 --continue-on-failure \\
            --header "Authorization: Bearer islands_..."
    """
    phases, chosen, seconds = RUNS[run]
    (tmp_path / "schemathesis.toml").write_text(CONFIGURATION)
    with served(folder, require_keys=True, rate=0.0) as service, finish_all_jobs(service.store):
        key = service.key("read", "write", "metrics", owner=OWNER)["Authorization"]
        command = [sys.executable, "-m", "schemathesis.cli", "--no-color", "run"]
        command += [
            f"{service.url}/openapi.json",
            "--header",
            f"Authorization: {key}",
            "--continue-on-failure",
        ]
        command += ["--request-timeout", "60", "--phases", phases, "--max-time", str(seconds), *chosen]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        print(done.stdout)
        assert done.returncode == 0, done.stdout[-20_000:] + done.stderr[-5_000:]
        assert not [entry for entry in service.logs if entry["event"] in ("defect", "request failed")]
    selected, tested = (int(re.search(rf"{word}: (\d+)", done.stdout)[1]) for word in ("Selected", "Tested"))
    assert tested == selected or run == "links"  # links do not reach every operation
    assert int(re.search(r"(\d+) generated, \1 passed", done.stdout)[1]) >= tested
