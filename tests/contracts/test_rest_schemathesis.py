"""Strangers who know the documentation alone: schemathesis over the whole OpenAPI, and 0 failures."""

import re
import sqlite3
import subprocess
import sys
import threading
from contextlib import contextmanager
from importlib.util import find_spec

import pytest

from support.service import identified, served
from support.stores import FAILED

#: Phases of a run, the operations that it leaves out or takes alone, and the seconds that it may take. The
#: first and the last end by themselves; what is deleted could not be looked at any more.
RUNS = {
    "coverage": ("examples,coverage", ["--exclude-method", "DELETE"], 240),
    "links": ("stateful", ["--exclude-method", "DELETE"], 30),
    "fuzzing": ("fuzzing,stateful", [], 40),
    "deleting": ("examples,coverage", ["--include-method", "DELETE"], 60),
}

#: What a data set and a job are called in the documentation's examples: they are there.
DATASET, JOB = "9f86d081884c7d659a2feaa0c55ad015-csv", "0b8f6c1f3d0e4b6f9a3f5a0d1c2b3a4e"

#: Where valid data may be refused for what no schema can say: columns that a data set has not, a cursor of
#: another's making, a name that is no file's.
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
]
checks.positive_data_acceptance.expected-statuses = ["2xx", "401", "403", "404", "409", "422", "429"]

# Jobs of one kind have them, and a job of the other says so, however new it is.
[[operations]]
include-name = [
    "GET /v1/jobs/{{job}}/extended", "GET /v1/jobs/{{job}}/figures", "GET /v1/jobs/{{job}}/history",
    "GET /v1/jobs/{{job}}/models",
]
checks.ensure_resource_availability.enabled = false
"""

OWNER = "me"


@pytest.fixture
def folder(tmp_path):
    """A data folder in which what the examples speak of is there, with a result and its figures."""
    folder = tmp_path / "data"
    with served(folder) as service:
        job = identified(service, islands=2)
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
def working(store):
    """End every job that comes: whoever follows one that waits for ever waits as long."""
    over = threading.Event()

    def work():
        while not over.wait(0.1):
            while (lease := store.leases.claim("test", 600.0)) is not None:
                store.leases.finish(lease, FAILED)

    worker = threading.Thread(target=work)
    worker.start()
    try:
        yield
    finally:
        over.set()
        worker.join()


@pytest.mark.nightly
@pytest.mark.skipif(find_spec("schemathesis") is None, reason="pip install schemathesis")
@pytest.mark.parametrize("run", RUNS)
def test_nobody_finds_an_answer_that_is_not_documented(folder, tmp_path, run):
    """Examples, coverage, fuzzing and links; about two minutes for all runs.

    By hand, on a service that runs, with a key if it needs one::

        schemathesis run http://127.0.0.1:8000/openapi.json --max-time 600 --continue-on-failure \\
            --header "Authorization: Bearer islands_..."
    """
    phases, chosen, seconds = RUNS[run]
    (tmp_path / "schemathesis.toml").write_text(CONFIGURATION)
    with served(folder, require_keys=True, rate=0.0) as service, working(service.store):
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
    assert tested == selected or run == "links"  # which lead to what was made before, and not everywhere
    assert int(re.search(r"(\d+) generated, \1 passed", done.stdout)[1]) >= tested
