"""A new user follows docs/how-to/use-the-rest-api.md: one job by curl, by Python and by the command line.

The commands are those of the page. Put in are the address, and the ids, which a stranger has to
put in as well.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from support.command_line import write_hysteresis
from support.repository import ROOT
from support.service_processes import Service, serving

#: What the page calls the service, the data set and the job.
ADDRESS, DATASET, JOB = "http://127.0.0.1:8000", "672083eb...-csv", "b93d8227..."

WAYS = ("curl", "Python", "Command line")

pytestmark = pytest.mark.timeout(900)

needs_curl = pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")


def section(page: str, title: str) -> str:
    """A section of a page of the documentation."""
    text = (ROOT / page).read_text()
    found = re.search(rf"^## {re.escape(title)}\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    assert found, title
    return found[1]


def block(way: str) -> str:
    """The code of a way to submit a job."""
    found = re.search(
        rf"\*\*{way}\*\*.*?```\w+\n(.*?)```",
        section("docs/how-to/use-the-rest-api.md", "A job in three ways"),
        re.DOTALL,
    )
    assert found, way
    return found[1]


def commands(text: str) -> list[str]:
    """The commands of a block, without comments; one may go over several lines."""
    lines = re.sub(r"\\\n\s*", "", text).splitlines()
    return [line for line in lines if line.strip() and not line.startswith("#")]


@dataclass(frozen=True, slots=True)
class Stranger:
    """Somebody in a folder with a record in it, and a service that runs."""

    service: Service
    folder: Path

    def run(self, *command: str, **put_in: str) -> str:
        """Run a command of the page; return what it says."""
        words = []
        for word in command:
            for theirs, ours in {ADDRESS: self.service.url, **put_in}.items():
                word = word.replace(theirs, ours)  # noqa: PLW2901
            assert "..." not in word, word
            words.append(word)
        paths = f"{sysconfig.get_path('scripts')}{os.pathsep}{os.environ['PATH']}"
        done = subprocess.run(
            words,
            cwd=self.folder,
            env={**os.environ, "PATH": paths, "ISLANDS_URL": self.service.url},
            capture_output=True,
            text=True,
            check=False,
            timeout=600,
        )
        assert done.returncode == 0, (words, done.stdout, done.stderr)
        return done.stdout

    def shell(self, command: str, **put_in: str) -> str:
        return self.run("sh", "-c", command, **put_in)

    @property
    def newest(self) -> str:
        """The id of the job that was submitted last."""
        identity: str = self.service.ask("GET", "/v1/jobs", params={"limit": 1}).json()["items"][0]["id"]
        return identity


@pytest.fixture(scope="module")
def stranger(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stranger]:
    folder = tmp_path_factory.mktemp("stranger")
    write_hysteresis(folder / "piezo.csv")
    with serving(folder / "data") as service:
        yield Stranger(service, folder)


@pytest.fixture(scope="module")
def jobs() -> dict[str, str]:
    """The job of every way that was gone."""
    return {}


def holds(models: list[dict[str, object]]) -> None:
    """Look whether the best of some models is constrained, and has its metrics."""
    best = models[0]
    assert best["physics"]["property_1"] is True  # type: ignore[index]
    assert best["physics"]["hold_drift_percent"] < 1e-6  # type: ignore[index]
    for part in ("estimation", "validation"):
        metrics = best["metrics"][part]["free_run"]  # type: ignore[index]
        assert 0.0 < metrics["mape"] < 5.0, part
        assert metrics["r2"] > 0.99, part


@pytest.mark.nightly
@needs_curl
def test_by_curl(stranger: Stranger, jobs: dict[str, str]) -> None:
    upload, submit, follow, models, exported, figure, report = commands(block("curl"))
    dataset = json.loads(stranger.shell(upload))
    # As the page says that it answers.
    assert dataset["id"].endswith("-csv")
    assert {"name": "u_V", "unit": "V"}.items() <= dataset["preview"]["columns"][1].items()
    assert (dataset["preview"]["dt"], dataset["preview"]["warnings"]) == (pytest.approx(0.01), [])
    job = json.loads(stranger.shell(submit, **{DATASET: dataset["id"]}))
    assert job["state"] == "queued"
    jobs["curl"] = job["id"]
    put_in = {JOB: job["id"]}
    # The same request with the same key is the same job.
    assert json.loads(stranger.shell(submit, **{DATASET: dataset["id"]}))["id"] == job["id"]
    events = re.findall(r"^event: (\w+)$", stranger.shell(follow, **put_in), re.MULTILINE)
    assert events[0] == "queued"
    assert "progress" in events
    assert events[-1] == "succeeded"
    found = json.loads(stranger.shell(models, **put_in))["items"]
    holds(found)
    assert "double" in stranger.shell(exported, **put_in)
    assert "<svg" in stranger.shell(figure, **put_in)
    assert stranger.shell(report, **put_in) == ""
    page = (stranger.folder / "report.html").read_text()
    assert page.lower().startswith("<!doctype html>")
    assert page.count("data:image/svg+xml") >= 6


@pytest.mark.nightly
def test_by_python(stranger: Stranger, jobs: dict[str, str]) -> None:
    said = stranger.run(sys.executable, "-c", block("Python"))
    jobs["Python"] = stranger.newest
    lines = said.splitlines()
    states = [line.split()[0] for line in lines if re.match(r"(queued|running|succeeded) ", line)]
    assert states[0] in ("queued", "running")
    assert states[-1] == "succeeded"
    # Equation, error and physics of the best, and its source.
    best = next(line for line in lines if line.startswith("y(k) = "))
    equation, error, physics = best.rsplit(" ", 2)
    model, *_ = json.loads(stranger.service.models(jobs["Python"]))["items"]
    assert equation == model["equation"]
    assert float(error) == model["metrics"]["validation"]["free_run"]["mape"]
    assert physics == "True"
    assert "function " in said.partition(best)[2]


@pytest.mark.nightly
def test_by_the_command_line(stranger: Stranger, jobs: dict[str, str]) -> None:
    submit, listed, result = commands(block("Command line"))
    said = stranger.shell(submit)
    assert "y(k) = " in said
    assert "Property 1" in said
    newest, *_ = [line.split() for line in stranger.shell(listed).splitlines()[1:]]
    assert newest[1] == "succeeded"
    jobs["Command line"] = newest[0]
    stranger.shell(result, **{JOB: newest[0]})
    document = json.loads((stranger.folder / "result" / "result.json").read_text())
    holds(document["models"])
    for name in ("models/01.json", "figures/loop.svg", "figures/islands.svg"):
        assert (stranger.folder / "result" / name).stat().st_size > 0, name


@pytest.mark.nightly
def test_every_way_finds_the_same_bytes(stranger: Stranger, jobs: dict[str, str]) -> None:
    # Another worker may have gone them.
    if "curl" not in jobs and shutil.which("curl") is not None:
        test_by_curl(stranger, jobs)
    if "Python" not in jobs:
        test_by_python(stranger, jobs)
    if "Command line" not in jobs:
        test_by_the_command_line(stranger, jobs)
    gone = [way for way in WAYS if way in jobs]
    assert len(set(jobs.values())) == len(gone)
    answers = [stranger.service.models(jobs[way]) for way in gone]
    assert all(answer == answers[0] for answer in answers)
    holds(json.loads(answers[0])["items"])


@pytest.mark.ci
@needs_curl
def test_the_commands_of_the_readme_are_accepted(stranger: Stranger) -> None:
    text = section("README.md", "As a service")
    blocks = [
        "\n".join(line[4:] for line in found.splitlines())
        for found in re.findall(r"(?:^    .*\n)+", text, re.MULTILINE)
    ]
    by_curl = next(each for each in blocks if each.startswith("curl"))
    upload, submit, models = (re.sub(r"\s+#.*$", "", line) for line in commands(by_curl))
    dataset = json.loads(stranger.shell(upload))
    job = json.loads(stranger.shell(submit, ID=dataset["id"]))
    assert job["state"] == "queued"
    assert json.loads(stranger.shell(models, JOB=job["id"])) == {"items": []}
    assert stranger.service.ask("POST", f"/v1/jobs/{job['id']}/cancel").status_code == 202
