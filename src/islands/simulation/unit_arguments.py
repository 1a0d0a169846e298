"""Arguments of the units of a latent model in its free run."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.models.latent import LatentModel
from islands.records.dataset import Dataset
from islands.records.signal_map import map_signals
from islands.simulation.blocks import make_simulator


@dataclass(frozen=True, slots=True, eq=False)
class UnitRun:
    """Free run of a latent model.

    Attributes
    ----------
    arguments : ndarray, shape (units, samples)
        Arguments of the units.
    output : ndarray, shape (samples,)
        Output, less the offset of the model. Both have the samples from the warm-up of a segment until the
        output leaves the range of the record by more than this range, as in a divergence.
    """

    arguments: NDArray[np.float64]
    output: NDArray[np.float64]


def simulate_units(
    model: LatentModel, record: Dataset, warm_up: int, parameters: NDArray[np.float64]
) -> list[UnitRun]:
    """Return the free run with every set of parameters.

    Parameters
    ----------
    model : LatentModel
        Its parameters give the initial states of every segment, from which all sets start.
    record : Dataset
    warm_up : int
        Number of samples before the first prediction.
    parameters : ndarray, shape (sets, parameters)

    Raises
    ------
    RecordError, SettingsError
        As in `free_run`.
    """
    signals, _ = map_signals(model, record)
    simulate = make_simulator(model, signals, None, warm_up)
    known = signals.y[~np.isnan(signals.y)]
    bound = float(np.abs(known).max() + np.ptp(known)) if np.ptp(known) else np.inf
    # An input that is read early is rolled within the warm-up of its segment.
    leads = model.leads[1 + model.order :]
    u = np.array([np.roll(signals.u[:, place], lead) for place, lead in enumerate(leads)])
    runs = []
    for values, found in zip(parameters, simulate(parameters), strict=True):
        simulate.remove_diverged(found[:1], [bound])
        kept = np.isfinite(found[: 1 + model.order]).all(axis=0)
        of = model.with_parameters(values.tolist()).matrices
        states, inputs = found[1 : 1 + model.order, kept], u[:, kept]
        runs.append(UnitRun(of["W"] @ states + of["V"] @ inputs + of["s"][:, None], found[0, kept]))
    return runs
