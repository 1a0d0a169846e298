"""Missing terms of simulations without equations: a recorded output, a function, and an identified model."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
import scipy

from islands.diagnosis.procedure import diagnose
from islands.diagnosis.result import Diagnosis
from islands.effects.interface.context import Signal
from islands.records.dataset import Dataset
from islands.simulators.external import RecordedOutput
from islands.simulators.interface import Simulator

DT = 0.01

#: Errors of the sensor of a positioner, by the input, its rate and the output.
LAWS: dict[str, Callable[[Signal, Signal, Signal], Signal]] = {
    "rate(u)*u**2": lambda u, rate, _y: 2e-5 * rate * u**2,
    "u**5": lambda u, _rate, _y: 4e-7 * u**5,
    "y_sim*u": lambda u, _rate, y: 0.01 * y * u,
}


def follow(u: Signal, dt: float, gain: float = 2.0, tau: float = 0.08) -> Signal:
    """Simulate a positioner of first order."""
    output: Signal = scipy.signal.lfilter([0.0, gain * dt / tau], [1.0, dt / tau - 1.0], u)
    return output


def make_record(law: Callable[[Signal, Signal, Signal], Signal] | None, seed: int = 4) -> Dataset:
    rng = np.random.default_rng(seed)
    time = DT * np.arange(800)
    frequencies = rng.uniform(0.1, 2.0, 10)
    u = 4.0 * np.sin(2 * np.pi * np.outer(time, frequencies) + rng.uniform(0, 6.3, 10)).sum(axis=1)
    y = follow(u, DT)
    if law is not None:
        y = y + law(u, np.gradient(u, DT), y)
    y = y + 0.1 * rng.standard_normal(u.size)
    return Dataset(u, y, DT, ("u_V",), output_name="y_um", input_units=("V",), output_unit="um")


def make_column(record: Dataset) -> Simulator:
    return RecordedOutput("y_model", follow(record.u[:, 0], DT))


@cache
def find(law: str) -> tuple[Dataset, Diagnosis]:
    """Diagnose a recorded output that lacks a law."""
    record = make_record(LAWS[law])
    return record, diagnose(record, make_column(record))


@pytest.mark.nightly
@pytest.mark.parametrize("law", LAWS)
def test_missing_term_of_a_recorded_output_is_found(law: str) -> None:
    _, found = find(law)
    assert found.verdict == "discovered"
    assert found.discovery is not None
    assert law in found.discovery.equations
    assert "y_sim is the simulated output" in found.discovery.equations
    assert [each.name for each in found.causes] == ["missing-term"]
    assert found.gain is not None
    assert found.gain.after.rmse == pytest.approx(0.1, rel=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_right_simulation_gets_no_terms(seed: int) -> None:
    record = make_record(None, seed)
    found = diagnose(record, make_column(record))
    assert found.verdict == "nothing"
    assert found.discovery is None
