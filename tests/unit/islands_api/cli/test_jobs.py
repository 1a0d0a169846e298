"""``islands jobs`` from inside, against a real server: what is sent, what is shown, what a refusal says."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import typer

from islands.evolution.engine import SerialEngine
from islands_api.cli import jobs as command
from islands_api.cli.app import main
from islands_api.cli.identify import identify
from islands_api.cli.search_options import SETTINGS
from islands_service.blobs import Blobs
from islands_service.coordinator.identification import identification
from islands_service.jobs import DISCREPANCY, EXTENDED, REPORT, JobState, Lease, Outcome, Submission
from islands_service.specification import Identification
from support.command_line import ISLANDS
from support.processes import eventually
from support.service import Service, csv, held, kept, queued
from support.stores import FAILED, LONG, at_once, brought_on

Run = Callable[..., tuple[int, str, str]]

COLUMNS = ("--input", "u_V", "--output", "y_um")

#: A value for every option that is a setting: what is written, and what the job has to say then.
VALUES: dict[str, tuple[tuple[str, ...], Any]] = {
    "population": (("40",), 40),
    "generations": (("7",), 7),
    "max_terms": (("6",), 6),
    "max_height": (("4",), 4),
    "shooting": (("50",), 50),
    "primitives": (("mul", "phi1"), ["mul", "phi1"]),
    "constraints": (("none",), "none"),
    "islands": (("3",), 3),
    "topology": (("ring",), "ring"),
    "migrate_every": (("2,5:3",), "2,5:3"),
    "migrants": (("2",), "2"),
    "emigrants": (("front",), "front"),
    "replaced": (("random",), "random"),
    "characters": (("plain", "explorer"), ["plain", "explorer"]),
    "max_evaluations": (("100000",), 100_000),
    "target_error": (("0.001",), 0.001),
}

#: A search of a blink.
SMALL = {"population": 10, "generations": 3, "max_terms": 3, "shooting": 50, "max_height": 3, "islands": 2}

FIGURES = ("record", "front", "convergence", "islands", "free-run", "loop", "hold", "residuals")


@pytest.fixture(scope="module")
def service(serve: Any) -> Iterator[Service]:
    with serve(rate=0) as running:
        yield running


@pytest.fixture
def owner(service: Service, monkeypatch: pytest.MonkeyPatch) -> str:
    """Whose test it is: the command line has the service's address and the owner's key."""
    key, secret = service.store.keys.create("test", frozenset({"read", "write"}))
    monkeypatch.setenv("ISLANDS_URL", service.url)
    monkeypatch.setenv("ISLANDS_KEY", secret)
    return key.owner


@pytest.fixture
def run(
    owner: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Run:
    """Run ``islands jobs`` in a folder that holds ``r.csv``; return exit code, standard output and error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command, "PATIENCE", 0.2)
    (tmp_path / "r.csv").write_bytes(csv())

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["islands", "jobs", *map(str, arguments)])
        try:
            main()
            code = 0
        except SystemExit as stop:
            code = int(stop.code or 0)
        said = capsys.readouterr()
        return code, said.out, said.err

    return call


@pytest.fixture
def beside() -> Iterator[Callable[..., None]]:
    """What does something beside the test, which ends with it."""
    with ExitStack() as stack:

        def start(action: Callable[..., Any], *arguments: Any) -> None:
            thread = threading.Thread(target=action, args=arguments)
            thread.start()
            stack.callback(thread.join)

        yield start


def submitted(service: Service, owner: str, **changes: Any) -> str:
    """Submit a job past the doors: it goes before all that earlier tests have left."""
    return queued(service.store, owner, priority=100, **changes).id


def claimed(service: Service, job: str) -> Lease:
    """Claim a job, as its coordinator."""
    while True:
        lease = service.store.leases.claim("test-" + job, LONG)
        assert lease is not None
        if lease.job.id == job:
            return lease


@pytest.fixture(scope="module")
def found(service: Service) -> Outcome:
    """What a small search finds: carried out by the coordinator's own function, without Ray."""
    dataset = service.upload(csv(400)).json()["id"]
    spec = {"dataset": dataset, "inputs": ["u_V"], "output": "y_um", "settings": SMALL}
    job, _ = service.store.jobs.submit(Submission("local", spec, priority=100))
    blobs = Blobs(service.settings.blobs)
    lease = claimed(service, job.id)
    return identification(lease, service.store, blobs, SerialEngine(), lambda: None, LONG)


