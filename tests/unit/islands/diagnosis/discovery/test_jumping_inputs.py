"""Actuators that move in jumps: their values are found behind a slow plant, and noise has none."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.preparation import count_fitted_samples, make_target
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.discovery.jumping_inputs import find_stick_slip, fit_jumping_inputs
from islands.diagnosis.discovery.state_equations import get_linear
from islands.diagnosis.inference.hypothesis import Hypothesis
from islands.diagnosis.inference.screening import compute_cost, screen_effects, transfer_parameters
from islands.diagnosis.procedure import diagnose
from islands.diagnosis.run import DiagnosisRun
from islands.effects.catalogue import CATALOGUE
from islands.effects.hysteresis import BACKLASH, STICTION
from islands.effects.hysteresis import stick as stick_between_samples
from islands.effects.interface.context import Signal
from islands.effects.quantiser import QUANTISED_INPUT
from islands.kernels.memory_operators import play_from
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.output_equation import add_output_equation
from islands.simulators.specification.equations import OdeSpec
from islands.simulators.specification.factory import make_simulator

#: Standard deviation of the noise.
NOISE = 0.01


def stick(u: Signal, band: float) -> Signal:
    places = [float(u[0])]
    for command in u.tolist():
        places.append(command if abs(command - places[-1]) > band else places[-1])
    return np.array(places[1:])


MOVES: dict[str, Callable[[Signal], Signal]] = {
    "quantised-input": lambda u: 0.5 * np.round(u / 0.5),
    "stiction": lambda u: stick(u, 0.6),
    "none": lambda u: u,
}


def make_record(name: str, seed: int) -> Dataset:
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-2.0, 2.0, 100), rng.integers(15, 45, 100))[:1200]
    x = lfilter([0.0, 0.03], [1.0, -1.75, 0.77], MOVES[name](u))
    noise = lfilter([1.0], [1.0, -0.8 if name == "none" else 0.0], rng.standard_normal(u.size))
    return Dataset(u, x + NOISE * noise, 0.1, ("u_V",), "y_V", ("V",), "V")


def make_smooth_record(step: float, limit: float) -> Dataset:
    """Return a record of an actuator with a limit that moves in steps; its input takes all values."""
    rng = np.random.default_rng(5)
    u = lfilter([0.3], [1.0, -0.7], rng.standard_normal(1200))
    moved = step * np.round(np.clip(u, -limit, limit) / step)
    x = lfilter([0.0, 0.3], [1.0, -0.9, 0.2], moved)
    return Dataset(u, x + 0.002 * rng.standard_normal(u.size), 0.1, ("u_V",), "y_V", ("V",), "V")


def make_lag(direct: float) -> OdeSpec:
    """Return a simulation of a lag, of which some input passes at once."""
    document = {
        "kind": "ode",
        "name": "lag",
        "input": "u",
        "output": "x + d*u" if direct else "x",
        "equations": "dx/dt = (u - x)/T",
        "parameters": {"T": 0.05, "d": direct} if direct else {"T": 0.05},
        "states": {"x": {"unit": "V"}},
    }
    return OdeSpec.model_validate(document)


def fit(record: Dataset, simulation: str | OdeSpec = "linear:2") -> tuple[CalibrationResult, Target]:
    fitted = count_fitted_samples(record)
    simulator = make_simulator(simulation, record)
    context = make_context(record, simulator, fitted)
    simulation = ExtendedSimulator(add_output_equation(simulator, context), (), context)
    target = make_target(record, fitted, {})
    return calibrate(simulation, target, simulation.nominal), target


@pytest.mark.ci
@pytest.mark.parametrize("seed", [0, *(pytest.param(each, marks=pytest.mark.nightly) for each in (1, 2))])
@pytest.mark.parametrize("name", MOVES)
def test_jumps_of_an_actuator_are_found_behind_a_slow_plant(name: str, seed: int) -> None:
    base, target = fit(make_record(name, seed))
    found = fit_jumping_inputs(base, target, DiagnosisRun((QUANTISED_INPUT, STICTION)))
    exact = [each.effect.name for each in found if each.fit.mean_square**0.5 < 1.1 * NOISE]
    assert exact == ([] if name == "none" else [name])


@pytest.mark.nightly
@pytest.mark.parametrize("direct", [0.0, 1.0])
def test_steps_that_an_input_passes_within_a_sample_are_found(direct: float) -> None:
    """A plant that responds at once has the steps at each sample, and another one their average."""
    rng, fine = np.random.default_rng(3), 40
    times = np.arange(600 * fine) / (100.0 * fine)
    waves = zip(rng.uniform(0.3, 1.0, 6), np.arange(1.0, 7.0), rng.uniform(0.0, 6.0, 6), strict=True)
    u = sum(size * np.sin(rate * times + phase) for size, rate, phase in waves)
    step = 2.0 * np.max(np.abs(u)) / 157.3
    moved = step * np.round(u / step)
    decay = np.exp(-1.0 / (5.0 * fine))
    y = (lfilter([1.0 - decay], [1.0, -decay], moved) + direct * moved)[::fine]
    noise = (0.15 if direct else 0.03) * step * rng.standard_normal(y.size)
    record = Dataset(u[::fine], y + noise, 0.01, ("u_V",), "y_V", ("V",), "V")
    base, target = fit(record, make_lag(direct))
    (found,) = fit_jumping_inputs(base, target, DiagnosisRun([QUANTISED_INPUT]))
    assert found.fit.values[found.fit.simulation.get_slice(QUANTISED_INPUT)] == pytest.approx(
        (step, 0.0), rel=1e-3, abs=0.05 * step
    )
    assert found.fit.mean_square < 0.7 * base.mean_square


@pytest.mark.nightly
def test_slips_between_samples_need_differential_equations() -> None:
    """Its difference equation reads the slips at the samples only."""
    fine, times = 20, np.arange(24_000) / 1000.0
    u = 2.0 * np.sin(1.3 * times) + np.sin(3.1 * times + 1.0)
    moved, place = [], float(u[0])
    for command in u.tolist():
        place += 0.35 * np.trunc((command - place) / 0.35)
        moved.append(place)
    y = lfilter([0.00009], [1.0, -1.994, 0.99409], moved)[::fine]
    noise = 0.001 * np.random.default_rng(1).standard_normal(y.size)
    base, target = fit(Dataset(u[::fine], y + noise, 0.02, ("u_V",), "y_mm", ("V",), "mm"))
    (found,) = fit_jumping_inputs(base, target, DiagnosisRun([STICTION]))
    assert get_linear(base) is not None
    assert found.fit.simulation.simulator.is_continuous_time
    assert found.fit.mean_square**0.5 < 1.5 * 0.001 < 0.1 * base.mean_square**0.5
    assert found.fit.values[found.fit.simulation.get_slice(STICTION)] == pytest.approx(0.35, rel=1e-3)


@pytest.mark.nightly
def test_steps_are_found_behind_a_play_though_the_catalogue_has_them_before_it() -> None:
    """The search divides what the play leaves of the input."""
    record, play = make_smooth_record(0.2, np.inf), CATALOGUE["backlash"]
    moved = 0.2 * np.round(play_from(np.ascontiguousarray(record.u[:, 0]), 0.15) / 0.2)
    noise = 0.002 * np.random.default_rng(8).standard_normal(record.samples)
    base, target = fit(replace(record, y=lfilter([0.0, 0.3], [1.0, -0.9, 0.2], moved) + noise))
    behind = screen_effects(base, target, DiagnosisRun([play]))[0].fit
    (found,) = fit_jumping_inputs(behind, target, DiagnosisRun([QUANTISED_INPUT]))
    simulation = found.fit.simulation
    assert simulation.effects == (play, QUANTISED_INPUT)
    width, step = (found.fit.values[simulation.get_slice(each)][0] for each in simulation.effects)
    assert (width, step) == (pytest.approx(0.15, rel=0.03), pytest.approx(0.2, rel=0.01))


@pytest.mark.parametrize("seed", range(3))
def test_steps_and_a_play_of_half_a_step_are_stick_slip(seed: int) -> None:
    rng = np.random.default_rng(seed)
    u = lfilter([0.1], [1.0, -0.9], rng.standard_normal(1200))
    x = lfilter([0.0, 0.3], [1.0, -0.9, 0.2], stick_between_samples(u, 0.2))
    base, target = fit(Dataset(u, x + 0.01 * rng.standard_normal(u.size), 0.1, ("u_V",), "y_V", ("V",), "V"))
    pair = (QUANTISED_INPUT, BACKLASH)
    simulation = base.simulation.with_effects(pair)
    start = transfer_parameters(base.values, base.simulation, simulation)
    start[simulation.get_slice(QUANTISED_INPUT)] = 0.2, u[0] % 0.2 - 0.1
    start[simulation.get_slice(BACKLASH)] = 0.095
    is_given = np.arange(start.size) >= start.size - 3
    together = calibrate(simulation, target, start, is_fixed=is_given)
    assert together.mean_square**0.5 < 0.013
    hypothesis = Hypothesis(together, compute_cost(together, together), pair)
    found = find_stick_slip(hypothesis, target, DiagnosisRun([STICTION]))
    assert found is not None
    assert found.fit.values[found.fit.simulation.get_slice(STICTION)] == pytest.approx([0.2], rel=1e-3)
    assert found.fit.mean_square**0.5 == pytest.approx(0.01, rel=0.1)
    assert find_stick_slip(hypothesis, target, DiagnosisRun(pair)) is None


@pytest.mark.ci
@pytest.mark.nightly
@pytest.mark.parametrize(("name", "value"), [("quantised-input", 0.5), ("stiction", 0.6)])
def test_jumping_actuator_is_named(name: str, value: float) -> None:
    record = make_record(name, 0)
    effects = (
        "dead-zone",
        "input-saturation",
        "backlash",
        "delay",
        "quantised-input",
        "stiction",
        "input-curve",
    )
    catalogue = [CATALOGUE[each] for each in effects]
    found = diagnose(record, make_simulator("linear:2", record), catalogue=catalogue)
    (cause,) = found.causes
    assert (cause.name, cause.is_claimed) == (name, True)
    # The levels of the input do not tell closer values apart.
    assert next(iter(cause.parameters.values())).value == pytest.approx(value, abs=0.1)
