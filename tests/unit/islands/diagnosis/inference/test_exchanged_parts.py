"""An extension that is fitted to the hold-out recordings: gain on the others, and values of both."""

import numpy as np
import pytest

from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.preparation import count_fitted_samples, make_target
from islands.diagnosis.inference.exchanged_parts import ExchangedParts, exchange_parts
from islands.effects.catalogue import CATALOGUE
from islands.records.dataset import Dataset
from islands.records.split import hold_out
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.specification.factory import make_simulator
from support.joined_oscillator import SIGMA, oscillator_recordings

#: Recordings of which the second one has another input.
LENGTHS = (500, 400)


def record(first: float, second: float) -> Dataset:
    """Return a recording of an oscillator with a cubic spring, and one with another for validation."""
    one, _ = oscillator_recordings(1, LENGTHS, "cubic-stiffness", first)
    _, other = oscillator_recordings(1, LENGTHS, "cubic-stiffness", second)
    return hold_out(one, other)


def exchange(given: Dataset, name: str = "cubic-stiffness") -> ExchangedParts | None:
    fitted = count_fitted_samples(given)
    simulator = make_simulator("second-order", given)
    base = ExtendedSimulator(simulator, (), make_context(given, simulator, fitted))
    extended = base.with_effects((CATALOGUE[name],))
    target = make_target(given, fitted, {})
    fits = [calibrate(each, target, each.nominal) for each in (base, extended)]
    return exchange_parts(given, *fits, target, SIGMA, np.random.default_rng(0))


def test_a_right_law_has_the_same_values_and_reduces_the_error_of_other_data() -> None:
    found = exchange(record(3000.0, 3000.0))
    assert found is not None
    assert found.gain is not None
    assert found.gain.ci95[0] > 80.0
    assert found.gain.after.rmse == pytest.approx(SIGMA, rel=0.1)
    (value,) = found.values
    assert (value.name, value.unit) == ("cubic-stiffness k", "N/m^3")
    assert value.agrees
    assert value.estimation == pytest.approx(value.validation, rel=0.05)
