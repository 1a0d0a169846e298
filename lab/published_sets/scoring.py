"""Error and coverage on the test of a benchmark, from the outputs that its rule allows only."""

from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from islands.errors import ModelError
from islands.facade.results.model_simulation import predict
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.latent import LatentModel
from islands.records.dataset import Dataset
from islands.records.signal_map import match_rate
from islands.simulation.initial_outputs import simulate_freely
from islands.validation.ensemble import Ensemble
from islands.validation.prediction_bands import LEVEL, OutputBands, PredictionBands
from lab.published_sets.definition import BenchmarkTest

M = TypeVar("M", bound=AnyModel)


def measure_rmse(model: AnyModel, test: BenchmarkTest) -> float:
    """Return the RMSE of the free run over the scored samples and all outputs.

    The simulation begins after the initial samples that the benchmark allows, and reads no later output. A
    latent model estimates its initial states from them. Predictions of a model of means are held.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
    test : BenchmarkTest

    Raises
    ------
    ModelError
        The free run diverges, or the model needs more initial samples.
    RecordError
        The test does not match the model.
    """
    model, warm_up = _limit_memory(model, test), test.known // model.average
    average = model.average
    if warm_up < model.maximum_lag:
        raise ModelError(
            f"the model needs {model.maximum_lag * average} initial samples, the test allows {test.known}"
        )
    return measure_simulation(_simulate(model, test, warm_up), test, average)


def measure_simulation(simulated: NDArray[np.float64], test: BenchmarkTest, average: int = 1) -> float:
    """Return the RMSE of a simulation over the scored samples and all outputs.

    Parameters
    ----------
    simulated : ndarray
        Of the shape of the outputs.
    test : BenchmarkTest
    average : int
        Samples of a mean, if the model predicts means. The last samples may be fewer, and are not scored.

    Raises
    ------
    ModelError
        The simulation diverges.
    """
    scored = np.zeros(test.record.samples, bool)
    for begin, end in test.record.bounds:
        scored[begin + test.unscored : begin + (end - begin) // average * average] = True
    errors = (simulated - test.record.y)[scored]
    if not np.isfinite(errors).all():
        raise ModelError("the free run diverges")
    return float(np.sqrt(np.mean(errors**2)))


def measure_coverage(
    model: AnyModel, bands: tuple[PredictionBands, ...], test: BenchmarkTest
) -> float | None:
    """Return the fraction of the scored samples of all outputs inside of the band of the default level.

    The bands start as the free run of `measure_rmse`. Of a model of means, the samples are means.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
        Model whose free run has an error on the test.
    bands : tuple of PredictionBands
        One for each output; empty if there are none.
    test : BenchmarkTest

    Returns
    -------
    float or None
        None without bands.
    """
    if not bands:
        return None
    model, warm_up = _limit_memory(model, test), test.known // model.average
    # The outputs of other models share an ensemble, which remains one.
    if isinstance(model, LatentModel | CoupledLatentModel):
        bands = tuple(_limit_members(each, test) for each in bands)
    visible = test.visible.map(partial(match_rate, model))
    made = bands[0] if len(bands) == 1 else OutputBands(bands)
    found, records = made.predict(model, visible, LEVEL, warm_up).outputs, test.record.records
    if len(found) != len(records):
        raise ModelError("the model and the test have different numbers of outputs")
    inside: list[NDArray[np.bool_]] = []
    for band, record in zip(found, records, strict=True):
        measured = match_rate(model, record)
        within = (band.lower <= measured.y) & (measured.y <= band.upper)
        first = -(-test.unscored // model.average)
        inside += [within[begin + first : end] for begin, end in measured.bounds]
    return float(np.concatenate(inside).mean())


def separate_reason(error: float | str) -> tuple[float | None, str | None]:
    """Return an error and no reason, or none and the reason why there is none."""
    return (None, error) if isinstance(error, str) else (error, None)


def _limit_members(bands: PredictionBands, test: BenchmarkTest) -> PredictionBands:
    """Return bands whose ensemble estimates its initial states from the samples that a test allows."""
    structures = bands.ensemble.structures
    limited = tuple(replace(each, model=_limit_memory(each.model, test)) for each in structures)
    return replace(bands, ensemble=Ensemble(limited))


def _limit_memory(model: M, test: BenchmarkTest) -> M:
    """Return a model that estimates its initial states from the samples that a test allows."""
    if isinstance(model, LatentModel):
        return replace(model, memory=min(model.memory, test.known))
    if isinstance(model, CoupledLatentModel):
        return replace(model, models=tuple(_limit_memory(each, test) for each in model.models))
    return model


def _simulate(model: AnyModel, test: BenchmarkTest, warm_up: int) -> NDArray[np.float64]:
    """Return the free run, a value for each sample and output; NaN in the warm-up and after a divergence."""
    visible = test.visible
    if isinstance(visible, Dataset) and not isinstance(model, CoupledModel):
        return predict(model, visible, warm_up)
    means = simulate_freely(model, visible, warm_up).y
    simulated, place = np.full(visible.y.shape, np.nan), 0
    for begin, end in visible.bounds:
        count = (end - begin) // model.average
        held = np.repeat(means[place : place + count], model.average, axis=0)
        simulated[begin : begin + len(held)] = held
        place += count
    return simulated