@pytest.fixture
def done(service: Service, owner: str, found: Outcome) -> str:
    """A job that has succeeded, with its figures drawn."""
    job = submitted(service, owner)
    service.store.leases.finish(claimed(service, job), found)
    blob = Blobs(service.settings.blobs).write(b"<svg/>")
    names = {f"{name}.svg": blob for name in FIGURES[:4]} | {f"1/{name}.svg": blob for name in FIGURES[4:]}
    service.store.results.keep(job, names)
    return job


def option(name: str) -> str:
    """The option that is a parameter of ``submit``."""
    made = typer.main.get_command(command.jobs)
    return next(each.opts[0] for each in made.commands["submit"].params if each.name == name)  # type: ignore[attr-defined]


# Submit.


def test_a_submitted_job_is_printed_as_json_and_is_there(run: Run, service: Service, owner: str) -> None:
    code, out, err = run("submit", "r.csv", *COLUMNS, "--preset", "narx", "--json")
    assert (code, err) == (0, "")
    printed = json.loads(out)
    assert printed["state"] == "queued"
    job = service.store.jobs.get(owner, printed["id"])
    assert (job.name, job.spec["preset"], job.spec["inputs"], job.spec["output"]) == (
        *("r.csv", "narx"),
        *(["u_V"], "y_um"),
    )
    assert service.store.datasets.get(owner, job.spec["dataset"]).name == "r.csv"
    assert set(job.spec) == {"dataset", "inputs", "output", "preset", "seed"}  # no option speaks unasked


def test_every_setting_reaches_the_job(run: Run, service: Service, owner: str) -> None:
    assert set(VALUES) == set(SETTINGS)
    given = [word for name, (texts, _) in VALUES.items() for text in texts for word in (option(name), text)]
    words = ("--seed", 9, "--dt", 0.01, "--rows", "0:150", "--json")
    code, out, err = run("submit", "r.csv", *COLUMNS, *given, *words)
    assert code == 0, err
    spec = json.loads(out)["spec"]
    assert {name: spec[name] for name in ("seed", "dt", "rows")} == {"seed": 9, "dt": 0.01, "rows": "0:150"}
    assert spec["settings"] == {name: value for name, (_, value) in VALUES.items()}
    assert Identification.model_validate(spec).changes.keys() == set(SETTINGS)


def test_identify_and_submit_take_the_same_settings_in_the_same_words() -> None:
    alone = typer.Typer()
    alone.command()(identify)
    ours = {each.name: each.opts for each in typer.main.get_command(command.jobs).commands["submit"].params}  # type: ignore[attr-defined]
    theirs = {each.name: each.opts for each in typer.main.get_command(alone).params}
    assert {name: ours[name] for name in (*SETTINGS, "preset", "seed", "dt", "rows")} == {
        name: theirs[name] for name in (*SETTINGS, "preset", "seed", "dt", "rows")
    }


def test_what_else_is_said_of_a_job_reaches_it(run: Run, service: Service, owner: str) -> None:
    words = ("--name", "[red] one", "--priority", 5, "--idempotency-key", "k-1")
    job = json.loads(run("submit", "r.csv", *COLUMNS, *words, "--json")[1])
    assert (job["name"], job["priority"]) == ("[red] one", 5)
    assert run("submit", "r.csv", *COLUMNS, *words)[1] == f"job {job['id']}: queued\n"


def test_a_record_lends_its_name_as_far_as_it_goes(run: Run, tmp_path: Path) -> None:
    long = tmp_path / ("x\n" + "y" * 240 + ".csv")
    long.write_bytes(csv())
    code, out, err = run("submit", long, *COLUMNS, "--validation", "0.4", "--json")
    assert code == 0, err
    assert json.loads(out)["name"] == "x" + "y" * 199
    assert json.loads(out)["spec"]["validation"] == 0.4


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--rows", "0:100", "--validation", "100:"), {"dataset": "r.csv", "rows": "100:"}),
        (("--validation", "v.csv"), {"dataset": "v.csv"}),
    ],
    ids=["rows", "file"],
)
def test_validation_is_rows_or_a_file(
    run: Run, service: Service, owner: str, tmp_path: Path, words: tuple[str, ...], expected: Any
) -> None:
    (tmp_path / "v.csv").write_bytes(csv(120))
    code, out, err = run("submit", "r.csv", *COLUMNS, *words, "--json")
    assert code == 0, err
    found = json.loads(out)["spec"]["validation"]
    found["dataset"] = service.store.datasets.get(owner, found["dataset"]).name
    assert found == expected


