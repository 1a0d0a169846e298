"""Calibrated values of a simulation: intervals contain the true values, and an exact record has none."""

import numpy as np
import pytest

import islands
from islands.diagnosis.procedure import diagnose
from islands.records.dataset import Dataset
from islands.simulators.specification.equations import OdeSpec
from islands.simulators.specification.factory import make_simulator

TRUE = {"k": 2.0, "c": 0.5}

PROCESS = OdeSpec.model_validate(
    {
        "kind": "ode",
        "name": "process",
        "input": "u",
        "output": "x",
        "equations": "dx/dt = k*u - c*x\n",
        "parameters": {
            "k": {"value": 1.5, "unit": "mm/V/s"},
            "c": {"value": 0.4, "unit": "1/s"},
        },
        "states": {"x": {"unit": "mm", "initial": 0.0}},
    }
)


def make_record(noise: float) -> Dataset:
    rng = np.random.default_rng(4)
    u = np.repeat(rng.uniform(-1.0, 1.0, 30), 20)
    empty = Dataset(u, np.zeros(u.size), 0.1, ("u_V",), "x_mm", ("V",), "mm")
    document = PROCESS.model_dump()
    for name, value in TRUE.items():
        document["parameters"][name]["value"] = value
    y = islands.simulate(OdeSpec.model_validate(document), empty).y
    return Dataset(u, y + noise * rng.standard_normal(u.size), 0.1, ("u_V",), "x_mm", ("V",), "mm")


@pytest.mark.ci
def test_values_have_units_and_intervals_that_contain_the_true_values() -> None:
    record = make_record(0.02)
    values = {each.name: each for each in diagnose(record, make_simulator(PROCESS, record)).values}
    assert set(values) == set(TRUE)
    for name, true in TRUE.items():
        found = values[name]
        assert found.before == pytest.approx({"k": 1.5, "c": 0.4}[name])
        assert found.alone == pytest.approx(found.estimate.value)
        assert found.estimate.ci95 is not None
        low, high = found.estimate.ci95
        assert low < true < high
        assert high - low < 0.1 * true
    assert values["k"].estimate.unit == "mm/V/s"
