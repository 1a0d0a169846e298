"""Instructions for the first job: the three commands on the page work as written."""

import os
import subprocess
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from islands_service.domain.job import JobOutcome, JobState
from support.command_line import ISLANDS, write_hysteresis
from support.played import stored
from support.processes import eventually
from support.reading import unreadable
from support.screen import Screen
from support.service_client import ServiceClient
from support.stores import taken


@pytest.fixture(scope="module")
def commands(chromium: Any, desk: ServiceClient) -> dict[str, str]:
    """Commands by heading, read from the page of a service without jobs."""
    screen = Screen(chromium.new_page(), desk.url)
    page = screen.go()
    page.get_by_role("heading", name="No jobs yet").wait_for()
    for width in (1280, 360):
        page.set_viewport_size({"width": width, "height": 800})
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            assert unreadable(page) == [], (width, scheme)
    names = page.locator(".welcome h3").all_text_contents()
    found = dict(zip(names, page.locator(".welcome pre").all_text_contents(), strict=True))
    page.close()
    assert screen.complaints == []
    return found


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_hysteresis(tmp_path / "piezo.csv")
    return tmp_path


def run(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    path = f"{ISLANDS.parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        command,
        cwd=folder,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        check=False,
        timeout=100,
    )


def list_jobs(desk: ServiceClient) -> list[str]:
    return [job["id"] for job in desk.ask("GET", "/v1/jobs").json()["items"]]


@pytest.fixture
def run_with_coordinator(desk: ServiceClient) -> Iterator[Any]:
    """Function that runs a command and finishes the job that it waits for."""
    with ThreadPoolExecutor(1) as pool, stored(desk) as store:

        def carry_out(*command: Any) -> subprocess.CompletedProcess[str]:
            before = set(list_jobs(desk))
            done = pool.submit(run, *command)
            new = eventually(lambda: set(list_jobs(desk)) - before or done.done())
            assert new is not True, done.result()
            lease = taken(store, new.pop())
            store.leases.finish(lease, JobOutcome(JobState.SUCCEEDED, {}, summary={"equation": "y(k) = 42"}))
            return done.result()

        yield carry_out


@pytest.mark.ci
def test_the_command_line_submits_and_watches(
    commands: dict[str, str], folder: Path, run_with_coordinator: Any
) -> None:
    done = run_with_coordinator(folder, "sh", "-ec", commands["Command line"])
    assert done.returncode == 0, done.stderr
    assert "rank" in done.stdout


@pytest.mark.ci
def test_the_instructions_disappear_with_the_first_job(
    chromium: Any, commands: dict[str, str], desk: ServiceClient, expect: Any
) -> None:
    assert list(commands) == ["Command line", "Python", "curl"]
    assert all(desk.url in text for text in commands.values())
    job = desk.submit(500)
    page = Screen(chromium.new_page(), desk.url).go()
    expect(page.locator(f"tr[data-job='{job}']")).to_be_visible()
    expect(page.get_by_role("heading", name="No jobs yet")).to_have_count(0)
    page.close()
