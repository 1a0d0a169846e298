"""Previews of simulations, and FMUs, in the form of a diagnosis."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from islands_service.intake.reader_process import SIMULATION_SERVER
from support.canvas import DRAWN
from support.oscillator_fmus import write_oscillator
from support.processes import eventually
from support.reading import APPEARANCES, unreadable
from support.screen import Screen
from support.service import npz
from support.service_client import ServiceClient

pytestmark = pytest.mark.ci

ERROR = re.compile(r"Error: [\d.]+ % of the range of the output, over all samples; the first 300 calibrate")

#: Milliseconds until the server of the simulations has compiled its kernels.
COMPILED = 180_000


@pytest.fixture(scope="module")
def desk(chromium: Any, hosted: Callable[..., Any]) -> Iterator[ServiceClient]:
    """A service that accepts FMUs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ISLANDS_ALLOW_FMUS", "true")
        # One that runs has started without the setting.
        SIMULATION_SERVER.close()
        with hosted(allow_fmus=True) as service:
            yield service
        SIMULATION_SERVER.close()


@pytest.fixture(scope="module")
def dataset(desk: ServiceClient) -> str:
    t = 0.01 * np.arange(400)
    u, x, v = 10.0 * np.sin(3.0 * t) + np.sin(40.0 * t), np.zeros(400), 0.0
    for k in range(1, 400):
        v += 0.01 * (u[k - 1] - 4.0 * v - 200.0 * x[k - 1]) / 0.55
        x[k] = x[k - 1] + 0.01 * v
    columns = npz(t_s=t, F_N=u, w_N=np.cos(7.0 * t), x_m=x)
    answer = desk.ask("POST", "/v1/datasets", files={"file": ("axis.npz", columns)})
    return str(answer.json()["id"])


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_oscillator(tmp_path_factory.mktemp("fmu") / "mass.fmu")


def open_form(screen: Screen, dataset: str, kind: str) -> Any:
    page = screen.go(f"#/data/{dataset}")
    page.get_by_role("heading", name="Diagnose a simulation").click()
    page.get_by_label("F_N is an input").check()
    page.get_by_label("x_m is the output").check()
    page.get_by_label("Simulation", exact=True).select_option(kind)
    return page.locator("details.card", has_text="Diagnose a simulation")


def test_a_preview_draws_the_calibrated_simulation_and_states_a_wrong_equation(
    screens: Callable[..., Screen], desk: ServiceClient, dataset: str, expect: Any
) -> None:
    form = open_form(screens(desk.url), dataset, "second-order")
    form.get_by_role("button", name="Preview").click()
    message = form.locator(".preview [role=status]")
    expect(message).to_have_text(ERROR, timeout=COMPILED)
    expect(message).to_contain_text("m = ")
    eventually(lambda: form.locator(".preview canvas").evaluate(DRAWN) > 100)
    form.get_by_label("Simulation", exact=True).select_option("ode")
    form.get_by_label("Start from").select_option("second-order")
    text = form.get_by_label("Equations", exact=True)
    expect(form.locator(".check")).to_contain_text("Valid.")
    text.fill(text.input_value().replace("k*x", "kk*x"))
    expect(form.locator(".check")).to_contain_text("Did you mean 'k'?")
    expect(form.get_by_role("button", name="Preview")).to_be_hidden()


def test_an_fmu_is_uploaded_previewed_and_diagnosed(
    quiet: Callable[..., Screen], desk: ServiceClient, dataset: str, fmu: Path, expect: Any
) -> None:
    form = open_form(quiet(desk.url), dataset, "fmu")
    form.get_by_label("File", exact=True).set_input_files(fmu)
    expect(form.locator(".check")).to_have_text("FMI 3, model-exchange: 3 parameters.")
    expect(form.get_by_label("Output of the FMU")).to_have_value("x")
    form.get_by_label("Value of k").fill("210")
    form.get_by_label("Calibrate c").uncheck()
    form.get_by_label("Tolerance of m in per cent").fill("5")
    form.get_by_role("button", name="Preview").click()
    expect(form.locator(".preview [role=status]")).to_have_text(ERROR, timeout=COMPILED)
    form.get_by_role("button", name="Diagnose").click()
    form.page.wait_for_url("**/#/jobs/*")
    job = desk.job(form.page.url.rpartition("/")[2])
    desk.ask("POST", f"/v1/jobs/{job['id']}/cancel")
    simulation = job["spec"]["simulation"]
    assert simulation["file"].endswith("-fmu")
    assert simulation == {
        "file": simulation["file"],
        "kind": "fmu",
        "input": "u",
        "output": "x",
        "parameters": {"m": {}, "k": {"value": 210}},
    }
    assert job["spec"]["tolerance"] == {"m": 0.05}
    form.page.get_by_role("link", name="Run again with changes").click()
    expect(form.get_by_label("Value of k")).to_have_value("210")
    expect(form.get_by_label("Uploaded FMU")).to_have_value(job["spec"]["simulation"]["file"])
    form.get_by_role("button", name="Diagnose", exact=True).click()
    form.page.wait_for_url(lambda address: "#/jobs/" in address and job["id"] not in address)
    again = desk.job(form.page.url.rpartition("/")[2])
    desk.ask("POST", f"/v1/jobs/{again['id']}/cancel")
    assert again["spec"] == job["spec"]


@pytest.mark.nightly
@pytest.mark.parametrize(("scheme", "width"), APPEARANCES)
def test_the_form_of_an_fmu_and_a_preview_are_readable(
    quiet: Callable[..., Screen],
    desk: ServiceClient,
    dataset: str,
    fmu: Path,
    expect: Any,
    scheme: str,
    width: int,
) -> None:
    form = open_form(quiet(desk.url, width, 800, color_scheme=scheme), dataset, "fmu")
    form.get_by_label("File", exact=True).set_input_files(fmu)
    form.get_by_role("button", name="Preview").click()
    expect(form.locator(".preview [role=status]")).to_have_text(ERROR, timeout=COMPILED)
    assert unreadable(form.page) == []
