"""``islands jobs`` in this process with a real server: show, watch and download."""

import json
import os
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from islands_api.client import Client
from islands_service.domain.job import JobOutcome
from support.command_line import COLUMNS
from support.processes import eventually
from support.service import FIGURES, Service, ahead, kept, spec
from support.stores import FAILED, brought_on, taken

Run = Callable[..., tuple[int, str, str]]


# List and show.


def test_jobs_are_listed_newest_first(run: Run, service: Service, owner: str) -> None:
    first = ahead(service, owner, name="[/b] one")
    service.store.leases.report(taken(service.store, first), brought_on(3))
    time.sleep(0.005)  # a store may have a resolution of one millisecond
    second = ahead(service, owner, name="two")
    code, out, _ = run("show")
    assert code == 0
    # Two lines for each job, which fit into 80 columns.
    one, one_name, other, other_name = (line.split() for line in out.splitlines()[2:])
    assert (one, one_name[-1]) == ([second, "queued", "-", "-"], "two")
    assert (other, other_name[-2:]) == ([first, "running", "3/-", "-"], ["[/b]", "one"])
    assert max(map(len, out.splitlines())) <= 80
    listed = [job["id"] for job in json.loads(run("show", "--json")[1])["items"]]
    assert listed == [second, first]
    assert [job["id"] for job in json.loads(run("show", "--state", "running", "--json")[1])["items"]] == [
        first
    ]
    assert [job["id"] for job in json.loads(run("show", "--limit", 1, "--json")[1])["items"]] == [second]


def test_job_is_shown_cancelled_and_resumed(run: Run, service: Service, owner: str) -> None:
    job = ahead(service, owner, spec=spec(kept(service.store, owner)))
    waits = re.compile(rf"job {job}: queued\nnumber \d+ in the queue\n")
    assert waits.fullmatch(run("show", job)[1])
    assert run("change", job, "--cancel")[:2] == (0, f"job {job}: cancelled\n")
    assert waits.fullmatch(run("change", job, "--resume")[1])
    for words in (("show", job), ("change", job, "--cancel"), ("change", job, "--resume")):
        printed = json.loads(run(*words, "--json")[1])
        assert printed["id"] == job
    service.store.leases.finish(taken(service.store, job), FAILED)
    assert run("show", job)[1] == f"job {job}: failed\nit broke\n"


# Watch.


@pytest.mark.ci
def test_job_is_submitted_watched_and_shown(
    run: Run, service: Service, owner: str, found: JobOutcome, in_background: Callable[..., None]
) -> None:
    def run_job() -> None:
        waiting = eventually(lambda: service.store.jobs.page(owner).jobs)
        lease = taken(service.store, waiting[0].id)  # type: ignore[index]
        service.store.leases.report(lease, brought_on(2))
        time.sleep(0.3)
        service.store.leases.finish(lease, found)

    in_background(run_job)
    code, out, err = run("submit", "r.csv", *COLUMNS, "--set", "priority=100", "--watch")
    assert code == 0, err
    assert err.splitlines()[0] == f"job {service.store.jobs.page(owner).jobs[0].id}"
    assert "\ny_um(k) = " in out
    assert "Property 1" in out


def test_watch_prints_the_problem_of_a_failed_job(run: Run, service: Service, owner: str) -> None:
    job = ahead(service, owner)
    service.store.leases.finish(taken(service.store, job), FAILED)
    code, out, err = run("show", job, "--watch")
    assert (code, out) == (2, "")
    assert err.splitlines() == [f"job {job}", f"error: job {job} failed: it broke"]
    code, out, _ = run("show", job, "--watch", "--json")
    assert code == 2
    assert json.loads(out)["problem"]["detail"] == "it broke"


# Results.


@pytest.mark.ci
def test_result_is_shown_and_downloaded(run: Run, done: str, found: JobOutcome) -> None:
    code, out, err = run("show", done, "--out", "out")
    assert code == 0, err
    assert out.splitlines()[-1] == "out/: result.json, models/, figures/"
    # The text that islands fit prints, with the columns of the record.
    assert out.splitlines()[1].startswith("As a simulation: ")
    assert "\nRecommended: model " in out
    assert "\ny_um(k) = " in out
    assert max(map(len, out.splitlines())) <= 80
    assert found.document is not None
    result = json.loads(Path("out/result.json").read_text())
    models = [dict(document) for document, _ in found.models]
    assert result == json.loads(json.dumps({**found.document, "models": models}))
    files = {path.name: path.read_text() for path in Path("out/models").iterdir()}
    assert files == {f"{rank:02d}.json": file for rank, (_, file) in enumerate(found.models, start=1)}
    assert {path.name for path in Path("out/figures").iterdir()} == {f"{name}.svg" for name in FIGURES}
    assert json.loads(run("show", done, "--json")[1])["result"] == result


