"""Start of a diagnosis from the page of a data set."""

import json
import re
from collections.abc import Callable
from typing import Any

import pytest

from support.canvas import DRAWN
from support.command_line import write_offset
from support.processes import eventually
from support.reading import APPEARANCES, unreadable
from support.screen import Screen
from support.service_client import ServiceClient

pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def dataset(desk: ServiceClient, tmp_path_factory: pytest.TempPathFactory) -> str:
    """A record with a recorded simulation in the column ``theirs_um``."""
    file = write_offset(tmp_path_factory.mktemp("data") / "offset.csv")
    answer = desk.ask("POST", "/v1/datasets", files={"file": ("offset.csv", file.read_bytes())})
    return str(answer.json()["id"])


def open_form(screen: Screen, dataset: str) -> Any:
    page = screen.go(f"#/data/{dataset}")
    page.get_by_role("heading", name="Diagnose a simulation").click()
    page.get_by_label("Simulation", exact=True).wait_for()
    return page


def submit(page: Any, desk: ServiceClient) -> dict[str, Any]:
    """Start the diagnosis; return its specification. The job is cancelled."""
    page.get_by_role("button", name="Diagnose").click()
    page.wait_for_url("**/#/jobs/*")
    job = desk.job(page.url.rpartition("/")[2])
    desk.ask("POST", f"/v1/jobs/{job['id']}/cancel")
    assert job["kind"] == "discrepancy"
    return dict(job["spec"])


def test_a_diagnosis_of_a_column_is_started_and_the_column_drawn_before(
    quiet: Callable[..., Screen], desk: ServiceClient, dataset: str, expect: Any
) -> None:
    page = open_form(quiet(desk.url), dataset)
    expect(page.get_by_label("Column", exact=True)).to_have_value("theirs_um")
    eventually(lambda: page.locator("canvas").evaluate(DRAWN) > 100)
    plot = page.get_by_role("slider", name="Record")
    expect(plot).to_have_attribute("aria-valuetext", re.compile("u_V .*, y_um .*, theirs_um "))
    spec = submit(page, desk)
    assert spec["simulation"] == {"kind": "column", "column": "theirs_um"}
    assert (spec["input"], spec["output"]) == ("u_V", "y_um")


def test_values_and_tolerances_of_a_built_in_simulation_are_those_of_the_job(
    quiet: Callable[..., Screen], desk: ServiceClient, dataset: str
) -> None:
    page = open_form(quiet(desk.url), dataset)
    page.get_by_label("Simulation", exact=True).select_option("second-order")
    page.get_by_label("Value of m").fill("2.5")
    page.get_by_label("Tolerance of m in per cent").fill("5")
    details = page.locator("details.card")
    details.get_by_text("The same as a command").click()
    command, python, curl = (block.text_content() for block in details.locator("pre").all())
    assert "--simulation second-order:second-order.json --tolerance m=0.05" in command
    assert ".diagnose(\n" in python
    request = json.loads(curl.partition("-d '")[2].removesuffix("'"))
    spec = submit(page, desk)
    assert spec["simulation"] == {"kind": "second-order", "parameters": {"m": 2.5}}
    assert spec["tolerance"] == {"m": 0.05}
    assert spec == {name: value for name, value in request.items() if name != "name"}


def test_a_wrong_equation_is_explained_and_the_corrected_one_started(
    screens: Callable[..., Screen], desk: ServiceClient, dataset: str, expect: Any
) -> None:
    page = open_form(screens(desk.url), dataset)
    page.get_by_label("Simulation", exact=True).select_option("ode")
    page.get_by_label("Start from").select_option("second-order")
    text = page.get_by_label("Equations", exact=True)
    message = page.locator(".check")
    expect(message).to_have_text("Valid. States: x, v. Parameters: m, c, k.")
    right = text.input_value()
    text.fill(right.replace("k*x", "kk*x"))
    expect(message).to_contain_text("line 2 of the equations, 'dv/dt = (u - c*v - kk*x - force)/m'")
    expect(message).to_contain_text("Did you mean 'k'?")
    expect(text).to_have_attribute("aria-invalid", "true")
    expect(page.get_by_role("button", name="Diagnose")).to_be_disabled()
    text.fill(right.replace("c*v", "2*c*v"))
    expect(page.get_by_role("button", name="Diagnose")).to_be_enabled()
    spec = submit(page, desk)
    assert spec["simulation"]["kind"] == "ode"
    assert "2*c*v" in spec["simulation"]["equations"]


@pytest.mark.nightly
@pytest.mark.parametrize(("scheme", "width"), APPEARANCES)
def test_the_form_is_readable(
    quiet: Callable[..., Screen], desk: ServiceClient, dataset: str, expect: Any, scheme: str, width: int
) -> None:
    page = open_form(quiet(desk.url, width, 800, color_scheme=scheme), dataset)
    for kind in ("second-order", "linear", "model", "ode"):
        page.get_by_label("Simulation", exact=True).select_option(kind)
    expect(page.locator(".check")).to_contain_text("Valid.")
    page.locator("details.card").get_by_text("The same as a command").click()
    assert unreadable(page) == []
