"""Columns of a data set for a plot."""

import numpy as np
import pytest


@pytest.fixture
def signal():
    """Rows of 1000 samples with one peak and a missing cell."""
    values = np.round(np.sin(np.arange(1000) / 50.0), 6)
    values[437] = 9.0
    return values


@pytest.fixture
def dataset(service, signal):
    rows = [f"{k * 0.1:.1f},{k % 7},{value}" for k, value in enumerate(signal)]
    rows[20] = "2.0,6,"
    return service.upload("\n".join(["t_s,u,y", *rows]).encode()).json()["id"]


def ask(service, dataset, query, **headers):
    return service.client.get(f"/v1/datasets/{dataset}/samples?{query}", headers=headers)


@pytest.mark.ci
def test_no_peak_is_lost_whatever_the_number_of_points(service, dataset):
    for points in (1, 7, 100):
        found = ask(service, dataset, f"column=u&column=y&points={points}").json()
        assert (found["start"], found["stop"], len(found["rows"])) == (0, 1000, points)
        u, y = found["columns"]
        assert (u["name"], min(u["minimum"]), max(u["maximum"])) == ("u", 0.0, 6.0)
        assert (y["name"], max(y["maximum"])) == ("y", 9.0)
        (peak,) = (place for place, value in enumerate(y["maximum"]) if value == 9.0)
        assert found["rows"][peak] <= 437 < [*found["rows"][1:], 1000][peak]


@pytest.mark.ci
@pytest.mark.parametrize(
    ("query", "status", "detail"),
    [
        ("column=speed", 422, "has no column speed; it has t_s, u, y"),
        ("column=y&start=1000", 422, "has samples 0 to 999"),
        ("column=y&start=5&stop=4", 422, "are not a part of it"),
        ("column=y&points=0", 422, "points"),
        ("columns=y", 422, "column"),
        ("", 422, "column"),
    ],
)
def test_invalid_requests_say_what_exists(service, dataset, query, status, detail):
    answer = ask(service, dataset, query)
    assert answer.status_code == status, answer.text
    assert detail in answer.text
