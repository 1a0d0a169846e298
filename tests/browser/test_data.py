"""Data sets on the dashboard: drop a file, look at it, choose, start."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from support.canvas import DRAWN
from support.command_line import write_hysteresis
from support.processes import eventually
from support.reading import APPEARANCES, unreadable
from support.screen import Screen
from support.service_processes import Service

pytestmark = pytest.mark.ci

#: Drops a file on the page as a user does.
DROP = """([name, text]) => {
  const data = new DataTransfer();
  data.items.add(new File([text], name, { type: "text/csv" }));
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
    page.evaluate(DROP, [name, text])


@pytest.fixture
def looked(quiet: Callable[..., Screen], desk: Service, text: str) -> Any:
    """Page of a data set whose file was dropped on the list of jobs."""
    page = quiet(desk.url).go()
    page.get_by_role("heading", name="Jobs", exact=True).wait_for()
    drop(page, "piezo.csv", text)
    page.get_by_role("heading", name="piezo.csv").wait_for()
    eventually(lambda: page.locator("canvas").evaluate(DRAWN) > 100)
    return page


def test_a_dropped_file_is_looked_at_and_a_job_of_it_started(looked: Any, desk: Service, expect: Any) -> None:
    assert looked.get_by_label("u_V is an input").is_checked()
    assert looked.get_by_label("y_um is the output").is_checked()
    looked.get_by_role("button", name="Identify").click()
    looked.wait_for_url("**/#/jobs/*")
    job = desk.job(looked.url.rpartition("/")[2])
    assert (job["name"], job["spec"]["inputs"], job["spec"]["output"]) == ("piezo.csv", ["u_V"], "y_um")
    desk.ask("POST", f"/v1/jobs/{job['id']}/cancel")


def test_the_visible_rows_are_those_of_the_job(looked: Any, desk: Service) -> None:
    plot = looked.get_by_role("slider", name="Record")
    plot.focus()
    for key in ("+", "+", "+", "PageDown"):
        plot.press(key)
    looked.get_by_text("Settings").click()
    looked.get_by_role("button", name="Use the visible rows").click()
    start, stop = map(int, looked.get_by_label("Rows").input_value().split(":"))
    assert 0 < start < stop
    looked.get_by_text("The same as a command").click()
    command = looked.locator(".run pre").last.text_content()
    request = json.loads(command.partition("-d '")[2].removesuffix("'"))
    assert request["rows"] == f"{start}:{stop}"
    submitted = desk.ask("POST", "/v1/jobs", json=request)
    assert submitted.status_code == 202, submitted.text
    desk.ask("POST", f"/v1/jobs/{submitted.json()['id']}/cancel")


def test_values_of_a_short_range_are_read_with_the_keys(looked: Any, expect: Any) -> None:
    plot = looked.get_by_role("slider", name="Record")
    plot.focus()
    with looked.expect_response(lambda answer: "/samples?" in answer.url):
        for _ in range(30):
            plot.press("+")
    plot.press("ArrowRight")
    # One value, and not the extremes of several rows.
    expect(plot).to_have_attribute("aria-valuetext", re.compile(r"^[\d.]+ s: u_V \S+, y_um \S+$"))


def test_a_column_has_one_role(looked: Any, expect: Any) -> None:
    looked.get_by_label("y_um is an input").check()
    expect(looked.get_by_label("y_um is the output")).not_to_be_checked()
    expect(looked.get_by_role("button", name="Identify")).to_be_disabled()
    looked.get_by_label("u_V is the output").check()
    expect(looked.get_by_label("u_V is an input")).not_to_be_checked()
    expect(looked.get_by_role("button", name="Identify")).to_be_enabled()
    expect(looked.locator(".run")).to_contain_text("y_um → u_V")


def test_a_broken_file_says_why(screens: Callable[..., Screen], desk: Service, expect: Any) -> None:
    page = screens(desk.url).go("#/data")
    page.get_by_role("heading", name="Data", exact=True).wait_for()
    drop(page, "empty.csv", "")
    expect(page.locator(".banner.problem")).to_contain_text("empty.csv")
    assert page.url.endswith("#/data")


@pytest.mark.parametrize(("scheme", "width"), APPEARANCES)
def test_the_pages_of_data_are_readable(
    quiet: Callable[..., Screen], desk: Service, text: str, scheme: str, width: int
) -> None:
    page = quiet(desk.url, width, 800, color_scheme=scheme).go("#/data")
    drop(page, "piezo.csv", text)
    page.get_by_role("heading", name="piezo.csv").wait_for()
    page.get_by_text("Settings").click()
    page.get_by_text("The same as a command").click()
    assert unreadable(page) == []
    page.go_back()
    page.get_by_role("link", name="piezo.csv").first.wait_for()
    assert unreadable(page) == []