# Look.


def test_jobs_are_listed_newest_first(run: Run, service: Service, owner: str) -> None:
    first = submitted(service, owner, name="[/b] one")
    service.store.leases.report(claimed(service, first), brought_on(3))
    time.sleep(0.005)  # a store may count milliseconds, and of those of one no job is the newer
    second = submitted(service, owner, name="two")
    code, out, _ = run("list")
    assert code == 0
    _, one, other = (line.split() for line in out.splitlines())
    assert (one[:4], one[-1]) == ([second, "queued", "-/-", "-"], "two")
    assert (other[:4], other[-2:]) == ([first, "running", "3/-", "-"], ["[/b]", "one"])
    listed = [job["id"] for job in json.loads(run("list", "--json")[1])["items"]]
    assert listed == [second, first]
    assert [job["id"] for job in json.loads(run("list", "--state", "running", "--json")[1])["items"]] == [
        first
    ]
    assert [job["id"] for job in json.loads(run("list", "--limit", 1, "--json")[1])["items"]] == [second]


def test_more_jobs_than_a_page_are_listed(run: Run, service: Service, owner: str) -> None:
    made = [job.id for job in at_once([partial(queued, service.store, owner)] * 202)]
    listed = [job["id"] for job in json.loads(run("list", "--limit", 201, "--json")[1])["items"]]
    assert len(set(listed)) == 201
    assert set(listed) < set(made)


def test_a_job_is_shown_cancelled_and_resumed(run: Run, service: Service, owner: str) -> None:
    job = submitted(service, owner)
    assert run("show", job)[:2] == (0, f"job {job}: queued\n")
    assert run("cancel", job)[:2] == (0, f"job {job}: cancelled\n")
    assert run("resume", job)[:2] == (0, f"job {job}: queued\n")
    for name in ("show", "cancel", "resume"):
        printed = json.loads(run(name, job, "--json")[1])
        assert printed["id"] == job
    service.store.leases.finish(claimed(service, job), FAILED)
    assert run("show", job)[1] == f"job {job}: failed\nit broke\n"


def test_a_job_that_succeeded_shows_its_equation(run: Run, done: str, found: Outcome) -> None:
    assert found.summary is not None
    out = run("show", done)[1]
    assert out.splitlines()[0] == f"job {done}: succeeded"
    assert found.summary["equation"] in out


# Watch.


def test_a_job_is_submitted_watched_and_shown(
    run: Run, service: Service, owner: str, found: Outcome, beside: Callable[..., None]
) -> None:
    def carry_out() -> None:
        waiting = eventually(lambda: service.store.jobs.page(owner).jobs)
        lease = claimed(service, waiting[0].id)  # type: ignore[index]
        service.store.leases.report(lease, brought_on(2))
        time.sleep(0.3)
        service.store.leases.finish(lease, found)

    beside(carry_out)
    code, out, err = run("submit", "r.csv", *COLUMNS, "--priority", 100, "--watch")
    assert code == 0, err
    assert err.splitlines()[0] == f"job {service.store.jobs.page(owner).jobs[0].id}"
    for document, _ in found.models:
        assert document["equation"] in out
    assert "Property 1" in out


def test_watching_prints_the_ended_job_as_json(run: Run, done: str) -> None:
    code, out, _ = run("watch", done, "--json")
    assert code == 0
    assert json.loads(out)["state"] == "succeeded"


def test_watching_a_job_that_fails_says_why(run: Run, service: Service, owner: str) -> None:
    job = submitted(service, owner)
    service.store.leases.finish(claimed(service, job), FAILED)
    code, out, err = run("watch", job)
    assert (code, out) == (2, "")
    assert err.splitlines() == [f"job {job}", f"error: job {job} failed: it broke"]
    code, out, _ = run("watch", job, "--json")
    assert code == 2
    assert json.loads(out)["problem"]["detail"] == "it broke"


def test_an_interrupted_watcher_leaves_the_job_running(service: Service, owner: str) -> None:
    job = submitted(service, owner)
    claimed(service, job)
    with subprocess.Popen(
        [ISLANDS, "jobs", "watch", job],
        env={**os.environ},
        stderr=subprocess.PIPE,
        text=True,
        # Whoever runs the tests in the background of a shell ignores it, and so would this one.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509 - no thread yet
    ) as process:
        # It has been answered once, and waits for a change.
        eventually(lambda: any(each.get("path") == f"/v1/jobs/{job}" for each in service.logs))
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert f"the job goes on: 'islands jobs watch {job}' follows it again" in err
    assert "Traceback" not in err
    now = service.store.jobs.get(owner, job)
    assert (now.state, now.cancel_requested) == ("running", False)


