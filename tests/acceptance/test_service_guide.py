"""Commands of docs/how-to/use-the-rest-api.md, run literally: one job by curl, Python and command line.

Only the address and the ids are replaced, as a user has to do, too.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from support.command_line import write_hysteresis
from support.repository import ROOT
from support.service_processes import Service, serving

#: Address of the service on the page.
ADDRESS = "http://127.0.0.1:8000"

#: Id of the data set on the page.
DATASET = "672083eb...-csv"

#: Id of the job on the page.
JOB = "b93d8227..."


pytestmark = pytest.mark.timeout(900)

needs_curl = pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")


def section(page: str, title: str) -> str:
    """Return a section of a page of the documentation."""
    text = (ROOT / page).read_text()
    found = re.search(rf"^## {re.escape(title)}\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    assert found, title
    return found[1]


def block(way: str) -> str:
    """Return the code block of a way to submit a job."""
    found = re.search(
        rf"\*\*{way}\*\*.*?```\w+\n(.*?)```",
        section("docs/how-to/use-the-rest-api.md", "A job in three ways"),
        re.DOTALL,
    )
    assert found, way
    return found[1]


def commands(text: str) -> list[str]:
    """Return the commands of a block without comments; a command may have several lines."""
    lines = re.sub(r"\\\n\s*", "", text).splitlines()
    return [line for line in lines if line.strip() and not line.startswith("#")]


@dataclass(frozen=True, slots=True)
class User:
    """User of a running service, in a folder with a record."""

    service: Service
    folder: Path

    def run(self, *command: str, **replaced: str) -> str:
        """Run a command of the page with replaced texts; return its output."""
        words = []
        for word in command:
            for old, new in {ADDRESS: self.service.url, **replaced}.items():
                word = word.replace(old, new)  # noqa: PLW2901
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

    def shell(self, command: str, **replaced: str) -> str:
        return self.run("sh", "-c", command, **replaced)

    @property
    def newest(self) -> str:
        """Id of the job that was submitted last."""
        identity: str = self.service.ask("GET", "/v1/jobs", params={"limit": 1}).json()["items"][0]["id"]
        return identity


@contextmanager
def using(folder: Path, *options: object) -> Iterator[User]:
    """Start a service with options of `islands serve`; yield its user."""
    write_hysteresis(folder / "piezo.csv")
    with serving(folder / "data", *options) as service:
        yield User(service, folder)


@pytest.fixture(scope="module")
def user(tmp_path_factory: pytest.TempPathFactory) -> Iterator[User]:
    with using(tmp_path_factory.mktemp("user")) as found:
        yield found


@pytest.fixture(scope="module")
def jobs() -> dict[str, str]:
    """Ids of the submitted jobs, by way."""
    return {}


def check_best(models: list[dict[str, object]]) -> None:
    """Check that the best model is constrained and accurate."""
    best = models[0]
    assert best["physics"]["property_1"] is True  # type: ignore[index]
    assert best["physics"]["hold_drift_percent"] < 1e-6  # type: ignore[index]
    for part in ("estimation", "validation"):
        metrics = best["metrics"][part]["free_run"]  # type: ignore[index]
        assert 0.0 < metrics["mape"] < 5.0, part
        assert metrics["r2"] > 0.99, part


@pytest.mark.nightly
@needs_curl
def test_commands_with_curl(user: User, jobs: dict[str, str]) -> None:
    upload, submit, follow, models, exported, figure, report, _ = commands(block("curl"))
    dataset = json.loads(user.shell(upload))
    # The page shows this answer.
    assert dataset["id"].endswith("-csv")
    assert {"name": "u_V", "unit": "V"}.items() <= dataset["preview"]["columns"][1].items()
    assert (dataset["preview"]["dt"], dataset["preview"]["warnings"]) == (pytest.approx(0.01), [])
    job = json.loads(user.shell(submit, **{DATASET: dataset["id"]}))
    assert job["state"] == "queued"
    jobs["curl"] = job["id"]
    replaced = {JOB: job["id"]}
    # Repeating the request with the same idempotency key returns the same job.
    assert json.loads(user.shell(submit, **{DATASET: dataset["id"]}))["id"] == job["id"]
    events = re.findall(r"^event: (\w+)$", user.shell(follow, **replaced), re.MULTILINE)
    assert events[0] == "queued"
    assert "progress" in events
    assert events[-1] == "succeeded"
    found = json.loads(user.shell(models, **replaced))["items"]
    check_best(found)
    assert "double" in user.shell(exported, **replaced)
    assert "<svg" in user.shell(figure, **replaced)
    assert user.shell(report, **replaced) == ""
    page = (user.folder / "report.html").read_text()
    assert page.lower().startswith("<!doctype html>")
    assert page.count("data:image/svg+xml") >= 6


@pytest.mark.nightly
def test_python_program(user: User, jobs: dict[str, str]) -> None:
    printed = user.run(sys.executable, "-c", block("Python"))
    jobs["Python"] = user.newest
    lines = printed.splitlines()
    states = [line.split()[0] for line in lines if re.match(r"(queued|running|succeeded) ", line)]
    assert states[0] in ("queued", "running")
    assert states[-1] == "succeeded"
    # Equation, error and physics of the best model, and its source code.
    best = next(line for line in lines if line.startswith("y_um(k) = "))
    equation, error, physics = best.rsplit(" ", 2)
    models = json.loads(user.service.models(jobs["Python"]))["items"]
    model = next(each for each in models if each["recommended"])
    assert equation == model["equation"]
    assert float(error) == model["metrics"]["validation"]["free_run"]["mape"]
    assert physics == "True"
    assert "function " in printed.partition(best)[2]


@pytest.mark.nightly
def test_commands_of_the_command_line(user: User, jobs: dict[str, str]) -> None:
    submit, listed, result = commands(block("Command line"))
    printed = user.shell(submit)
    assert "\ny_um(k) = " in printed
    assert "Property 1" in printed
    newest = user.shell(listed).splitlines()[2].split()
    assert newest[1] == "succeeded"
    jobs["Command line"] = newest[0]
    user.shell(result, **{JOB: newest[0]})
    document = json.loads((user.folder / "result" / "result.json").read_text())
    check_best(document["models"])
    for name in ("models/01.json", "figures/loop.svg", "figures/islands.svg"):
        assert (user.folder / "result" / name).stat().st_size > 0, name


@pytest.mark.ci
@needs_curl
def test_commands_of_the_readme_are_accepted(tmp_path: Path) -> None:
    """No coordinator runs the job, which is cancelled in the end."""
    text = section("README.md", "As a service")
    blocks = [
        "\n".join(line[4:] for line in found.splitlines())
        for found in re.findall(r"(?:^    .*\n)+", text, re.MULTILINE)
    ]
    by_curl = next(each for each in blocks if each.startswith("curl"))
    upload, submit, models = (re.sub(r"\s+#.*$", "", line) for line in commands(by_curl))
    with using(tmp_path, "--coordinators", 0) as user:
        dataset = json.loads(user.shell(upload))
        job = json.loads(user.shell(submit, ID=dataset["id"]))
        assert job["state"] == "queued"
        assert json.loads(user.shell(models, JOB=job["id"])) == {"items": []}
        assert user.service.ask("POST", f"/v1/jobs/{job['id']}/cancel").status_code == 202
