"""Pages of monitors; the test acts as the coordinator and stores the states of real records."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from islands.records.writer import write_record
from islands.report.documents.monitor_json import describe_status, monitor_document
from islands.report.documents.monitor_state import SavedMonitor
from islands_service.domain.job import JobOutcome, JobState
from support.canvas import get_drawn
from support.monitor_updates import store_monitor
from support.monitored_oscillator import ONSET, follow, make_records, undisturbed_monitor
from support.monitoring_jobs import OSCILLATOR
from support.played import stored
from support.processes import eventually
from support.reading import APPEARANCES, unreadable
from support.screen import Screen
from support.service_client import ServiceClient
from support.stores import taken

#: Records, of which the last ones have play at the input.
COUNT = 27

NAME = "press <b>4</b>"


def upload_record(desk: ServiceClient, folder: Path) -> str:
    """Upload a record; return its path."""
    path = folder / "record-next.csv"
    write_record(make_records(COUNT, play=0.5)[-1], path)
    return str(path)


def create_monitor(desk: ServiceClient) -> str:
    answer = desk.ask("POST", "/v1/monitors", json={**OSCILLATOR, "name": NAME})
    assert answer.status_code == 201, answer.text
    return str(answer.json()["id"])


def add_record(desk: ServiceClient, monitor: str, folder: Path) -> str:
    """Submit a record; return the id of its job."""
    path = Path(upload_record(desk, folder))
    dataset = desk.ask("POST", "/v1/datasets", files={"file": (path.name, path.read_bytes())}).json()["id"]
    answer = desk.ask("POST", f"/v1/monitors/{monitor}/records", json={"dataset": dataset})
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


def store_states(desk: ServiceClient, monitor: str, job: str, saved: SavedMonitor) -> None:
    """End the job of a record with the states of a monitor."""
    with stored(desk) as store:
        lease = taken(store, job)
        store_monitor(store, monitor, saved)
        summary = {"status": describe_status(saved.state), "words": "analysed"}
        store.leases.finish(lease, JobOutcome(JobState.SUCCEEDED, {}, summary=summary))


def get_alarms(chart: Any) -> list[Any]:
    """Return the lines of the alarms of a chart, which differ from others in their width."""
    lines = get_drawn(chart)["lines"]
    return [each["parts"][0] for each in lines if round(each["width"], 2) == 1.4 and not each["dash"]]


@pytest.fixture(scope="module")
def changed() -> SavedMonitor:
    """Monitor with an alarm in its last records."""
    saved = follow(make_records(COUNT, play=0.5)[ONSET:], undisturbed_monitor())
    assert saved.state.alarms
    return saved


@pytest.fixture(scope="module")
def places(
    desk: ServiceClient, changed: SavedMonitor, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, str]:
    """Addresses of the list and of a monitor with an alarm."""
    monitor = create_monitor(desk)
    store_states(desk, monitor, add_record(desk, monitor, tmp_path_factory.mktemp("records")), changed)
    return {"list": "#/monitors", "monitor": f"#/monitors/{monitor}"}


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["list", "monitor"])
@pytest.mark.parametrize(("scheme", "width"), APPEARANCES)
def test_the_pages_of_monitors_fit_and_have_sufficient_contrast(
    quiet: Callable[..., Screen],
    desk: ServiceClient,
    places: dict[str, str],
    name: str,
    scheme: str,
    width: int,
) -> None:
    page = quiet(desk.url, width, 800, color_scheme=scheme).go(places[name])
    page.locator("tbody tr").first.wait_for()
    assert unreadable(page) == []


@pytest.mark.nightly
def test_the_page_of_a_monitor_follows_its_records_and_marks_the_alarm(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any, changed: SavedMonitor, tmp_path: Path
) -> None:
    monitor = create_monitor(desk)
    page = quiet(desk.url).go(f"#/monitors/{monitor}")
    expect(page.locator(".title .state")).to_have_text("waiting")
    expect(page.get_by_role("heading", level=1)).to_have_text(NAME)
    page.get_by_label("Next records").set_input_files(upload_record(desk, tmp_path))
    page.get_by_role("button", name="Add to the monitor").click()
    expect(page.locator(".status .facts")).to_contain_text("Waiting1")
    (job,) = (
        each["id"]
        for each in desk.ask("GET", "/v1/jobs?state=queued").json()["items"]
        if each["spec"].get("monitor") == monitor
    )
    assert desk.job(job)["name"] == "record-next.csv"
    store_states(desk, monitor, job, changed)
    expect(page.locator(".title .state")).to_have_text(describe_status(changed.state))
    alarm = monitor_document(changed)["alarms"][-1]
    expect(page.locator(".alarm-entry .verdict").first).to_have_text(alarm["words"])
    names = [each.name for each in changed.state.reference.parameters]  # type: ignore[union-attr]
    titles = [*names, "Scores of further effects", "Noise", "Test statistic"]
    expect(page.locator("figure.chart h3")).to_have_text(titles)
    for chart in page.locator("figure.chart").all():
        eventually(lambda chart=chart: len(get_alarms(chart)) == len(changed.state.alarms))
    first = page.locator("figure.chart").first
    (intervals,) = [each for each in get_drawn(first)["lines"] if each["alpha"] == 0.55]
    assert len(intervals["parts"]) == COUNT
    # The alarm is at the point of the record that raised it.
    point = get_drawn(first)["circles"][alarm["record"]["index"]]
    assert get_alarms(first)[-1][0][0] == point["at"][0]
    expect(page.locator(".records tbody tr")).to_have_count(25)
    page.get_by_role("button", name="Show older records").click()
    expect(page.locator(".records tbody tr")).to_have_count(COUNT)
    slider = page.get_by_role("slider", name="k", exact=True)
    slider.press("Home")
    value = str(changed.state.records[0].states.values[names.index("k")])[:5]
    read = re.compile(rf"^record 1, 2026-11-01 00:00: k {re.escape(value)}\d* ± 0\.\d+$")
    expect(slider).to_have_attribute("aria-valuetext", read)
    page.get_by_role("link", name="← Monitors").click()
    row = page.locator(f"tr[data-monitor='{monitor}']")
    expect(row.locator(".change")).to_contain_text(alarm["words"].split(",")[0])
    expect(row.locator("td.figure").first).to_have_text(str(COUNT))