def test_result_is_replaced_completely_and_only_with_force(run: Run, done: str) -> None:
    assert run("show", done, "--out", "out")[0] == 0
    Path("out/models/99.json").write_text("another job")
    Path("out/figures/old.svg").write_text("another job")
    Path("out/notes.txt").write_text("notes")
    code, _, err = run("show", done, "--out", "out")
    assert code == 2
    assert "holds a result already" in err
    assert Path("out/models/99.json").exists()
    assert run("show", done, "--out", "out", "--force")[0] == 0
    assert not Path("out/models/99.json").exists()
    assert not Path("out/figures/old.svg").exists()
    assert Path("out/notes.txt").read_text() == "notes"


def test_a_report_compares_recommended_models_or_those_of_a_rank(
    run: Run, done: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []
    for name in ("report", "comparison_report"):
        monkeypatch.setattr(Client, name, lambda _, given: asked.append(given) or b"<!DOCTYPE html>")
    assert run("show", done, "--report", "one.html") == (0, "one.html\n", "")
    assert run("show", done, f"{done}:2", "--report", "two.html") == (0, "two.html\n", "")
    assert asked == [done, [done, (done, 2)]]
    assert Path("two.html").read_text() == "<!DOCTYPE html>"
    code, _, err = run("show", done, "result", "--report", "two.html")
    assert (code, "result is no job: a comparison has ids of jobs, JOB or JOB:RANK" in err) == (2, True)


# Errors: one line, exit code 2.


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("show", "unknown"), "there is no job 'unknown'"),
        (("show", "one", "two"), "several jobs are compared in a report: add --report FILE"),
        (("show", "--out", "here"), "--out, --report and --watch are for a job: give its id"),
        (("change", "one"), "give --name and --tag, or one of --stop, --cancel and --resume"),
        (("show", "--state", "lost"), "state"),
        (("submit", "nowhere.csv", *COLUMNS), "No such file or directory: 'nowhere.csv'"),
        (("submit", "r.csv", "--input", "u_mV", "--output", "y_um"), "u_mV"),
        (("submit", "r.csv", *COLUMNS, "--preset", "magic"), "unknown preset 'magic'"),
        (
            ("submit", "r.csv", *COLUMNS, "--validation", "often"),
            "--validation often: give a file that exists",
        ),
        (("submit", "r.csv", *COLUMNS, "--key", "no key"), "give it as 'islands admin keys' printed it"),
        (("show", "--url", "here"), "'here' is not the address of a service"),
        (("show", "--url", "http://127.0.0.1:9"), "the service at http://127.0.0.1:9 does not answer"),
        (
            ("show", "x", "--watch", "--url", "http://127.0.0.1:9"),
            "does not answer (Connection refused): check that it runs",
        ),
        (("show", "--key", "islands_wrong"), "the key is unknown"),
    ],
)
def test_error_is_one_line(run: Run, service: Service, owner: str, arguments: Any, message: str) -> None:
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert message in err
    assert len(err.splitlines()) == 1
    assert service.store.jobs.page(owner).jobs == ()


def test_options_name_the_service_and_the_key(
    run: Run, service: Service, owner: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    secret = os.environ["ISLANDS_KEY"]
    job = ahead(service, owner)
    monkeypatch.setenv("ISLANDS_URL", "http://127.0.0.1:9")
    monkeypatch.setenv("ISLANDS_KEY", "islands_wrong")
    said = run("show", job, "--url", service.url, "--key", secret)[1]
    assert said.startswith(f"job {job}: queued\nnumber ")
    code, _, err = run("show", job, "--url", service.url)
    assert code == 2
    assert "islands_wrong" not in err
    monkeypatch.delenv("ISLANDS_KEY")
    kept(service.store)
    assert (
        run("show", "--url", service.url, "--json")[0] == 0
    )  # no key is needed on the service's own machine