# Results.


def test_a_result_is_shown_and_downloaded(run: Run, done: str, found: Outcome) -> None:
    code, out, err = run("result", done, "--out", "out")
    assert code == 0, err
    assert out.splitlines()[-1] == "out/: result.json, models/, figures/"
    for document, _ in found.models:
        assert document["equation"] in out
    assert found.document is not None
    result = json.loads(Path("out/result.json").read_text())
    models = [dict(document) for document, _ in found.models]
    assert result == json.loads(json.dumps({**found.document, "models": models}))
    files = {path.name: path.read_text() for path in Path("out/models").iterdir()}
    assert files == {f"{rank:02d}.json": file for rank, (_, file) in enumerate(found.models, start=1)}
    assert {path.name for path in Path("out/figures").iterdir()} == {f"{name}.svg" for name in FIGURES}
    assert json.loads(run("result", done, "--json")[1]) == result


def test_a_result_is_asked_for_once(run: Run, service: Service, done: str) -> None:
    service.logs.clear()
    assert run("result", done)[0] == 0
    assert [each["path"] for each in service.logs if "path" in each] == [f"/v1/jobs/{done}/result"]


def test_a_result_is_replaced_by_force_alone_and_without_leftovers(run: Run, done: str) -> None:
    assert run("result", done, "--out", "out")[0] == 0
    Path("out/models/99.json").write_text("of another job")
    Path("out/figures/old.svg").write_text("of another job")
    Path("out/notes.txt").write_text("of mine")
    code, _, err = run("result", done, "--out", "out")
    assert code == 2
    assert "holds a result already" in err
    assert Path("out/models/99.json").exists()
    assert run("result", done, "--out", "out", "--force")[0] == 0
    assert not Path("out/models/99.json").exists()
    assert not Path("out/figures/old.svg").exists()
    assert Path("out/notes.txt").read_text() == "of mine"


# Discrepancy jobs.


@pytest.fixture
def diagnosed(service: Service, owner: str) -> str:
    """A discrepancy job that has succeeded."""
    spec = held("0-csv")
    job = service.store.jobs.submit(Submission(owner, spec, DISCREPANCY, "piezo", priority=100))[0].id
    blobs = Blobs(service.settings.blobs)
    summary = {
        "verdict": "named",
        "effects": ["thermal-drift"],
        "words": "It lacks something.\n  thermal-drift",
    }
    document = {"verdict": "named", "extended_model": "extended.json", "wall_s": 1.5}
    artefacts = {REPORT: blobs.write(b"<!DOCTYPE html>"), EXTENDED: blobs.write(b'{"effects": []}')}
    found = Outcome(JobState.SUCCEEDED, document, summary=summary, artefacts=artefacts)
    service.store.leases.finish(claimed(service, job), found)
    return job


def test_a_discrepancy_job_is_submitted_as_it_is_said(run: Run, service: Service, owner: str) -> None:
    words = ("--simulation", "bouc-wen-piezo", "--tolerance", "dp=0.01", "--seed", 3, "--priority", 5)
    code, out, err = run("diagnose", "r.csv", *COLUMNS, *words, "--rows", "0:150", "--json")
    assert (code, err) == (0, "")
    job = json.loads(out)
    assert (job["kind"], job["name"], job["priority"]) == (DISCREPANCY, "r.csv", 5)
    wanted = {"tolerance": {"dp": 0.01}, "seed": 3, "rows": "0:150"}
    assert job["spec"] == {
        **held(job["spec"]["dataset"], **wanted),
        "simulation": {"kind": "bouc-wen-piezo", "parameters": {}},
    }
    code, out, err = run("show", job["id"])
    assert out == f"job {job['id']}: queued\n"


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("--simulation", "pendulum"), "unknown simulation 'pendulum'"),
        (("--simulation", "bouc-wen-piezo", "--tolerance", "dp"), "write PARAM=REL, for example dp=0.01"),
        (("--simulation", "bouc-wen-piezo", "--input", "t_s"), "is driven by one input, got u_V, t_s"),
        (("--simulation", "column:y_sim"), "has no column y_sim"),
        (("--simulation", "python:a.py:run"), "a service runs no code of others"),
    ],
)
def test_what_cannot_be_diagnosed_is_refused_in_a_line(run: Run, arguments: Any, why: str) -> None:
    code, out, err = run("diagnose", "r.csv", *COLUMNS, *arguments)
    assert (code, out) == (2, "")
    assert why in err
    assert "Traceback" not in err


