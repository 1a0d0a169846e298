"""Initial states of recordings that the estimation part does not determine."""

from dataclasses import replace

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate, evaluate_fit
from islands.diagnosis.calibration.target import Target
from islands.records.segments import find_bounds


def fit_initial_states(
    fit: CalibrationResult, target: Target, first: int, last: int | None = None
) -> CalibrationResult:
    """Fit the initial states of recordings.

    All other parameters keep their values. Other recordings do not predict the initial state of a recording
    that is not fitted; with a wrong one, the errors would be those of the transient.

    Parameters
    ----------
    fit : CalibrationResult
    target : Target
        Target of the fit; the states are fitted to the unweighted output of their recordings.
    first, last : int
        The recordings begin at sample ``first`` or later, and before ``last``; by default until the end.
    """
    simulation = fit.simulation
    bounds = find_bounds(simulation.context.segments, target.y.size)
    end = target.y.size if last is None else last
    recordings = [index for index, (begin, _) in enumerate(bounds) if first <= begin < end]
    is_initial = np.array([parameter.initial for parameter in simulation.parameters], dtype=bool)
    is_state = is_initial & np.isin(simulation.recordings, recordings)
    if not is_state.any():
        return fit
    is_fitted = np.zeros(target.y.size, dtype=bool)
    for index in recordings:
        is_fitted[slice(*bounds[index])] = True
    is_fitted &= ~np.isnan(target.y)
    of_states = replace(target, noise=None, estimation_part=is_fitted, prior_std={})
    values = calibrate(simulation, of_states, fit.values, is_fixed=~is_state).values
    return evaluate_fit(simulation, target, values)
