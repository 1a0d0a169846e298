"""Output-error fit of the true structure that begins at the truth."""

import numpy as np

from islands.estimation.linear.identify import scale_signals
from islands.estimation.linear.model import LinearModel, make_model
from islands.estimation.linear.noise import WHITE
from islands.estimation.linear.regression import make_structure, minimise, project
from lab.linear.plants import Trial


def fit_from_truth(trial: Trial) -> LinearModel:
    """Return the model of least output error near the true one, with the true order and dead times."""
    signals, scales = scale_signals(trial.u, trial.y, 1.0)
    plant = trial.plant
    delays = plant.delays[None]
    # What the inputs were before the record, the identification does not know either.
    structure = make_structure(plant.sections, 0, delays, np.zeros(delays.shape, bool), (WHITE,), before=None)
    start = project(signals, structure)
    assert start is not None
    return make_model(signals, minimise(signals, start, 50, 1e-6), scales, ())
