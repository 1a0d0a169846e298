"""Linear simulation behind a sensor that shows the absolute value: its signs are estimated first.

A linear simulation that is calibrated to an absolute value is far from the plant, so that no calibration from
there finds the plant behind the sensor. Low-passes and resonances of the input, counted from several levels,
have absolute values that resemble the output. The best of them give it signs. A linear model of the output
with signs gives better ones, until they remain (alternating projections, as for the phase of a field whose
intensity is measured: Fienup, Phase retrieval algorithms: a comparison, 1982).
"""

from collections.abc import Iterator

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.discovery.state_equations import (
    get_linear,
    make_fitted_record,
    transfer_linear_values,
)
from islands.diagnosis.inference.screening import ScreenedEffect
from islands.diagnosis.run import DiagnosisRun
from islands.effects.interface.context import Signal
from islands.effects.nonlinearity import UNSIGNED_SENSOR
from islands.errors import RecordError
from islands.kernels.linear_filter import filter_linearly
from islands.records.dataset import Dataset
from islands.simulators.linear import LinearSimulator, estimate_linear

#: Number of time constants and natural frequencies of the filters, and damping ratios of the resonances.
_TIMES, _FREQUENCIES, _DAMPINGS = 10, 12, (0.03, 0.15, 0.5)

#: Levels from which a filtered input is counted, as quantiles of it.
_LEVELS = np.linspace(0.05, 0.95, 19)

#: Number of sequences of signs that are refined, and the mean product of two of them that are the same.
_STARTS, _SAME = 3, 0.9

#: Maximum number of linear models of the output with signs.
_ITERATIONS = 15


def fit_unsigned_output(base: CalibrationResult, target: Target, run: DiagnosisRun) -> ScreenedEffect | None:
    """Return a linear simulation behind a sensor of the absolute value.

    Parameters
    ----------
    base : CalibrationResult
        The simulation without effects.
    target, run
        Arguments of a search.

    Returns
    -------
    ScreenedEffect or None
        None if the simulation is not linear or has prior values, if the search does not include such a
        sensor, or if the record is too short or has a constant input.
    """
    linear = get_linear(base)
    if linear is None or target.prior_std or UNSIGNED_SENSOR not in run.effects:
        return None
    record = make_fitted_record(base.simulation.context, target)
    try:
        found = _estimate(linear.denominator.size, linear.delay, record)
    except RecordError:  # It is too short for a linear model.
        return None
    if found is None:
        return None
    simulation = base.simulation.with_effects((UNSIGNED_SENSOR,))
    start = simulation.nominal
    start[: len(linear.parameters)] = transfer_linear_values(found, linear)
    start[simulation.get_slice(UNSIGNED_SENSOR)] = 1.0
    return ScreenedEffect(UNSIGNED_SENSOR, calibrate(simulation, target, start))


def _estimate(order: int, delay: int, record: Dataset) -> LinearSimulator | None:
    """Return the linear model whose absolute output is closest to a record; None if its input is constant."""
    starts = _list_signs(record.u[:, 0], record.y, order)
    found = [_refine(order, delay, record, signs) for signs in starts]
    return min(found, key=lambda each: each[0])[1] if found else None


def _refine(order: int, delay: int, record: Dataset, signs: Signal) -> tuple[float, LinearSimulator]:
    """Return the best linear model with signs that follow from it, with its mean squared error."""
    best: tuple[float, LinearSimulator] | None = None
    for _ in range(_ITERATIONS):
        model = estimate_linear(order, delay, Dataset(record.u, signs * record.y, record.dt, ("u",)))
        simulated = model.simulate_at_rest(record.u[:, 0])
        error = float(np.mean((np.abs(simulated) - record.y) ** 2))
        if best is None or error < best[0]:
            best = error, model
        before, signs = signs, np.where(simulated < 0.0, -1.0, 1.0)
        if np.array_equal(signs, before):
            break
    assert best is not None
    return best


def _list_signs(u: Signal, y: Signal, order: int) -> list[Signal]:
    """Return the signs of filtered inputs whose absolute values resemble an output most."""
    deviations = y - y.mean()
    found = []
    for filtered in _filter_input(u - u[0], order):
        for level in np.quantile(filtered, _LEVELS):
            shape = np.abs(filtered - level)
            size = float(np.std(shape))
            if size > 0.0:
                found.append((float(deviations @ shape) / size, np.where(filtered < level, -1.0, 1.0)))
    found.sort(key=lambda each: -each[0])
    signs: list[Signal] = []
    for _, each in found:
        if all(abs(float(np.mean(each * other))) < _SAME for other in signs):
            signs.append(each)
        if len(signs) == _STARTS:
            break
    return signs


def _filter_input(u: Signal, order: int) -> Iterator[Signal]:
    """Yield low-passes of an input, and resonances if there are two poles."""
    for time in np.geomspace(2.0, u.size / 20.0, _TIMES).tolist():
        pole = float(np.exp(-1.0 / time))
        yield filter_linearly([1.0 - pole], [1.0, -pole], u)
    for frequency in np.geomspace(20.0 * np.pi / u.size, 1.5, _FREQUENCIES if order > 1 else 0).tolist():
        for damping in _DAMPINGS:
            complex_pole = np.exp(frequency * complex(-damping, np.sqrt(1.0 - damping**2)))
            poles = [1.0, -2.0 * complex_pole.real, abs(complex_pole) ** 2]
            yield filter_linearly([0.0, sum(poles)], poles, u)
