"""Outputs and extended equation of a finished diagnosis over REST."""

import pytest

from support.service import hidden, run_diagnosis

pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def finished(serve):
    """A service with a finished diagnosis of a record with an injected effect, and the id of the job."""
    with serve() as running:
        yield running, run_diagnosis(running, hidden(running.settings.data_dir))


def ask(finished, query="", **headers):
    service, job = finished
    return service.client.get(f"/v1/jobs/{job}/outputs?{query}", headers=headers)


def test_the_outputs_have_the_errors_of_the_result(finished):
    service, job = finished
    result = service.client.get(f"/v1/jobs/{job}/result").json()
    found = ask(finished, f"start={result['estimation_samples']}&points=5000").json()
    assert found["stop"] == result["record"]["samples"]
    assert [each["name"] for each in found["outputs"]] == ["measured", "simulated", "extended"]
    for residual, side in zip(found["residuals"], ("before", "after"), strict=True):
        squares = [value**2 for value in residual["minimum"]]
        assert (sum(squares) / len(squares)) ** 0.5 == pytest.approx(result["gain"][side]["rmse"])


def test_the_extremes_are_those_of_all_samples(finished):
    every, few = (ask(finished, f"points={points}").json() for points in (5000, 7))
    assert len(few["rows"]) == 7
    for part in ("outputs", "residuals"):
        for fine, coarse in zip(every[part], few[part], strict=True):
            assert min(fine["minimum"]) == min(coarse["minimum"])
            assert max(fine["maximum"]) == max(coarse["maximum"])


@pytest.mark.parametrize(
    ("query", "detail"), [("start=9999999", "is not a part of it"), ("points=0", "points")]
)
def test_invalid_requests_say_what_exists(finished, query, detail):
    answer = ask(finished, query)
    assert (answer.status_code, detail in answer.text) == (422, True), answer.text
