"""A job is run again with changes: the form has its settings, and asks for the same if none changes."""

from collections.abc import Callable, Mapping
from typing import Any

import pytest

from support.command_line import write_offset
from support.screen import Screen
from support.service_client import ServiceClient

pytestmark = pytest.mark.ci

MODEL = {
    "schema": "islands.model/1",
    "inputs": ["u_V"],
    "output": "y_um",
    "terms": [{"regressor": "y(k-1)", "parameter": 0.8}, {"regressor": "u(k-1)", "parameter": 0.15}],
}

EXTENDED = {
    "kind": "extended",
    "schema": "islands.extended/1",
    "inputs": ["u_V"],
    "output": "y_um",
    "core": {"kind": "linear", "order": 0, "numerator": [2.0]},
    "effects": [{"name": "dead-zone", "parameters": {"d": {"value": 0.25}}}],
    "scales": {
        "dt": 0.01,
        "input_peak": 2.0,
        "output_peak": 5.0,
        "fitted_s": 4.5,
        "duration_s": 6.0,
        "frame": {
            "unit": "V",
            "peak": 1,
            "rate": 1,
            "force_unit": "um",
            "force": 1,
            "sense": 1,
            "dissipates": True,
            "sharp": 1,
        },
    },
}

#: Requests besides data set, input and output.
REQUESTS: Mapping[str, dict[str, Any]] = {
    "column": {"simulation": {"kind": "column", "column": "theirs_um"}, "rows": "20:380"},
    "second-order": {
        "simulation": {"kind": "second-order", "parameters": {"m": 2.5}},
        "tolerance": {"m": 0.07},
        "noise_level": 0.02,
        "seed": 3,
        "dt": 0.01,
    },
    "linear": {"simulation": {"kind": "linear", "order": 3, "delay": 2}},
    "model": {"simulation": {"kind": "model", "model": MODEL, "name": "mine"}},
    "extended": {"simulation": EXTENDED},
}


@pytest.fixture(scope="module")
def dataset(desk: ServiceClient, tmp_path_factory: pytest.TempPathFactory) -> str:
    file = write_offset(tmp_path_factory.mktemp("data") / "offset.csv")
    answer = desk.ask("POST", "/v1/datasets", files={"file": ("offset.csv", file.read_bytes())})
    return str(answer.json()["id"])


def start(desk: ServiceClient, path: str, request: Mapping[str, Any]) -> dict[str, Any]:
    answer = desk.ask("POST", path, json=dict(request))
    assert answer.status_code == 202, answer.text
    job = answer.json()
    desk.ask("POST", f"/v1/jobs/{job['id']}/cancel")
    return dict(job)


def open_again(screen: Screen, job: Mapping[str, Any]) -> Any:
    page = screen.go(f"#/jobs/{job['id']}")
    page.get_by_role("link", name="Run again with changes").click()
    return page


def submit(page: Any, desk: ServiceClient, button: str) -> dict[str, Any]:
    """Start the job of a form; return it. It is cancelled."""
    page.get_by_role("button", name=button, exact=True).click()
    page.wait_for_url("**/#/jobs/*")
    job = desk.job(page.url.rpartition("/")[2])
    desk.ask("POST", f"/v1/jobs/{job['id']}/cancel")
    return job


@pytest.mark.nightly
@pytest.mark.parametrize("kind", REQUESTS)
def test_a_diagnosis_is_run_again_with_all_of_its_settings(
    quiet: Callable[..., Screen], desk: ServiceClient, dataset: str, kind: str
) -> None:
    order = {"dataset": dataset, "input": "u_V", "output": "y_um", "name": "first", **REQUESTS[kind]}
    job = start(desk, "/v1/discrepancies", order)
    page = open_again(quiet(desk.url), job)
    again = submit(page, desk, "Diagnose")
    assert (again["spec"], again["name"]) == (job["spec"], "first")
