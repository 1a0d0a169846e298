"""Models of a job on data sets over REST: the numbers of the library, any start, several outputs, limits."""

from pathlib import Path

import numpy as np
import pytest

from islands.records.reading.data_frames import as_record
from islands_api.client import Client
from islands_api.web.routes import scenarios
from islands_service.domain.fitted_models import read_fitted
from support.service import execute_identification, problem_of

pytestmark = pytest.mark.ci

#: An input that does not rest, 100 samples a second.
U = 0.3 + np.cos(0.1 * np.arange(120.0))


@pytest.fixture(scope="module")
def client(identified):
    with Client(identified.url, timeout=120.0) as connected:
        yield connected


def fitted(identified, job):
    (stored,) = identified.store.results.models(job, 1)
    return read_fitted(job, stored.file, stored.document, identified.store.results.document(job))


def write(path: Path, **columns: np.ndarray) -> Path:
    table = np.column_stack([0.01 * np.arange(len(U)), *columns.values()])
    np.savetxt(path, table, "%.17g", ",", header=",".join(["t_s", *columns]), comments="")
    return path


def test_data_sets_of_inputs_alone_are_simulated_from_rest_or_from_a_given_output(
    identified, job, client, tmp_path
):
    model = fitted(identified, job)
    plans = [client.upload(write(tmp_path / f"{factor}.csv", u_V=factor * U)) for factor in (1, 2)]
    found = client.simulate_datasets(job, plans)
    for each, plan, factor in zip(found, plans, (1, 2), strict=True):
        assert each.dataset == plan.id
        assert each.outputs == {"y_um": tuple(model.simulate(factor * U).y.tolist())}
        assert (each.start, each.outcome, len(each.time_s)) == ("from rest at the first inputs", "ok", len(U))
    (given,) = client.simulate_datasets(job, plans[0], start={"y_um": 0.5})
    assert given.outputs["y_um"] == tuple(model.simulate(U, y=0.5).y.tolist())
    assert given.start == "from y_um = 0.5"
    (part,) = client.simulate_datasets(job, {"dataset": plans[0].id, "rows": "0:20"})
    assert part.outputs["y_um"] == found[0].outputs["y_um"][:20]


def test_a_measured_output_is_where_the_simulation_starts(identified, job, client, tmp_path):
    y = 0.7 + 0.01 * U
    dataset = client.upload(write(tmp_path / "measured.csv", u_V=U, y_um=y))
    (found,) = client.simulate_datasets(job, dataset)
    record = as_record({"u_V": U, "y_um": y}, dt=0.01, inputs="u_V", output="y_um")
    expected = fitted(identified, job).simulate(record).y
    simulated = np.array([np.nan if each is None else each for each in found.outputs["y_um"]])
    np.testing.assert_array_equal(simulated, expected)
    assert found.start == "from the measured outputs"


def test_all_outputs_of_a_model_of_several_are_simulated(identified, client, tmp_path):
    rng = np.random.default_rng(0)
    u = rng.normal(size=300)
    y = np.zeros((300, 2))
    for k in range(1, 300):
        y[k] = 0.8 * y[k - 1] + [0.5 * u[k - 1], 0.2 * u[k - 1] + 0.1 * y[k - 1, 0]]
    table = np.column_stack([0.01 * np.arange(300), u, y + 0.01 * rng.normal(size=y.shape)])
    np.savetxt(tmp_path / "two.csv", table, "%.17g", ",", header="t_s,u,a,b", comments="")
    settings = {"population": 8, "generations": 2, "max_terms": 4, "library_degree": 1, "islands": 1}
    job = client.submit(client.upload(tmp_path / "two.csv"), "u", ["a", "b"], average=1, **settings).id
    assert execute_identification(identified) == job
    (found,) = client.simulate_datasets(
        job, client.upload(write(tmp_path / "plan.csv", u=U)), start={"a": 0, "b": 0}
    )
    expected = fitted(identified, job).simulate(U, y=[0.0, 0.0]).y
    assert found.outputs == {
        name: tuple(column) for name, column in zip("ab", expected.T.tolist(), strict=True)
    }


def test_what_cannot_be_simulated_is_refused_with_advice(identified, job, client, tmp_path, monkeypatch):
    plan = client.upload(write(tmp_path / "plan.csv", u_V=U))
    path = f"/v1/jobs/{job}/models/1/scenarios"
    for body, kind, detail in (
        ({"datasets": [{"dataset": plan.id}], "start": {"x": 1}}, "invalid-settings", "the model has y_um"),
        ({"datasets": []}, "invalid-request", "at least 1"),
    ):
        assert detail in problem_of(identified.client.post(path, json=body), 422, kind)
    slow = np.column_stack([0.05 * np.arange(len(U)), U])
    np.savetxt(tmp_path / "slow.csv", slow, "%.17g", ",", header="t_s,u_V", comments="")
    body = {"datasets": [{"dataset": client.upload(tmp_path / "slow.csv").id}]}
    assert "sampling time" in problem_of(identified.client.post(path, json=body), 422, "invalid-record")
    monkeypatch.setattr(scenarios, "MAX_SAMPLES", 100)
    answer = identified.client.post(path, json={"datasets": [{"dataset": plan.id}]})
    assert "120 samples, and a simulation at most 100" in problem_of(answer, 422, "invalid-settings")
