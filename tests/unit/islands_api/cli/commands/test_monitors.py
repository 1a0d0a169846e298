"""``islands monitors``: creation, records in the order of recording, views and exit codes."""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from islands.facade.record_monitor import reject_record
from islands.report.documents.monitor_json import monitor_document
from islands.report.documents.monitor_state import monitor_to_json
from islands_api.cli.service import client_options
from islands_api.web.auth import LOCAL_OWNER
from islands_service.domain.job import MONITORING, JobOutcome, JobState, Submission
from support.monitor_updates import store_monitor
from support.monitored_oscillator import follow, make_records
from support.service import Service
from support.stores import taken

Run = Callable[..., tuple[int, str, str]]

CREATE = ("add", "--simulation", "bouc-wen-piezo", "--input", "u_V", "--output", "y_um")


@pytest.fixture(scope="module")
def service(serve: Any) -> Any:
    with serve(rate=0) as running:
        yield running


@pytest.fixture
def run(service: Service, monkeypatch: pytest.MonkeyPatch, command_line: Run) -> Run:
    """Run ``islands monitors``; return exit code, standard output and error."""
    monkeypatch.setenv("ISLANDS_URL", service.url)
    monkeypatch.setattr(client_options, "RETRY_SECONDS", 0.2)
    return partial(command_line, "monitors")


@pytest.mark.ci
def test_the_states_of_a_monitor_are_shown_and_downloaded(
    run: Run, command_line: Run, service: Service, tmp_path: Path
) -> None:
    saved = reject_record(follow(make_records(1)), "short.csv", "", "it is too short")
    monitor = json.loads(run(*CREATE, "--json")[1])["id"]
    submission = Submission(LOCAL_OWNER, {}, MONITORING, priority=100, monitor=monitor)
    job, _ = service.store.jobs.submit(submission)
    texts = monitor_to_json(saved), json.dumps(monitor_document(saved))
    summary = {"words": "record 0: normal", "alarms": 0}
    outcome = JobOutcome(JobState.SUCCEEDED, {"record": {}}, summary=summary)
    service.store.leases.finish(taken(service.store, job.id), outcome)
    store_monitor(service.store, monitor, saved)
    code, shown, _ = run("show", monitor, "--out", "states")
    first, record, rejected = shown.splitlines()
    assert (code, first) == (0, f"monitor {monitor}: training, records 1, alarms 0")
    assert record.endswith("training 1 of 16")
    assert rejected == "short.csv: rejected: it is too short"
    assert (tmp_path / "states" / "state.json").read_text() == texts[0]
    assert json.loads((tmp_path / "states" / "monitor.json").read_text()) == json.loads(texts[1])
    code, shown, _ = command_line("jobs", "show", job.id, "--out", "record")
    assert (code, shown) == (0, f"job {job.id}: succeeded\nrecord 0: normal\nrecord/: record.json\n")
    assert json.loads((tmp_path / "record" / "record.json").read_text()) == {"record": {}}
    assert "<svg" in (tmp_path / "states" / "monitor.svg").read_text()