def test_a_diagnosis_is_watched_listed_and_shown_in_words(run: Run, diagnosed: str) -> None:
    words = "It lacks something.\n  thermal-drift\n"
    assert run("watch", diagnosed)[1] == words
    assert run("show", diagnosed)[1] == f"job {diagnosed}: succeeded\n{words}"
    assert run("result", diagnosed)[1] == words
    line = run("list")[1].splitlines()[1]
    assert line.startswith(diagnosed)
    assert line.endswith("piezo (named: thermal-drift)")


def test_a_diagnosis_is_downloaded_as_the_command_line_writes_it(run: Run, diagnosed: str) -> None:
    Path("out").mkdir()
    Path("out/notes.txt").write_text("of mine")
    code, out, err = run("result", diagnosed, "--out", "out")
    assert code == 0, err
    assert out.splitlines()[-1].startswith("out/: discrepancy.json, report.html, extended.json")
    names = {"discrepancy.json", "report.html", "extended.json", "notes.txt"}
    assert {path.name for path in Path("out").iterdir()} == names
    document = json.loads(Path("out/discrepancy.json").read_text())
    assert document == json.loads(run("result", diagnosed, "--json")[1])
    assert Path("out/extended.json").read_bytes() == b'{"effects": []}'
    code, _, err = run("result", diagnosed, "--out", "out")
    assert code == 2
    assert "holds a result already" in err
    assert run("result", diagnosed, "--out", "out", "--force")[0] == 0


# Refusals: one line, exit code 2.


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("show", "nobody"), "there is no job 'nobody'"),
        (("list", "--state", "lost"), "state"),
        (("submit", "nowhere.csv", *COLUMNS), "No such file or directory: 'nowhere.csv'"),
        (("submit", "r.csv", "--input", "u_mV", "--output", "y_um"), "u_mV"),
        (("submit", "r.csv", *COLUMNS, "--preset", "magic"), "unknown preset 'magic'"),
        (
            ("submit", "r.csv", *COLUMNS, "--validation", "often"),
            "--validation often: give a file that exists",
        ),
        (("submit", "r.csv", *COLUMNS, "--key", "no key"), "give it as 'islands keys create' printed it"),
        (("list", "--url", "here"), "'here' is no address of a service"),
        (("list", "--url", "http://127.0.0.1:9"), "the service at http://127.0.0.1:9 does not answer"),
        (
            ("watch", "x", "--url", "http://127.0.0.1:9"),
            "does not answer (Connection refused): is it running",
        ),
        (("list", "--key", "islands_wrong"), "the key is unknown"),
    ],
)
def test_a_refusal_is_one_line(run: Run, service: Service, owner: str, arguments: Any, told: str) -> None:
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert told in err
    assert len(err.splitlines()) == 1
    assert service.store.jobs.page(owner).jobs == ()


@pytest.mark.parametrize("name", ["result", "cancel", "resume"])
def test_what_a_job_s_state_does_not_allow_is_refused(
    run: Run, service: Service, owner: str, done: str, name: str
) -> None:
    job = submitted(service, owner) if name == "result" else done
    code, _, err = run(name, job)
    assert code == 2
    assert "job " + job in err
    assert len(err.splitlines()) == 1


def test_options_name_another_service_and_another_key(
    run: Run, service: Service, owner: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    secret = os.environ["ISLANDS_KEY"]
    job = submitted(service, owner)
    monkeypatch.setenv("ISLANDS_URL", "http://127.0.0.1:9")
    monkeypatch.setenv("ISLANDS_KEY", "islands_wrong")
    assert run("show", job, "--url", service.url, "--key", secret)[:2] == (0, f"job {job}: queued\n")
    code, _, err = run("show", job, "--url", service.url)
    assert code == 2
    assert "islands_wrong" not in err
    monkeypatch.delenv("ISLANDS_KEY")
    kept(service.store)
    assert run("list", "--url", service.url, "--json")[0] == 0  # on this machine nobody needs one


def test_a_service_that_is_away_is_not_waited_for_long() -> None:
    assert command.PATIENCE <= 5.0
