"""Data sets on the dashboard: drop a file, look at it, choose, start."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from islands.evolution.settings import FITNESSES, MOST_ISLANDS
from support.canvas import DRAWN
from support.command_line import write_hysteresis
from support.processes import eventually
from support.reading import APPEARANCES, unreadable
from support.screen import Screen
from support.service_client import ServiceClient

pytestmark = pytest.mark.ci

#: Drops files on the page as a user does.
DROP = """(files) => {
  const data = new DataTransfer();
  for (const [name, text] of files) data.items.add(new File([text], name, { type: "text/csv" }));
  for (const kind of ["dragover", "drop"])
    document.querySelector("main").dispatchEvent(
      new DragEvent(kind, { bubbles: true, cancelable: true, dataTransfer: data }));
}"""


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> str:
    file: Path = tmp_path_factory.mktemp("data") / "piezo.csv"
    write_hysteresis(file)
    return file.read_text()


def drop(page: Any, name: str, text: str) -> None:
    page.evaluate(DROP, [[name, text]])


def read_request(page: Any) -> dict[str, Any]:
    """Return the request that the page shows for curl."""
    if not page.locator(".run pre").last.is_visible():
        page.get_by_text("The same as a command").click()
    command = page.locator(".run pre").last.text_content()
    request: dict[str, Any] = json.loads(command.partition("-d '")[2].removesuffix("'"))
    return request


def remove_rows(text: str) -> str:
    """Return a record in which the rows 100 to 139 are missing."""
    lines = text.splitlines()
    return "\n".join([*lines[:101], *lines[141:]])


def submit(page: Any, desk: ServiceClient) -> dict[str, Any]:
    """Start the job of the page; return its specification."""
    page.get_by_role("button", name="Identify").click()
    page.wait_for_url("**/#/jobs/*")
    job = page.url.rpartition("/")[2]
    spec: dict[str, Any] = desk.job(job)["spec"]
    desk.ask("POST", f"/v1/jobs/{job}/cancel")
    return spec


@pytest.fixture
def looked(quiet: Callable[..., Screen], desk: ServiceClient, text: str) -> Any:
    """Page of a data set whose file was dropped on the list of jobs."""
    page = quiet(desk.url).go()
    page.get_by_role("heading", name="Jobs", exact=True).wait_for()
    drop(page, "piezo.csv", text)
    page.get_by_role("heading", name="piezo.csv").wait_for()
    eventually(lambda: page.locator("canvas").evaluate(DRAWN) > 100)
    return page


def test_a_dropped_file_is_looked_at_and_a_job_of_it_started(
    looked: Any, desk: ServiceClient, expect: Any
) -> None:
    assert looked.get_by_label("u_V is an input").is_checked()
    assert looked.get_by_label("y_um is the output").is_checked()
    looked.get_by_role("button", name="Identify").click()
    looked.wait_for_url("**/#/jobs/*")
    job = desk.job(looked.url.rpartition("/")[2])
    assert (job["name"], job["spec"]["inputs"], job["spec"]["output"]) == ("piezo.csv", ["u_V"], "y_um")
    desk.ask("POST", f"/v1/jobs/{job['id']}/cancel")


def test_the_visible_rows_are_those_of_the_job(looked: Any, desk: ServiceClient) -> None:
    plot = looked.get_by_role("slider", name="Record")
    plot.focus()
    for key in ("+", "+", "+", "PageDown"):
        plot.press(key)
    looked.get_by_role("button", name="Use only the visible rows").click()
    request = read_request(looked)
    start, stop = map(int, request["rows"].split(":"))
    assert 0 < start < stop
    # The end of the rows validates, by default a quarter.
    first, boundary = looked.get_by_label("Estimation rows").input_value().split(":")
    assert (first, int(boundary)) == (str(start), stop - round((stop - start) / 4))
    assert "validation" not in request
    submitted = desk.ask("POST", "/v1/jobs", json=request)
    assert submitted.status_code == 202, submitted.text
    desk.ask("POST", f"/v1/jobs/{submitted.json()['id']}/cancel")


def test_a_remedy_changes_the_record_of_the_job(
    quiet: Callable[..., Screen], desk: ServiceClient, text: str, expect: Any
) -> None:
    page = quiet(desk.url).go("#/data")
    drop(page, "gaps.csv", remove_rows(text))
    page.get_by_role("heading", name="gaps.csv").wait_for()
    first = read_request(page)["dataset"]
    expect(page.locator(".notes .problem")).to_contain_text("gap")
    page.get_by_role("button", name="Show in the plot").first.click()
    expect(page.locator(".signals + .position")).to_contain_text(re.compile("^row (7|8|9)"))
    page.locator(".notes").get_by_role("button", name="Split at gaps").first.click()
    page.wait_for_url(lambda url: first not in url)
    expect(page.get_by_role("button", name="Do not use: Split at gaps")).to_be_visible()
    expect(page.locator(".notes .problem")).to_have_count(0)
    spec = submit(page, desk)
    assert spec["dataset"] != first
    stored = desk.ask("GET", f"/v1/datasets/{spec['dataset']}").json()
    assert stored["preview"]["reading"] == {"gaps": "split"}
    # Without the option it is the first data set again.
    page.go_back()
    page.get_by_role("button", name="Do not use: Split at gaps").click()
    page.wait_for_url(f"**/{first}*")


def test_a_range_that_is_dragged_validates(looked: Any, desk: ServiceClient, expect: Any) -> None:
    looked.get_by_role("button", name="Mark validation").click()
    box = looked.get_by_role("slider", name="Record").bounding_box()
    width, y = box["width"], box["y"] + 60
    looked.mouse.move(box["x"] + 0.3 * width, y)
    looked.mouse.down()
    looked.mouse.move(box["x"] + 0.5 * width, y, steps=5)
    looked.mouse.up()
    rows = looked.get_by_label("Validation rows").input_value()
    start, stop = map(int, rows.split(":"))
    assert 0 < start < stop
    request = read_request(looked)
    assert request["validation"] == {"dataset": request["dataset"], "rows": rows}
    # The longest part of the other rows estimates.
    assert request["rows"].startswith(f"{stop}:")
    spec = submit(looked, desk)
    assert (spec["validation"], spec["rows"]) == (request["validation"], request["rows"])
    looked.go_back()
    looked.get_by_label("Estimation rows").fill("nothing")
    looked.get_by_label("Estimation rows").press("Tab")
    expect(looked.locator(".ranges .complaint")).to_contain_text("START:STOP")
    expect(looked.get_by_role("button", name="Identify")).to_be_disabled()


def test_only_changed_settings_are_sent_and_a_job_can_be_run_again(
    looked: Any, desk: ServiceClient, expect: Any
) -> None:
    looked.get_by_text("Settings", exact=True).click()
    looked.get_by_label("Preset").select_option("hysteresis")
    looked.get_by_text("Advanced settings").click()
    expect(looked.locator("#meaning-max_terms")).to_contain_text("Default: 9.")
    looked.get_by_label("generations", exact=True).fill("7")
    expect(looked.get_by_label("islands", exact=True)).to_have_attribute("max", str(MOST_ISLANDS))
    choices = looked.get_by_label("fitness", exact=True).locator("option")
    assert {*choices.evaluate_all("all => all.map((one) => one.value)")} == {"", *FITNESSES}
    # The first one is the default of the preset.
    assert choices.first.text_content() in FITNESSES
    looked.get_by_label("shifts", exact=True).fill("1, 2")
    settings = {"generations": 7, "shifts": [1, 2]}
    spec = submit(looked, desk)
    assert (spec["preset"], spec["settings"]) == ("hysteresis", settings)
    looked.get_by_role("link", name="Run again with changes").click()
    looked.get_by_label("generations", exact=True).wait_for()
    assert looked.get_by_label("Preset").input_value() == "hysteresis"
    looked.get_by_label("shifts", exact=True).fill("")
    assert submit(looked, desk)["settings"] == {"generations": 7}


@pytest.mark.nightly
@pytest.mark.parametrize(("scheme", "width"), APPEARANCES)
def test_the_pages_of_data_are_readable(
    quiet: Callable[..., Screen], desk: ServiceClient, text: str, scheme: str, width: int
) -> None:
    page = quiet(desk.url, width, 800, color_scheme=scheme).go("#/data")
    drop(page, "piezo.csv", text)
    page.get_by_role("heading", name="piezo.csv").wait_for()
    page.get_by_text("Settings", exact=True).click()
    page.get_by_text("Advanced settings").click()
    page.get_by_label("generations", exact=True).wait_for()
    page.get_by_text("The same as a command").click()
    assert unreadable(page) == []
    page.go_back()
    page.get_by_role("link", name="piezo.csv").first.wait_for()
    assert unreadable(page) == []
