"""Sensor of the absolute value: the plant behind it is found, and an output with a sign has none."""

import numpy as np
import pytest
from scipy.signal import lfilter

import islands
from islands.diagnosis.calibration.levenberg_marquardt import evaluate_fit
from islands.diagnosis.calibration.preparation import make_target, select_effects
from islands.diagnosis.discovery.state_equations import list_process_fits
from islands.diagnosis.discovery.unsigned_output import fit_unsigned_output
from islands.diagnosis.procedure import diagnose
from islands.diagnosis.run import DiagnosisRun
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.context import Signal
from islands.effects.nonlinearity import UNSIGNED_SENSOR
from islands.facade.results.complete_diagnosis import DiagnosisResult
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.output_equation import add_output_equation
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import LinearSpec

#: Denominators of plants with two real poles, with a resonance, and with a resonance behind a lag.
PLANTS: dict[str, list[float]] = {
    "linear:2": [1.0, -1.7, 0.72],
    "linear:2, resonance": [1.0, -1.8, 0.9],
    "linear:3": [1.0, -2.6, 2.34, -0.72],
}


def make_record(name: str, seed: int, sense: str = "unsigned", level: float = 0.1) -> islands.Dataset:
    """Return a record of a plant with a gain of one, whose sensor shows its output in some way."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-1.0, 1.0, 800), rng.integers(8, 40, 800))[:800]
    denominator = PLANTS[name]
    x = lfilter([0.0, sum(denominator)], denominator, u) + level
    shown: dict[str, Signal] = {"unsigned": np.abs(x), "signed": x, "rectified": np.maximum(x, 0.0)}
    y = shown[sense] + 0.005 * rng.standard_normal(u.size)
    return islands.Dataset(u, y, 0.02, ("u_V",), "w_V", ("V",), "V")


@pytest.mark.ci
@pytest.mark.nightly
@pytest.mark.parametrize("name", PLANTS)
def test_plant_behind_a_sensor_of_the_absolute_value_is_found(name: str) -> None:
    record = make_record(name, 0)
    catalogue = [CATALOGUE[each] for each in ("input-saturation", "even-nonlinearity", "unsigned-sensor")]
    simulator = make_simulator(name.partition(",")[0], record)
    found = DiagnosisResult.from_diagnosis(diagnose(record, simulator, catalogue=catalogue))
    assert (str(found.verdict), found.claimed_names) == ("named", ("unsigned-sensor",))
    assert found.effects[0].parameters["k"].value == pytest.approx(1.0, abs=0.01)
    other = make_record(name, 1)
    assert (found.simulate(other).y - other.y).std() < 0.007


@pytest.mark.parametrize(
    ("sense", "level", "is_possible"),
    [("unsigned", 0.1, True), ("signed", 0.1, False), ("signed", 9.0, False)],
)
def test_sensor_of_the_absolute_value_shows_no_sign_and_returns_to_zero(
    sense: str, level: float, is_possible: bool
) -> None:
    record = make_record("linear:2", 0, sense, level)
    simulator = make_simulator("linear:2", record)
    context = make_context(record, simulator, record.samples)
    assert (UNSIGNED_SENSOR in select_effects(simulator, context, {})) is is_possible


@pytest.mark.parametrize("change", ["constant input", "short recordings"])
def test_a_record_that_determines_no_linear_model_has_no_signs(change: str) -> None:
    record = make_record("linear:2", 0)
    linear = LinearSpec(kind="linear", order=2, numerator=(0.0, 0.1, 0.1), denominator=(1.8, -0.9))
    if change == "constant input":
        record = islands.Dataset(np.ones(record.samples), record.y, record.dt, ("u_V",))
    else:
        record = islands.join(tuple(record[first : first + 30] for first in range(0, 800, 30)))
    simulator = make_simulator(linear, record)
    context = make_context(record, simulator, record.samples)
    simulation = ExtendedSimulator(add_output_equation(simulator, context), (), context)
    target = make_target(record, record.samples, {})
    base = evaluate_fit(simulation, target, simulation.nominal)
    assert fit_unsigned_output(base, target, DiagnosisRun([UNSIGNED_SENSOR])) is None
    if change == "short recordings":
        assert list_process_fits(base, target) == []
