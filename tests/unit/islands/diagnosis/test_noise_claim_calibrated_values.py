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


@pytest.mark.ci
def test_values_of_an_exact_record_have_no_intervals() -> None:
    record = make_record(0.0)
    values = diagnose(record, make_simulator(PROCESS, record)).values
    assert {each.name: each.estimate.value for each in values} == pytest.approx(TRUE, rel=1e-6)
    assert all(each.estimate.ci95 is None for each in values)


@pytest.mark.ci
def test_equations_of_a_linear_simulation_are_compared_with_it() -> None:
    rng = np.random.default_rng(3)
    u = np.repeat(rng.uniform(0.0, 100.0, 40), 20)
    y = [20.0]
    for power in u[:-1].tolist():
        rate = (20.0 + 0.8 * power - y[-1]) / (60.0 if 20.0 + 0.8 * power > y[-1] else 120.0)
        y.append(y[-1] + 2.0 * rate)
    record = Dataset(u, np.array(y) + 0.1 * rng.standard_normal(u.size), 2.0, ("u_W",), "y_K", ("W",), "K")
    found = diagnose(record, make_simulator("linear:1", record))
    values = {each.name: each for each in found.values}
    assert {"K", "T", "level"} <= set(values)
    assert all(each.before is None for each in values.values())
    alone = {name: values[name].alone for name in ("K", "T", "level")}
    assert alone == pytest.approx({"K": 0.8, "T": 90.0, "level": 20.0}, rel=0.3)
