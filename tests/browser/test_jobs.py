"""Work with many jobs on the dashboard: names, tags, filters, search, selection, and rows as links."""

import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from islands_service.domain.job import JobOutcome, JobState
from support.played import stored
from support.screen import Screen
from support.service_client import ServiceClient
from support.stores import taken

pytestmark = pytest.mark.ci

SUMMARY = {
    "models": 1,
    "rank": 1,
    "size": 4,
    "equation": "y(k) = 0.5*y(k-1) + tanh(u(k-1))",
    "metrics": {"mape": 3.1415},
    "words": "Recommended: model 1.\nAs a simulation: usable, with limits (83 % is predictable).",
}


@pytest.fixture(autouse=True)
def emptied(desk: ServiceClient) -> Iterator[None]:
    """Delete the jobs of other tests."""
    yield
    for job in desk.ask("GET", "/v1/jobs?limit=200").json()["items"]:
        desk.ask("POST", f"/v1/jobs/{job['id']}/cancel")
        assert desk.ask("DELETE", f"/v1/jobs/{job['id']}").status_code == 204


def end(desk: ServiceClient, job: str, state: JobState = JobState.SUCCEEDED, **outcome: Any) -> str:
    """End a queued job; by default it succeeds with a model."""
    given = outcome or {"document": {}, "summary": SUMMARY}
    with stored(desk) as store:
        store.leases.finish(taken(store, job), JobOutcome(state, **given))
    return job


def row(page: Any, job: str) -> Any:
    return page.locator(f"tr[data-job='{job}']")


def shown(page: Any) -> list[str]:
    found: list[str] = page.locator("tr[data-job]").evaluate_all("rows => rows.map((row) => row.dataset.job)")
    return found


def test_a_row_shows_the_equation_the_error_and_the_verdict(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    job = end(desk, desk.submit(500, name="stage 3", seed=7, tags=["cold"]))
    found = row(quiet(desk.url).go(), job)
    expect(found.locator(".line")).to_have_text(SUMMARY["equation"])
    expect(found.locator(".verdict")).to_have_text("usable, with limits")
    assert found.locator("td.figure").all_text_contents()[:2] == ["3.14 %", "4"]
    about = found.locator(".about-job").text_content()
    assert about.startswith("Identification · data.csv · hysteresis · seed 7")
    assert about.endswith("u_V → y_um")
    assert found.locator(".tag").all_text_contents() == ["cold"]
    assert not found.locator("progress").is_visible()


def test_a_name_is_changed_in_its_row(quiet: Callable[..., Screen], desk: ServiceClient, expect: Any) -> None:
    job = desk.submit(500, name="before")
    page = quiet(desk.url).go()
    rename = row(page, job).get_by_role("button", name="Rename")
    rename.focus()
    page.keyboard.press("Enter")
    field = row(page, job).get_by_role("textbox", name="Name of the job")
    expect(field).to_be_focused()
    field.fill("never")
    page.keyboard.press("Escape")
    expect(rename).to_be_focused()
    assert desk.job(job)["name"] == "before"
    page.keyboard.press("Enter")
    field.fill("after <b>")
    # An update of the list meanwhile changes neither the field nor its place.
    desk.submit(500, name="new")
    expect(page.get_by_role("button", name="Show 1 new")).to_be_visible()
    assert field.input_value() == "after <b>"
    page.keyboard.press("Enter")
    expect(row(page, job).locator("th a").first).to_have_text("after <b>")
    expect(page.locator("tr[data-job]")).to_have_count(2)
    assert desk.job(job)["name"] == "after <b>"


def test_tags_are_added_on_the_page_of_a_job_and_filter_the_list(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    job, other = desk.submit(500, name="one"), desk.submit(500, name="two", tags=["cold"])
    page = quiet(desk.url).go(f"#/jobs/{job}")
    tags = page.get_by_role("group", name="Tags")
    for tag in ("rig 2", "cold"):
        tags.get_by_role("button", name="+ Tag").click()
        tags.get_by_role("textbox", name="New tag").fill(tag)
        page.keyboard.press("Enter")
        expect(tags.get_by_role("link", name=tag)).to_be_visible()
    assert desk.job(job)["tags"] == ["rig 2", "cold"]
    tags.get_by_role("link", name="rig 2").click()
    expect(row(page, job)).to_be_visible()
    assert page.url.endswith("#/jobs?tag=rig+2")
    assert shown(page) == [job]
    row(page, job).get_by_role("link", name="cold").click()
    expect(row(page, other)).to_be_visible()
    assert set(shown(page)) == {job, other}
    page.go_back()
    expect(row(page, other)).to_have_count(0)
    expect(row(page, job)).to_be_visible()
    page.locator(".tag.chosen").click()
    expect(row(page, other)).to_be_visible()
    page.goto(f"{desk.url}/#/jobs/{job}")
    tags.get_by_role("button", name="Remove the tag cold").click()
    expect(tags.get_by_role("link", name="cold")).to_have_count(0)
    assert desk.job(job)["tags"] == ["rig 2"]


def test_a_search_is_in_the_address_and_keeps_the_focus(
    screens: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    found = end(desk, desk.submit(500, name="Bühne"))
    other = desk.submit(500, name="tank")
    page = screens(desk.url).go()
    field = page.get_by_role("searchbox", name="Search")
    field.press_sequentially("BÜHNE tanh")
    # The address has the whole text after the last key.
    expect(page).to_have_url(re.compile(r"q=B%C3%9CHNE\+tanh$"))
    expect(row(page, other)).to_have_count(0)
    expect(row(page, found)).to_be_visible()
    expect(field).to_be_focused()
    page.get_by_label("Kind").select_option("Diagnosis")
    expect(page.get_by_text("No job matches these filters.")).to_be_visible()
    page.go_back()
    expect(row(page, found)).to_be_visible()
    expect(page.get_by_label("Kind")).to_have_value("")
    expect(field).to_have_value("BÜHNE tanh")
    row(page, found).locator("th a").first.click()
    page.get_by_role("heading", level=1, name="Bühne").wait_for()
    page.go_back()
    expect(row(page, found)).to_be_visible()
    assert shown(page) == [found]


def test_selected_jobs_are_deleted_after_a_confirmation(
    quiet: Callable[..., Screen], desk: ServiceClient, expect: Any
) -> None:
    ended = [end(desk, desk.submit(500, name=f"ended {number}")) for number in range(3)]
    waiting = desk.submit(500, name="waiting")
    page = quiet(desk.url).go()
    for job in (*ended[:2], waiting):
        row(page, job).get_by_role("checkbox").check()
    bar = page.get_by_role("group", name="Selected jobs")
    expect(bar).to_contain_text("3 jobs selected")
    bar.get_by_role("button", name="Delete 2 jobs").click()
    dialog = page.get_by_role("dialog", name="Delete 2 jobs?")
    expect(dialog).to_contain_text("Kept, since not ended: 1 job of the selection.")
    dialog.get_by_role("button", name="Keep them").click()
    assert set(shown(page)) == {*ended, waiting}
    bar.get_by_role("button", name="Delete 2 jobs").click()
    dialog.get_by_role("button", name="Delete 2 jobs").click()
    expect(row(page, ended[0])).to_have_count(0)
    expect(bar).to_be_hidden()
    assert set(shown(page)) == {ended[2], waiting}
    assert {job["id"] for job in desk.ask("GET", "/v1/jobs").json()["items"]} == {ended[2], waiting}
